/* Periodic motions of a few masses with pairs that open, close and rub, by shooting along a
 * frequency: Runge-Kutta of order 4, Newton's method on the map of a period with differences, and
 * marches where it fails or ends in a motion that is not stable. Shares nothing with the program.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX = 16 };

typedef struct {
   int n, n_pairs, steps;
   const double *ic, *ik;           /* M^-1 C, M^-1 K (n, n), by rows */
   const double *inverse;           /* M^-1 (n, n) */
   const double *cosine, *sine, *rest; /* of the load over the mass (n) */
   const int *tangential, *normal;  /* dof of each pair from 0, below 0: none */
   const double *kt, *kn, *gap, *load, *mu;
   double omega;
} system_type;

/* Forces on the dofs, with the sliders where they stand at the end of a step. */
static void forces(const system_type *s, const double *u, const double *z, double *f, double *moved)
{
   memset(f, 0, sizeof(double)*s->n);
   for (int p = 0; p < s->n_pairs; p++) {
      double press = s->load[p];
      if (s->normal[p] >= 0) {
         press = s->kn[p]*(u[s->normal[p]] - s->gap[p]) + s->load[p];
         if (press < 0.0) press = 0.0;
         f[s->normal[p]] -= press;
      }
      moved[p] = z[p];
      if (s->tangential[p] < 0) continue;
      double hold = s->kt[p]*(u[s->tangential[p]] - z[p]), limit = s->mu[p]*press;
      if (hold > limit) hold = limit;
      if (hold < -limit) hold = -limit;
      moved[p] = u[s->tangential[p]] - hold/s->kt[p];
      f[s->tangential[p]] -= hold;
   }
}

static void slope(const system_type *s, double t, const double *y, const double *z, double *dy)
{
   double f[MAX], moved[MAX];
   const double c = cos(s->omega*t), d = sin(s->omega*t);
   forces(s, y, z, f, moved);
   for (int i = 0; i < s->n; i++) {
      double a = s->cosine[i]*c + s->sine[i]*d + s->rest[i];
      for (int j = 0; j < s->n; j++)
         a += s->inverse[i*s->n + j]*f[j] - s->ic[i*s->n + j]*y[s->n + j] - s->ik[i*s->n + j]*y[j];
      dy[i] = y[s->n + i];
      dy[s->n + i] = a;
   }
}

/* One period from y (u, v, sliders); the largest |u| of each dof where `top` is given. */
static void period(const system_type *s, double *y, double *top)
{
   const int m = 2*s->n;
   const double h = 2.0*M_PI/s->omega/s->steps;
   double k1[MAX], k2[MAX], k3[MAX], k4[MAX], w[MAX], f[MAX], moved[MAX];
   if (top) memset(top, 0, sizeof(double)*s->n);
   for (int step = 0; step < s->steps; step++) {
      const double t = h*step, *z = y + m;
      slope(s, t, y, z, k1);
      for (int i = 0; i < m; i++) w[i] = y[i] + 0.5*h*k1[i];
      slope(s, t + 0.5*h, w, z, k2);
      for (int i = 0; i < m; i++) w[i] = y[i] + 0.5*h*k2[i];
      slope(s, t + 0.5*h, w, z, k3);
      for (int i = 0; i < m; i++) w[i] = y[i] + h*k3[i];
      slope(s, t + h, w, z, k4);
      for (int i = 0; i < m; i++) y[i] += h*(k1[i] + 2.0*k2[i] + 2.0*k3[i] + k4[i])/6.0;
      forces(s, y, z, f, moved);
      memcpy(y + m, moved, sizeof(double)*s->n_pairs);
      if (top) for (int i = 0; i < s->n; i++) if (fabs(y[i]) > top[i]) top[i] = fabs(y[i]);
   }
}

static int solve(int n, double *a, double *b)
{
   for (int k = 0; k < n; k++) {
      int best = k;
      for (int i = k + 1; i < n; i++) if (fabs(a[i*n + k]) > fabs(a[best*n + k])) best = i;
      if (!(fabs(a[best*n + k]) > 0.0)) return 0;
      for (int j = 0; j < n; j++) { double t = a[k*n+j]; a[k*n+j] = a[best*n+j]; a[best*n+j] = t; }
      double t = b[k]; b[k] = b[best]; b[best] = t;
      for (int i = k + 1; i < n; i++) {
         const double x = a[i*n + k]/a[k*n + k];
         for (int j = k; j < n; j++) a[i*n + j] -= x*a[k*n + j];
         b[i] -= x*b[k];
      }
   }
   for (int k = n - 1; k >= 0; k--) {
      for (int j = k + 1; j < n; j++) b[k] -= a[k*n + j]*b[j];
      b[k] /= a[k*n + k];
   }
   return 1;
}

/* Spectral radius by squaring. */
static double radius(int n, const double *given)
{
   double a[MAX*MAX], b[MAX*MAX], log_of = 0.0, power = 1.0;
   memcpy(a, given, sizeof(double)*n*n);
   for (int turn = 0; turn < 14; turn++) {
      double size = 0.0;
      for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) {
         double x = 0.0;
         for (int k = 0; k < n; k++) x += a[i*n + k]*a[k*n + j];
         b[i*n + j] = x;
         if (fabs(x) > size) size = fabs(x);
      }
      power *= 2.0;
      if (!(size > 0.0)) return 0.0;
      log_of = 2.0*log_of + log(size);
      for (int i = 0; i < n*n; i++) a[i] = b[i]/size;
   }
   return exp(log_of/power);
}

/* The size of a state and what it misses after its period. */
static double gap_of(const system_type *s, int m, const double *x, const double *end, double *size)
{
   double miss = 0.0;
   *size = 0.0;
   for (int i = 0; i < m; i++) {
      const double scale = i >= s->n && i < 2*s->n ? 1.0/s->omega : 1.0;
      *size = fmax(*size, fabs(end[i])*scale);
      miss = fmax(miss, fabs(end[i] - x[i])*scale);
   }
   return miss;
}

/* The derivative of the map of a period, by differences. */
static void differentiate(const system_type *s, int m, const double *x, const double *end,
                          double size, double *phi)
{
   double other[MAX];
   for (int j = 0; j < m; j++) {
      const double step = 1e-6*size*(j >= s->n && j < 2*s->n ? s->omega : 1.0) + 1e-300;
      memcpy(other, x, sizeof(double)*m);
      other[j] += step;
      period(s, other, NULL);
      for (int i = 0; i < m; i++) phi[i*m + j] = (other[i] - end[i])/step;
   }
}

/* Newton's method from y, with the derivative of the last motion while that serves; 1 where it
 * closes, with the motion's radius and tops. */
static int close_orbit(const system_type *s, double *y, double *rho, double *top, double *phi,
                       int *is_known)
{
   const int m = 2*s->n + s->n_pairs;
   double end[MAX], a[MAX*MAX], rest[MAX], x[MAX], last = 1e300;
   int fresh = 0;
   memcpy(x, y, sizeof(double)*m);
   for (int round = 0; round < 22; round++) {
      double size, miss;
      memcpy(end, x, sizeof(double)*m);
      period(s, end, top);
      miss = gap_of(s, m, x, end, &size);
      if (!(size < 1e12)) break;
      if (miss <= 1e-8*size) {
         differentiate(s, m, x, end, size, phi);
         *is_known = 1;
         memcpy(a, phi, sizeof(double)*m*m);
         /* Sliders that never slip keep where they are. */
         for (int p = 2*s->n; p < m; p++)
            if (fabs(a[p*m + p] - 1.0) < 1e-9) a[p*m + p] = 0.0;
         *rho = radius(m, a);
         memcpy(y, x, sizeof(double)*m);
         return 1;
      }
      if (!*is_known || miss > 0.3*last) {
         if (++fresh > 8) break;
         differentiate(s, m, x, end, size, phi);
         *is_known = 1;
      }
      last = miss;
      for (int i = 0; i < m; i++) {
         rest[i] = end[i] - x[i];
         int moves = i < 2*s->n;
         for (int j = 0; j < m; j++) {
            a[i*m + j] = (i == j) - phi[i*m + j];
            if (fabs(a[i*m + j]) > 1e-9) moves = 1;
         }
         if (!moves) { a[i*m + i] = 1.0; rest[i] = 0.0; }
      }
      if (!solve(m, a, rest)) break;
      for (int i = 0; i < m; i++) x[i] += rest[i];
   }
   *is_known = 0;
   return 0;
}

/* A stable motion from y, with marches of so many periods in between. */
static int settle(const system_type *s, double *y, int marches, int n_march, double *top)
{
   double rho = 2.0, kept[MAX], phi[MAX*MAX];
   int is_known = 0;
   const int m = 2*s->n + s->n_pairs;
   for (int turn = 0; turn <= marches; turn++) {
      memcpy(kept, y, sizeof(double)*m);
      if (close_orbit(s, y, &rho, top, phi, &is_known)) {
         if (rho < 1.0 + 1e-6) return 1;
         for (int i = 0; i < m; i++) y[i] = turn % 2 ? kept[i] : y[i]*(1.0 + 1e-2);
      }
      for (int k = 0; k < n_march; k++) period(s, y, NULL);
   }
   return 0;
}

/* Motions from `start` towards `finish`, with steps between `shortest` and `longest` parts of the
 * frequency. Rows of `out`: frequency, whether it is periodic, largest |u| of every dof. Ends where
 * the motion is lost and `stop` is set. Returns the number of rows; y is the last state. */
int follow(int n, int n_pairs, const double *matrices, const double *vectors, const int *dofs,
           const double *pairs, double fastest, double start, double finish, double shortest,
           double longest, int stop, int most, double *y, double *out)
{
   system_type s = {n, n_pairs, 0, matrices, matrices + n*n, matrices + 2*n*n, vectors,
                    vectors + n, vectors + 2*n, dofs, dofs + n_pairs, pairs, pairs + n_pairs,
                    pairs + 2*n_pairs, pairs + 3*n_pairs, pairs + 4*n_pairs, start};
   const int m = 2*n + n_pairs, width = 2 + n;
   const double way = finish > start ? 1.0 : -1.0;
   double step = shortest, omega = start, before[MAX], phi[MAX*MAX];
   int rows = 0, is_known = 0, n_lost = 0;
   while (rows < most) {
      double top[MAX], *row = out + rows*width, change = 0.0, size = 0.0;
      s.omega = omega;
      s.steps = (int)fmax(160.0, 13.0*fastest/omega);
      memcpy(before, y, sizeof(double)*m);
      int good = close_orbit(&s, y, &change, top, phi, &is_known) && change < 1.0 + 1e-6;
      if (!good) {
         if (stop && rows > 0) break;
         memcpy(y, before, sizeof(double)*m);
         for (int k = 0; k < 30; k++) period(&s, y, NULL);
         /* A long stretch without such motions is not looked at so closely. */
         good = settle(&s, y, n_lost < 3 ? 4 : 1, n_lost < 3 ? 150 : 40, top);
         is_known = 0;
      }
      n_lost = good ? 0 : n_lost + 1;
      row[0] = omega;
      row[1] = good;
      memcpy(row + 2, top, sizeof(double)*n);
      rows++;
      if (omega == finish) break;
      change = 0.0;
      if (rows > 1) {
         for (int i = 0; i < n; i++) {
            change += pow(row[2 + i] - row[2 + i - width], 2);
            size += pow(row[2 + i], 2);
         }
         change = sqrt(change/fmax(size, 1e-300));
         step *= fmin(2.0, fmax(0.3, 0.2/fmax(change, 1e-3)));
         if (!good) step = longest;
         step = fmin(longest, fmax(shortest, step));
      }
      omega += way*step*omega;
      if ((omega - finish)*way > 0.0) omega = finish;
   }
   return rows;
}

/* A stable motion at one frequency from y, marched; 1 where it is periodic. */
int find(int n, int n_pairs, const double *matrices, const double *vectors, const int *dofs,
         const double *pairs, double fastest, double omega, int marches, int n_march, double *y,
         double *top)
{
   system_type s = {n, n_pairs, 0, matrices, matrices + n*n, matrices + 2*n*n, vectors,
                    vectors + n, vectors + 2*n, dofs, dofs + n_pairs, pairs, pairs + n_pairs,
                    pairs + 2*n_pairs, pairs + 3*n_pairs, pairs + 4*n_pairs, omega};
   s.steps = (int)fmax(160.0, 13.0*fastest/omega);
   for (int k = 0; k < n_march; k++) period(&s, y, NULL);
   return settle(&s, y, marches, n_march, top);
}
