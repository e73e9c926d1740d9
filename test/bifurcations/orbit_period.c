/* A period of a few masses with springs of integer power, by the Runge-Kutta method of order 4: the
 * motion, its derivative by the state at the start and by the frequency. Time is tau = omega t.
 * Rows of y: the state (u, v), then one for each direction of the start, then that of omega. */
#include <math.h>
#include <string.h>

enum { MOST = 4, ROWS = 2 * MOST + 2, SIZE = 2 * MOST };

/* Matrices are those of M^-1 times damping, stiffness, loads and directions (to), n by n. */
struct problem {
   int n, n_springs;
   double omega;
   const double *damping, *stiffness, *cosine, *constant, *direction, *to, *coefficient;
   const int *power;
};

static double integer_power(double x, int p)
{
   double r = 1.0;
   while (p-- > 0) r *= x;
   return r;
}

static void rates(const struct problem *p, double tau, double y[ROWS][SIZE], double dy[ROWS][SIZE])
{
   const int n = p->n;
   double tangent[MOST][MOST], pull[MOST];
   for (int i = 0; i < n; i++) {
      pull[i] = 0.0;
      for (int j = 0; j < n; j++) tangent[i][j] = p->stiffness[i * n + j];
   }
   for (int s = 0; s < p->n_springs; s++) {
      double length = 0.0;
      for (int i = 0; i < n; i++) length += p->direction[s * n + i] * y[0][i];
      const double lower = p->coefficient[s] * integer_power(length, p->power[s] - 1);
      for (int i = 0; i < n; i++) {
         pull[i] += p->to[s * n + i] * lower * length;
         for (int j = 0; j < n; j++)
            tangent[i][j] += p->to[s * n + i] * lower * p->power[s] * p->direction[s * n + j];
      }
   }
   for (int row = 0; row < 2 * n + 2; row++) {
      for (int i = 0; i < n; i++) {
         double a = 0.0;
         for (int j = 0; j < n; j++) {
            const double k = row == 0 ? p->stiffness[i * n + j] : tangent[i][j];
            a -= k * y[row][j] + p->damping[i * n + j] * y[row][n + j];
         }
         if (row == 0) a += p->constant[i] + p->cosine[i] * cos(tau) - pull[i];
         dy[row][i] = y[row][n + i];
         dy[row][n + i] = a;
      }
   }
   for (int i = 0; i < 2 * n; i++) dy[2 * n + 1][i] -= dy[0][i] / p->omega;
   for (int row = 0; row < 2 * n + 2; row++)
      for (int i = 0; i < 2 * n; i++) dy[row][i] /= p->omega;
}

static void move(int n, double y[ROWS][SIZE], double h, double dy[ROWS][SIZE],
                 double out[ROWS][SIZE])
{
   for (int row = 0; row < 2 * n + 2; row++)
      for (int i = 0; i < 2 * n; i++) out[row][i] = y[row][i] + h * dy[row][i];
}

/* y: the state in its first row, all rows at the end; the largest |u|, and the state at half. */
void period(int n, int n_springs, int steps, double omega, const double *damping,
            const double *stiffness, const double *cosine, const double *constant,
            const double *direction, const double *to, const double *coefficient, const int *power,
            double *state, double *end, double *largest, double *half)
{
   const struct problem p = {n,      n_springs, omega,     damping, stiffness,   cosine,
                             constant, direction, to, coefficient, power};
   const double h = 8.0 * atan(1.0) / steps;
   static _Thread_local double y[ROWS][SIZE], t[ROWS][SIZE], k[4][ROWS][SIZE];
   memset(y, 0, sizeof y);
   memcpy(y[0], state, 2 * n * sizeof(double));
   for (int i = 0; i < 2 * n; i++) y[1 + i][i] = 1.0;
   for (int i = 0; i < n; i++) largest[i] = fabs(state[i]);
   for (int step = 0; step < steps; step++) {
      const double tau = step * h;
      rates(&p, tau, y, k[0]);
      move(n, y, 0.5 * h, k[0], t);
      rates(&p, tau + 0.5 * h, t, k[1]);
      move(n, y, 0.5 * h, k[1], t);
      rates(&p, tau + 0.5 * h, t, k[2]);
      move(n, y, h, k[2], t);
      rates(&p, tau + h, t, k[3]);
      for (int row = 0; row < 2 * n + 2; row++)
         for (int i = 0; i < 2 * n; i++)
            y[row][i] += h / 6.0 * (k[0][row][i] + 2.0 * k[1][row][i] + 2.0 * k[2][row][i] +
                                    k[3][row][i]);
      for (int i = 0; i < n; i++) largest[i] = fmax(largest[i], fabs(y[0][i]));
      if (step + 1 == steps / 2) memcpy(half, y[0], 2 * n * sizeof(double));
   }
   for (int row = 0; row < 2 * n + 2; row++)
      memcpy(end + row * 2 * n, y[row], 2 * n * sizeof(double));
}
