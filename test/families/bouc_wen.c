/* What the family bouc_wen computes often: the differential equation of one joint over the instants,
   and the motion of a chain with such joints by the method of Dormand and Prince, order 8. */
#include <math.h>
#include <string.h>

enum { stages = 12, largest = 16 };

/* dz/ds for steps of one sign. */
static double rate(double n, double beta, double z, int forward)
{
   const double w = forward ? z : -z;
   return 1.0 - pow(fabs(z), n) * (w > 0.0 ? 1.0 : 1.0 - 2.0 * beta);
}

/* z after a step of y over the limit, by the classical method of Runge and Kutta. */
double one_step(double n, double beta, double ds, double z)
{
   const int forward = ds > 0.0;
   const double a = rate(n, beta, z, forward), b = rate(n, beta, z + 0.5 * ds * a, forward);
   const double c = rate(n, beta, z + 0.5 * ds * b, forward);
   return z + ds * (a + 2.0 * b + 2.0 * c + rate(n, beta, z + ds * c, forward)) / 6.0;
}

/* z after all steps, and after each of them where that is to be kept. */
double turned(double n, double beta, int count, const double *ds, double z, double *kept)
{
   for (int k = 0; k < count; k++) {
      z = one_step(n, beta, ds[k], z);
      if (kept)
         kept[k] = z;
   }
   return z;
}

/* A chain of n masses with m joints; rows(m, n) of the joints, pull: stiffness over limit. */
struct chain {
   int n, m;
   double omega;
   const double *inverse_mass, *damping, *stiffness, *constant, *cosine, *sine;
   const double *rows, *pull, *limit, *exponent, *beta;
};

/* x: displacements, velocities, z of the joints. */
static void slope(const struct chain *c, double t, const double *x, double *dx)
{
   const int n = c->n, m = c->m;
   const double *v = x + n, *z = x + 2 * n;
   double rest[largest];
   for (int i = 0; i < n; i++) {
      rest[i] = c->constant[i] + c->cosine[i] * cos(c->omega * t) + c->sine[i] * sin(c->omega * t);
      for (int j = 0; j < n; j++)
         rest[i] -= c->stiffness[i * n + j] * x[j] + c->damping[i * n + j] * v[j];
   }
   for (int k = 0; k < m; k++) {
      double ds = 0.0;
      for (int j = 0; j < n; j++) {
         ds += c->pull[k] * c->rows[k * n + j] * v[j];
         rest[j] -= c->rows[k * n + j] * c->limit[k] * z[k];
      }
      dx[2 * n + k] = ds * rate(c->exponent[k], c->beta[k], z[k], ds > 0.0);
   }
   for (int i = 0; i < n; i++) {
      dx[i] = v[i];
      dx[n + i] = 0.0;
      for (int j = 0; j < n; j++)
         dx[n + i] += c->inverse_mass[i * n + j] * rest[j];
   }
}

/* Displacements at increasing times (count, n) from x at t = 0 on; steps end at the times. Tables as
   of the method's author: a(12, 12), b and c(12), error of order 3 and 5 (13). Returns 0. */
int follow(const struct chain *chain, const double *a, const double *b, const double *c,
           const double *error_3, const double *error_5, double relative, double absolute,
           double *x, int count, const double *times, double *displacement)
{
   const int size = 2 * chain->n + chain->m;
   double k[stages + 1][3 * largest], at[3 * largest], t = 0.0, h = 1e-3 / chain->omega;
   if (chain->n > largest || chain->m > largest)
      return 1;
   slope(chain, t, x, k[0]);
   for (int i = 0; i < count; i++) {
      while (t < times[i]) {
         const int last = t + h >= times[i];
         const double dt = last ? times[i] - t : h;
         double sum_3 = 0.0, sum_5 = 0.0, error;
         for (int s = 1; s < stages; s++) {
            for (int j = 0; j < size; j++) {
               at[j] = x[j];
               for (int r = 0; r < s; r++)
                  at[j] += dt * a[s * stages + r] * k[r][j];
            }
            slope(chain, t + c[s] * dt, at, k[s]);
         }
         for (int j = 0; j < size; j++) {
            at[j] = x[j];
            for (int s = 0; s < stages; s++)
               at[j] += dt * b[s] * k[s][j];
         }
         slope(chain, t + dt, at, k[stages]);
         for (int j = 0; j < size; j++) {
            const double scale = absolute + relative * fmax(fabs(x[j]), fabs(at[j]));
            double by_3 = 0.0, by_5 = 0.0;
            for (int s = 0; s <= stages; s++) {
               by_3 += error_3[s] * k[s][j];
               by_5 += error_5[s] * k[s][j];
            }
            sum_3 += by_3 * by_3 / (scale * scale);
            sum_5 += by_5 * by_5 / (scale * scale);
         }
         error = sum_5 > 0.0 ? dt * sum_5 / sqrt((sum_5 + 0.01 * sum_3) * size) : 0.0;
         if (!(error >= 0.0) || dt < 1e-14 * (1.0 + t))
            return 2;
         const double factor = error > 0.0 ? 0.9 * pow(error, -0.125) : 10.0;
         if (error < 1.0) {
            t = last ? times[i] : t + dt;
            memcpy(x, at, size * sizeof *x);
            memcpy(k[0], k[stages], size * sizeof *x);
            /* A step that was cut short says nothing against the one before. */
            h = last ? fmax(h, dt * fmin(10.0, factor)) : dt * fmin(10.0, factor);
         } else
            h = dt * fmax(0.2, factor);
      }
      memcpy(displacement + i * chain->n, x, chain->n * sizeof *x);
   }
   return 0;
}
