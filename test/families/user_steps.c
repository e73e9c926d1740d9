/* Laws with states for the family user_steps: a slider, Bouc and Wen's joint, a relaxing spring and
   one of two states. */
#include <math.h>

#include "fretwear.h"

const int fw_law_interface = 1;
const int slider_states = 1, bouc_wen_states = 1, maxwell_states = 2, both_states = 2;

#define UNUSED (void)user

/* Slopes come in as zeros: dstate(n, n + 4) by (state, u, v before, u, v after), and
   dforce(1, n + 2) by (state after, u, v after). */
static double slide(double k, double limit, double x, double u, int *sticks)
{
   const double trial = k * (u - x);
   *sticks = fabs(trial) <= limit;
   return *sticks ? x : u - copysign(limit / k, trial);
}

int slider(void *user, const fw_law_call *call, const double *state, double *after, double *force,
           double *dstate, double *dforce)
{
   const double *p = call->parameters;
   int sticks;
   UNUSED;
   after[0] = slide(p[0], p[1], state[0], call->u[1], &sticks);
   force[0] = p[0] * (call->u[1] - after[0]);
   if (!call->wants_derivative)
      return 0;
   dstate[0] = sticks;
   dstate[3] = !sticks;
   dforce[0] = -p[0];
   dforce[1] = p[0];
   return 0;
}

/* dz/ds and its slope by z; the sign is that of the step. */
static double rate(const double *p, int forward, double z, double *slope)
{
   const double size = fabs(z), w = forward ? z : -z;
   const double shape = w > 0.0 ? 1.0 : 1.0 - 2.0 * p[3];
   const double power = pow(size, p[2] - 1.0);
   *slope = -shape * p[2] * power * copysign(1.0, z);
   return 1.0 - shape * power * size;
}

/* The classical method, four steps for each instant, and more where it moves far: the first step
   strains the element from its assembly to the motion at once. Slopes by z and by the step go
   along. */
int bouc_wen(void *user, const fw_law_call *call, const double *state, double *after, double *force,
             double *dstate, double *dforce)
{
   const double *p = call->parameters;
   const double far = p[0] / p[1] * (call->u[1] - call->u[0]);
   const int steps = 4 + (int)fmin(4.0 * fabs(far), 1e6);
   const double h = far / steps;
   double z = state[0], by_z = 1.0, by_h = 0.0;
   UNUSED;
   for (int i = 0; i < steps; i++) {
      static const double part[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
      double k = 0.0, k_z = 0.0, k_h = 0.0, sum = 0.0, sum_z = 0.0, sum_h = 0.0, slope;
      for (int j = 0; j < 4; j++) {
         const double at_z = by_z + part[j] * h * k_z;
         const double at_h = by_h + part[j] * (k + h * k_h);
         k = rate(p, h > 0.0, z + part[j] * h * k, &slope);
         k_z = slope * at_z;
         k_h = slope * at_h;
         sum += weight[j] * k / 6.0;
         sum_z += weight[j] * k_z / 6.0;
         sum_h += weight[j] * k_h / 6.0;
      }
      z += h * sum;
      by_z += h * sum_z;
      by_h += sum + h * sum_h;
   }
   after[0] = z;
   force[0] = p[1] * z;
   if (!call->wants_derivative)
      return 0;
   dstate[0] = by_z;
   dstate[3] = by_h * p[0] / p[1] / steps;
   dstate[1] = -dstate[3];
   dforce[0] = p[1];
   return 0;
}

/* f' = k u' - f/T, exact for displacements that are linear in a step. Its second state counts
   nothing, and stays where it began. */
int maxwell(void *user, const fw_law_call *call, const double *state, double *after, double *force,
            double *dstate, double *dforce)
{
   const double *p = call->parameters;
   const double dt = (call->tau[1] - call->tau[0]) / call->omega, a = exp(-dt / p[2]);
   const double gain = p[0] * p[2] / dt * (1.0 - a);
   UNUSED;
   after[0] = a * state[0] + gain * (call->u[1] - call->u[0]);
   after[1] = state[1];
   force[0] = after[0];
   if (!call->wants_derivative)
      return 0;
   dstate[0] = a;
   dstate[2] = -gain;
   dstate[4] = gain;
   dstate[7] = 1.0;
   dforce[0] = 1.0;
   return 0;
}

/* A slider beside the relaxing spring. */
int both(void *user, const fw_law_call *call, const double *state, double *after, double *force,
         double *dstate, double *dforce)
{
   const double *p = call->parameters;
   const double dt = (call->tau[1] - call->tau[0]) / call->omega, a = exp(-dt / p[2]);
   const double gain = p[0] * p[2] / dt * (1.0 - a);
   int sticks;
   UNUSED;
   after[0] = slide(p[0], p[1], state[0], call->u[1], &sticks);
   after[1] = a * state[1] + gain * (call->u[1] - call->u[0]);
   force[0] = p[0] * (call->u[1] - after[0]) + after[1];
   if (!call->wants_derivative)
      return 0;
   dstate[0] = sticks;
   dstate[4] = !sticks;
   dstate[7] = a;
   dstate[8] = -gain;
   dstate[10] = gain;
   dforce[0] = -p[0];
   dforce[1] = 1.0;
   dforce[2] = p[0];
   return 0;
}
