/* Three laws for &user: cc -O2 -shared -fPIC -I ../../include -o laws.so laws.c -lm */
#include <math.h>

#include "fretwear.h"

const int fw_law_interface = 1;

/* A cubic spring, f = c u^3: one constant. */
int cubic(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double c = call->parameters[0];
   (void)user;
   (void)dv;
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[k];
      force[k] = c * u * u * u;
      if (call->wants_derivative)
         du[k] = 3.0 * c * u * u;
   }
   return 0;
}

/* Smooth friction with a load that grows with a second displacement, f_1 = mu (N + k u_2) tanh(v_1/v_0),
   f_2 = 0: two inputs, four constants mu, N, k, v_0. */
int loaded_friction(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double *p = call->parameters;
   (void)user;
   if (call->n_in != 2 || call->n_parameters != 4)
      return 1; /* ends the run */
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[2 * k + 1], v = call->v[2 * k];
      const double t = tanh(v / p[3]), load = p[1] + p[2] * u;
      force[2 * k] = p[0] * load * t;
      if (!call->wants_derivative)
         continue;
      /* Force 0 by input 1, and by rate 0: [(k n_in + force) n_in + input]. */
      du[4 * k + 1] = p[0] * p[2] * t;
      dv[4 * k] = p[0] * load * (1.0 - t * t) / p[3];
   }
   return 0;
}

/* A slider on a spring of stiffness k that holds to a limit: it remembers where it stands. */
const int slider_states = 1;

int slider(void *user, const fw_law_call *call, const double *state, double *state_after,
           double *force, double *dstate, double *dforce)
{
   const double k = call->parameters[0], limit = call->parameters[1];
   const double u = call->u[1], trial = k * (u - state[0]); /* call->u[0] is that before */
   const int sticks = fabs(trial) <= limit;
   (void)user;
   state_after[0] = sticks ? state[0] : u - copysign(limit / k, trial);
   force[0] = k * (u - state_after[0]);
   if (call->wants_derivative) {
      dstate[0] = sticks; /* by state, u and v before, u and v after */
      dstate[3] = !sticks;
      dforce[0] = -k; /* by the state after, u and v after */
      dforce[1] = k;
   }
   return 0;
}
