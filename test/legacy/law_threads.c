/* Eight handles with laws of their own in eight threads: each is run alone first, then all of them
 * at the same time, several times over; every number and word must come out the same to the bit.
 *
 *    law_threads [rounds]
 *
 * Laws keep their constants and what they count behind their own pointer; no other thread than the
 * one that runs the handle may call them. One has no force, one ends the run, one remembers. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fretwear.h>

enum { n_cases = 8, most_laws = 2, most_values = 20000 };

/* What stands behind a law. */
struct mine {
   double stiffness, limit;
   pthread_t owner;
   long n_calls;
};

static int called(struct mine *mine)
{
   mine->n_calls++;
   return pthread_equal(mine->owner, pthread_self()) != 0;
}

/* k u^3 + k v/10. */
static int cubic(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   struct mine *mine = user;
   if (!called(mine)) return 99;
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[k];
      force[k] = mine->stiffness * (u * u * u + 0.1 * call->v[k]);
      if (!call->wants_derivative) continue;
      du[k] = 3.0 * mine->stiffness * u * u;
      dv[k] = 0.1 * mine->stiffness;
   }
   return 0;
}

/* Without slopes. */
static int friction(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   struct mine *mine = user;
   (void)du;
   (void)dv;
   if (!called(mine)) return 99;
   for (int k = 0; k < call->n_time; k++)
      force[k] = mine->limit * tanh(call->v[k] / 0.4);
   return 0;
}

/* No force beyond the limit. */
static int ends(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const struct mine *mine = user;
   for (int k = 0; k < call->n_time; k++)
      if (fabs(call->u[k]) > mine->limit) return -1;
   return cubic(user, call, force, du, dv);
}

/* The run ends there. */
static int stops(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const struct mine *mine = user;
   for (int k = 0; k < call->n_time; k++)
      if (fabs(call->u[k]) > mine->limit) return 7;
   return cubic(user, call, force, du, dv);
}

/* A slider on a spring, which remembers where it stands. */
static int slider(void *user, const fw_law_call *call, const double *state, double *after,
                  double *force, double *dstate, double *dforce)
{
   struct mine *mine = user;
   const double k = mine->stiffness, u = call->u[1], trial = k * (u - state[0]);
   const int sticks = fabs(trial) <= mine->limit;
   if (!called(mine)) return 99;
   after[0] = sticks ? state[0] : u - copysign(mine->limit / k, trial);
   force[0] = k * (u - after[0]);
   if (!call->wants_derivative) return 0;
   dstate[0] = sticks;
   dstate[3] = !sticks;
   dforce[0] = -k;
   dforce[1] = k;
   return 0;
}

struct kind {
   fw_law_force force[most_laws];
   fw_law_step step[most_laws];
   unsigned flags;
   const char *keys[3][2];
};

static const struct kind kinds[n_cases] = {
   {{cubic}, {0}, FW_LAW_ODD, {{0}}},
   {{cubic}, {0}, FW_LAW_ODD, {{"sweep%continuation", "arclength"}}},
   {{0}, {slider}, FW_LAW_ODD, {{0}}},
   {{friction}, {0}, FW_LAW_ODD | FW_LAW_NO_DERIVATIVE, {{0}}},
   {{cubic, 0}, {0, slider}, FW_LAW_ODD, {{0}}},
   {{cubic}, {0}, 0, {{"case%analysis", "resonance"}, {"resonance%parameter",
      "load%harmonic_scale"}, {"resonance%n_points", "3"}}},
   {{ends}, {0}, FW_LAW_ODD, {{0}}},
   {{stops}, {0}, FW_LAW_ODD, {{0}}},
};

struct task {
   int number, status, n_values;
   long n_calls;
   double *values;
   char message[1000];
};

static const char text[] =
   "&case analysis = 'frf' / &model n_dof = 2 mass = 1, 0, 0, 0.8 damping = 0.1, 0, 0, 0.1 "
   "stiffness = 2, -0.7, -0.7, 1.5 / &load cosine = 0.6, 0.1 / "
   "&harmonics n_harmonics = 5 n_time = 256 / &sweep start = 1.0 end = 1.4 n_points = 9 / "
   "&solver tolerance = 1e-9 /";

static void collect(fw_handle handle, struct task *task)
{
   static const char *const names[] = {"omega", "coefficients", "amplitude", "residual"};
   int n_points;

   task->n_values = 0;
   if (fw_count(handle, "points", &n_points) != FW_OK) exit(11);
   for (int k = 0; k < n_points; k++)
      for (int i = 0; i < 4; i++) {
         size_t n;
         if (fw_size(handle, names[i], k, &n) != FW_OK) exit(12);
         if (task->n_values + n > most_values) exit(13);
         if (fw_get(handle, names[i], k, n, task->values + task->n_values) != FW_OK) exit(14);
         task->n_values += (int)n;
      }
}

static void *run(void *argument)
{
   struct task *task = argument;
   const struct kind *kind = &kinds[task->number];
   struct mine mine[most_laws];
   const int sides[most_laws] = {1, 2};
   fw_handle handle;

   if (fw_create(&handle) != FW_OK) exit(15);
   if (fw_load_text(handle, text, "case") != FW_OK) exit(16);
   fw_set(handle, "case%threads", "1");
   if (task->number == 5) {
      fw_set_real(handle, "resonance%start", 0.9);
      fw_set_real(handle, "resonance%end", 1.1);
   }
   for (int i = 0; i < 3 && kind->keys[i][0]; i++)
      if (fw_set(handle, kind->keys[i][0], kind->keys[i][1]) != FW_OK) exit(17);
   task->n_calls = 0;
   for (int i = 0; i < most_laws && (kind->force[i] || kind->step[i]); i++) {
      fw_law law = {sizeof law, 1, kind->step[i] != 0, 0, &sides[i], NULL, NULL, NULL, kind->flags,
                    kind->force[i], kind->step[i], &mine[i]};
      mine[i] = (struct mine){0.3 + 0.1 * task->number, task->number == 7 ? 0.05 : 0.2,
                              pthread_self(), 0};
      if (fw_add_law(handle, "law", &law) != FW_OK) exit(18);
   }
   task->status = fw_run_case(handle);
   fw_get_message(handle, task->message, sizeof task->message);
   collect(handle, task);
   for (int i = 0; i < most_laws && (kind->force[i] || kind->step[i]); i++)
      task->n_calls += mine[i].n_calls;
   fw_destroy(handle);
   return NULL;
}

static struct task new_task(int number)
{
   struct task task = {number, -1, 0, 0, malloc(most_values * sizeof(double)), ""};
   if (!task.values) exit(19);
   return task;
}

static int differs(const struct task *a, const struct task *b)
{
   if (a->status == b->status && a->n_values == b->n_values && a->n_calls == b->n_calls
       && !strcmp(a->message, b->message)
       && !memcmp(a->values, b->values, (size_t)a->n_values * sizeof(double)))
      return 0;
   printf("case %d: status %d and %d, %d and %d values, %ld and %ld calls, \"%s\" and \"%s\"\n",
          a->number, a->status, b->status, a->n_values, b->n_values, a->n_calls, b->n_calls,
          a->message, b->message);
   return 1;
}

int main(int argc, char **argv)
{
   struct task alone[n_cases], together[n_cases];
   pthread_t threads[n_cases];
   int failures = 0;
   const int n_rounds = argc > 1 ? atoi(argv[1]) : 3;

   for (int i = 0; i < n_cases; i++) {
      alone[i] = new_task(i);
      together[i] = new_task(i);
      run(&alone[i]);
      printf("case %d: status %d, %d values, %ld calls, %s\n", i, alone[i].status,
             alone[i].n_values, alone[i].n_calls, alone[i].message);
   }
   for (int round = 0; round < n_rounds; round++) {
      for (int i = 0; i < n_cases; i++)
         if (pthread_create(&threads[i], NULL, run, &together[i])) return 20;
      for (int i = 0; i < n_cases; i++) pthread_join(threads[i], NULL);
      for (int i = 0; i < n_cases; i++) failures += differs(&alone[i], &together[i]);
   }
   printf("%d differences\n", failures);
   return failures != 0;
}
