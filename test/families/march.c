/* Masses with contact and springs, marched in time: the judge of accuracies.py, which shares no
 * code with the program.
 *
 * Between two instants the masses move as a linear system under contact forces that are linear in
 * time (constant where friction acts on mass). A step after which a pair has another state is
 * halved, down to the last level, so that changes of state are met.
 */
#include <math.h>
#include <string.h>

enum { MOST = 12, BLOCKS = 6, STATES = 16 };
enum { PLASTIC = 0, ON_MASS = 1, SMOOTH = 2, SPRING = 3 };

typedef struct {
   int n, m, levels, blocks;             /* size of the state, components, levels, blocks */
   const double *a, *g0, *g1, *s, *s0;   /* by level: state, forces at both ends, compliance */
   const double *row, *lin;              /* inputs of the state (m, n); of the load (m, 3) */
   double omega;
   const int *kind, *at;                 /* by block; components t1, t2, n or -1 (blocks, 3) */
   const double *mu, *load, *gap, *speed; /* by block; of springs: coefficient, power */
} joint;

typedef struct {
   double y[STATES], force[MOST], place[MOST], way[MOST], input[MOST];
   int state[2 * BLOCKS];
} moment;

/* (S + c I)**-1 r of two components. */
static void solve2(const double s[4], double c, const double r[2], double x[2])
{
   double a = s[0] + c, d = s[3] + c, det = a * d - s[1] * s[2];
   x[0] = (d * r[0] - s[1] * r[1]) / det;
   x[1] = (a * r[1] - s[2] * r[0]) / det;
}

/* Force of size R with (S + g/(2 R)) f = r - g/2 d, or (S + g/R) f = r where d is none; 0: sticks. */
static int slip2(const double s[4], const double r[2], double limit, const double *d, double f[2])
{
   double low = 0.0, high, g, t[2];
   int k;
   solve2(s, 0.0, r, f);
   if (hypot(f[0], f[1]) <= limit) return 0;
   if (limit <= 0.0) {
      f[0] = f[1] = 0.0;
      return 1;
   }
   high = 4.0 * (hypot(r[0], r[1]) + limit * (fabs(s[0]) + fabs(s[3])));
   for (k = 0; k < 200; k++) {
      g = 0.5 * (low + high);
      t[0] = r[0] - (d ? 0.5 * g * d[0] : 0.0);
      t[1] = r[1] - (d ? 0.5 * g * d[1] : 0.0);
      solve2(s, (d ? 0.5 : 1.0) * g / limit, t, f);
      if (hypot(f[0], f[1]) > limit) low = g; else high = g;
      if (high - low <= 1e-15 * high) break;
   }
   return 1;
}

/* Smooth friction: f = R tanh(|v|/v0) v/|v| with v = r - S f. */
static void smooth2(int two, const double s[4], const double r[2], double limit, double v0,
                    double f[2])
{
   int k, i;
   for (k = 0; k < 60; k++) {
      double v[2], size, th, t, e[2], jac[4], res[2], det, dx[2], slope;
      v[0] = r[0] - s[0] * f[0] - (two ? s[1] * f[1] : 0.0);
      v[1] = two ? r[1] - s[2] * f[0] - s[3] * f[1] : 0.0;
      size = hypot(v[0], v[1]) + 1e-300;
      th = tanh(size / v0);
      t = size / v0 > 1e-6 ? th / size : 1.0 / v0;
      e[0] = v[0] / size;
      e[1] = v[1] / size;
      slope = (1.0 - th * th) / v0;
      /* d f/d v = R (t (I - e e) + slope e e) */
      {
         double h00 = limit * (t * (1 - e[0] * e[0]) + slope * e[0] * e[0]);
         double h01 = limit * (slope - t) * e[0] * e[1];
         double h11 = limit * (t * (1 - e[1] * e[1]) + slope * e[1] * e[1]);
         jac[0] = 1.0 + h00 * s[0] + h01 * s[2];
         jac[1] = h00 * s[1] + h01 * s[3];
         jac[2] = h01 * s[0] + h11 * s[2];
         jac[3] = 1.0 + h01 * s[1] + h11 * s[3];
      }
      res[0] = limit * t * v[0] - f[0];
      res[1] = two ? limit * t * v[1] - f[1] : 0.0;
      if (!two) {
         dx[0] = res[0] / jac[0];
         dx[1] = 0.0;
      } else {
         det = jac[0] * jac[3] - jac[1] * jac[2];
         dx[0] = (jac[3] * res[0] - jac[1] * res[1]) / det;
         dx[1] = (jac[0] * res[1] - jac[2] * res[0]) / det;
      }
      for (i = 0; i < 2; i++) f[i] += dx[i];
      if (hypot(dx[0], dx[1]) <= 1e-15 * limit) break;
   }
}

static void spring1(double s, double r, double coefficient, double power, double *f)
{
   double w = r;
   int k;
   for (k = 0; k < 60; k++) {
      double a = pow(fabs(w), power - 1.0), value = w + s * coefficient * a * w - r;
      double dx = value / (1.0 + s * coefficient * power * a);
      w -= dx;
      if (fabs(dx) <= 1e-16 * (fabs(w) + 1e-12)) break;
   }
   *f = coefficient * pow(fabs(w), power - 1.0) * w;
}

/* Forces of all blocks for given free inputs; places and states follow. */
static void contact(const joint *j, const double *s, const double *free_input, const moment *from,
                    int start, moment *to)
{
   int b, c, i, k, m = j->m;
   for (k = 0; k < 400; k++) {
      double change = 0.0, size = 0.0, old[MOST];
      memcpy(old, to->force, sizeof old);
      for (b = 0; b < j->blocks; b++) {
         const int *at = j->at + 3 * b;
         double r[3] = {0, 0, 0}, limit;
         int two = at[0] >= 0 && at[1] >= 0, one = at[0] >= 0 ? at[0] : at[1];
         /* Inputs without the forces of this block. */
         for (c = 0; c < 3; c++) {
            int g = at[c];
            if (g < 0) continue;
            r[c] = free_input[g];
            for (i = 0; i < m; i++) {
               /* Within a block: t1 and t2 are solved together, n and t one after the other. */
               if (i == g || (c < 2 && (i == at[0] || i == at[1]))) continue;
               r[c] -= s[g * m + i] * to->force[i];
            }
         }
         if (j->kind[b] == SPRING) {
            spring1(s[at[0] * m + at[0]], r[0], j->mu[b], j->load[b], &to->force[at[0]]);
            continue;
         }
         limit = j->load[b];
         if (at[2] >= 0) {
            int g = at[2];
            double p = -(r[2] + j->gap[b]) / s[g * m + g];
            to->state[2 * b + 1] = p > 0.0;
            if (!(p > 0.0)) p = 0.0;
            to->force[g] = -p;
            limit = p;
         }
         limit *= j->mu[b];
         if (one < 0) continue;
         if (j->kind[b] == SMOOTH) {
            double s2[4] = {s[one * m + one], 0, 0, 0}, r2[2], f[2] = {to->force[one], 0};
            r2[0] = at[0] >= 0 ? r[0] : r[1];
            r2[1] = r[1];
            if (two) {
               s2[1] = s[at[0] * m + at[1]];
               s2[2] = s[at[1] * m + at[0]];
               s2[3] = s[at[1] * m + at[1]];
               f[1] = to->force[at[1]];
            }
            smooth2(two, s2, r2, limit, j->speed[b], f);
            to->force[one] = f[0];
            if (two) to->force[at[1]] = f[1];
            continue;
         }
         if (!two) {
            double x = at[0] >= 0 ? r[0] : r[1];
            double f = (x - (j->kind[b] == PLASTIC ? from->place[one] : 0.0)) / s[one * m + one];
            to->state[2 * b] = f > limit ? 1 : f < -limit ? -1 : 0;
            if (f > limit) f = limit;
            if (f < -limit) f = -limit;
            to->force[one] = f;
            if (j->kind[b] == PLASTIC)
               to->place[one] = to->state[2 * b] ? x - s[one * m + one] * f : from->place[one];
         } else {
            double s2[4] = {s[at[0] * m + at[0]], s[at[0] * m + at[1]], s[at[1] * m + at[0]],
                            s[at[1] * m + at[1]]};
            double r2[2] = {r[0], r[1]}, f[2], way[2], *d = 0;
            int slips;
            if (j->kind[b] == PLASTIC) {
               r2[0] -= from->place[at[0]];
               r2[1] -= from->place[at[1]];
               way[0] = from->way[at[0]];
               way[1] = from->way[at[1]];
               if (!start && from->state[2 * b]) d = way;
               slips = slip2(s2, r2, limit, d, f);
            } else {
               slips = slip2(s2, r2, limit, 0, f);
               if (slips && !start) {
                  r2[0] += from->input[at[0]];
                  r2[1] += from->input[at[1]];
                  if (!slip2(s2, r2, limit, 0, f)) slips = 1;
               }
            }
            to->state[2 * b] = slips;
            to->force[at[0]] = f[0];
            to->force[at[1]] = f[1];
            for (c = 0; c < 2; c++) {
               int g = at[c];
               if (j->kind[b] == PLASTIC) {
                  to->place[g] = from->place[g];
                  if (slips) to->place[g] = r[c] - s2[2 * c] * f[0] - s2[2 * c + 1] * f[1];
               }
               to->way[g] = limit > 0.0 ? f[c] / limit : 0.0;
            }
         }
      }
      if (j->blocks == 1 && j->at[2] < 0) break;
      for (i = 0; i < m; i++) {
         change = fmax(change, fabs(to->force[i] - old[i]));
         size = fmax(size, fabs(to->force[i]));
      }
      if (change <= 1e-15 * size) break;
   }
   for (i = 0; i < m; i++) {
      to->input[i] = free_input[i];
      for (k = 0; k < m; k++) to->input[i] -= s[i * m + k] * to->force[k];
   }
}

static void inputs(const joint *j, const double *y, double t, double *x)
{
   double c = cos(j->omega * t), s = sin(j->omega * t);
   int i, k;
   for (i = 0; i < j->m; i++) {
      x[i] = j->lin[3 * i] + j->lin[3 * i + 1] * c + j->lin[3 * i + 2] * s;
      for (k = 0; k < j->n; k++) x[i] += j->row[i * j->n + k] * y[k];
   }
}

static void step(const joint *j, int level, double t, double h, const moment *from, moment *to)
{
   int n = j->n, m = j->m, i, k;
   const double *a = j->a + level * n * n, *g0 = j->g0 + level * n * m, *g1 = j->g1 + level * n * m;
   double x[MOST];
   moment next = *from;
   for (i = 0; i < n; i++) {
      double sum = 0.0;
      for (k = 0; k < n; k++) sum += a[i * n + k] * from->y[k];
      for (k = 0; k < m; k++) sum += g0[i * m + k] * from->force[k];
      next.y[i] = sum;
   }
   inputs(j, next.y, t + h, x);
   contact(j, j->s + level * m * m, x, from, 0, &next);
   if (level + 1 < j->levels &&
       memcmp(next.state, from->state, sizeof(int) * 2 * j->blocks) != 0) {
      moment half;
      step(j, level + 1, t, 0.5 * h, from, &half);
      step(j, level + 1, t + 0.5 * h, 0.5 * h, &half, to);
      return;
   }
   for (i = 0; i < n; i++)
      for (k = 0; k < m; k++) next.y[i] += g1[i * m + k] * next.force[k];
   *to = next;
}

/* One period from (y, place); kept (samples, n + 2 m): state, forces and places at instants. */
int period(int n, int m, int levels, int blocks, const double *a, const double *g0,
           const double *g1, const double *s, const double *s0, const double *row,
           const double *lin, double omega, const int *kind, const int *at, const double *mu,
           const double *load, const double *gap, const double *speed, int steps, int samples,
           double *y, double *place, double *kept)
{
   joint j = {n, m, levels, blocks, a, g0, g1, s, s0, row, lin, omega, kind, at, mu, load, gap,
              speed};
   moment now, next;
   double t, h = 2.0 * M_PI / omega / steps, x[MOST];
   int i, k;
   if (n > STATES || m > MOST || blocks > BLOCKS) return 1;
   memset(&now, 0, sizeof now);
   memcpy(now.y, y, sizeof(double) * n);
   memcpy(now.place, place, sizeof(double) * m);
   inputs(&j, now.y, 0.0, x);
   next = now;
   contact(&j, s0, x, &now, 1, &next);
   now = next;
   for (k = 0; k < steps; k++) {
      t = k * h;
      if (kept && k % (steps / samples) == 0) {
         double *to = kept + (long)(k / (steps / samples)) * (n + 2 * m);
         memcpy(to, now.y, sizeof(double) * n);
         memcpy(to + n, now.force, sizeof(double) * m);
         memcpy(to + n + m, now.place, sizeof(double) * m);
      }
      step(&j, 0, t, h, &now, &next);
      now = next;
      for (i = 0; i < n; i++)
         if (!(fabs(now.y[i]) < 1e12)) return 2;
   }
   memcpy(y, now.y, sizeof(double) * n);
   memcpy(place, now.place, sizeof(double) * m);
   return 0;
}
