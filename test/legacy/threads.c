/* Separate handles in separate threads: every case is run alone first, then all of them at the
 * same time, several times over; every number must come out the same to the bit.
 *
 *    threads sector_16.h5 directory [rounds]
 *
 * The cases differ in what they use: model files and result files (HDF5), long transforms (FFTW),
 * MINPACK, KINSOL, CVODE, wear, given amplitudes, resonances, modes, steps of their own and wrong
 * input. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fretwear.h>

enum { n_cases = 12, wear = 7, mode = 10, most_values = 200000 };

/* Cases that are run as a whole always: steps write no file, wear nothing and follow nothing. */
static int only_whole(int number)
{
   return number >= 6 && number <= mode;
}

static const char *model_path, *directory;

/* Keys of a case, on top of those of all; the last two are refused. */
static const char *const keys[n_cases][5][2] = {
   {{"solver%kind", "newton"}},
   {{"harmonics%n_harmonics", "40"}, {"harmonics%n_time", "1024"}, {"sweep%n_points", "2"}},
   {{"solver%kind", "kinsol"}},
   {{"solver%kind", "powell"}, {"sweep%n_points", "2"}},
   {{"solver%kind", "pseudo_time"}, {"pseudo_time%scheme", "bdf"}, {"sweep%n_points", "2"}},
   {{"contact%mu", "0.3"}, {"harmonics%n_harmonics", "5"}},
   {{"contact%mu", "0.7"}, {"output%file", "result.h5"}},
   {{"case%analysis", "wear"}, {"wear%coefficient", "1e-9"}, {"wear%max_depth_step", "1e-4"},
    {"wear%max_steps", "3"}, {"sweep%start", "1023"}},
   {{"control%amplitude", "0.1"}, {"sweep%n_points", "4"}},
   {{"case%analysis", "resonance"}, {"resonance%parameter", "load%harmonic_scale"},
    {"resonance%start", "0.45"}, {"resonance%end", "0.55"}, {"resonance%n_points", "3"}},
   {{"case%analysis", "mode"}, {"mode%start", "1e-2"}, {"mode%end", "1e-1"},
    {"mode%n_points", "4"}},
   {{"contact%mu", "-1"}, {"solver%tolerence", "1e-9"}},
};

struct task {
   int number;
   int steps; /* frequency by frequency instead of as a whole */
   int status, n_values;
   double *values;
   char message[1000];
};

static void collect(fw_handle handle, struct task *task)
{
   static const char *const names[] = {"omega", "coefficients", "amplitude", "residual",
      "contact/force", "contact/fraction", "contact/dissipation", "wear/depth", "wear/cycles"};
   int n_points;

   task->n_values = 0;
   if (fw_count(handle, "points", &n_points) != FW_OK) exit(11);
   for (int k = 0; k < n_points; k++)
      for (int i = 0; i < (task->number == wear ? 9 : 7); i++) {
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
   char path[2000];
   fw_handle handle;

   if (fw_create(&handle) != FW_OK) exit(15);
   fw_set(handle, "case%threads", "1");
   fw_set(handle, "model%source", "hdf5");
   fw_set(handle, "model%file", model_path);
   fw_set(handle, "model%modal_damping", "1e-3");
   fw_set(handle, "model%rotation_speed", "460.8");
   fw_set(handle, "load%harmonic_scale", "0.5");
   fw_set(handle, "harmonics%n_harmonics", "3");
   fw_set(handle, "harmonics%n_time", "128");
   if (task->number != mode) {
      fw_set(handle, "sweep%unit", "Hz");
      fw_set(handle, "sweep%start", "1017");
      fw_set(handle, "sweep%end", "1029");
      fw_set(handle, "sweep%n_points", "13");
   }
   for (int i = 0; i < 5 && keys[task->number][i][0]; i++) {
      const char *value = keys[task->number][i][1];
      if (!strcmp(keys[task->number][i][0], "output%file")) {
         snprintf(path, sizeof path, "%s/%s", directory, value);
         value = path;
      }
      if (fw_set(handle, keys[task->number][i][0], value) != FW_OK) exit(16);
   }
   if (task->steps) {
      int n_points = 0;
      task->status = fw_start(handle);
      if (task->status == FW_OK) fw_count(handle, "frequencies", &n_points);
      for (int k = 0; k < n_points; k++) {
         double omega;
         if (fw_get_frequency(handle, k, &omega) != FW_OK) exit(17);
         task->status = fw_solve(handle, omega);
      }
   } else
      task->status = fw_run_case(handle);
   fw_get_message(handle, task->message, sizeof task->message);
   collect(handle, task);
   fw_destroy(handle);
   return NULL;
}

static struct task new_task(int number, int steps)
{
   struct task task = {number, steps, -1, 0, malloc(most_values * sizeof(double)), ""};
   if (!task.values) exit(18);
   return task;
}

static int differs(const struct task *a, const struct task *b, const char *when)
{
   if (a->status == b->status && a->n_values == b->n_values && !strcmp(a->message, b->message)
       && !memcmp(a->values, b->values, (size_t)a->n_values * sizeof(double)))
      return 0;
   printf("case %d %s: status %d and %d, %d and %d values, \"%s\" and \"%s\"\n", a->number, when,
          a->status, b->status, a->n_values, b->n_values, a->message, b->message);
   return 1;
}

int main(int argc, char **argv)
{
   struct task alone[n_cases], together[n_cases];
   pthread_t threads[n_cases];
   int failures = 0, n_rounds = 3;

   if (argc < 3) return 2;
   if (argc > 3) n_rounds = atoi(argv[3]);
   model_path = argv[1];
   directory = argv[2];
   for (int i = 0; i < n_cases; i++) {
      alone[i] = new_task(i, 0);
      together[i] = new_task(i, 0);
      run(&alone[i]);
      printf("case %d: status %d, %d values\n", i, alone[i].status, alone[i].n_values);
      if (i == n_cases - 1) continue;
      together[i].steps = !only_whole(i);
      run(&together[i]);
      failures += differs(&alone[i], &together[i], "in steps");
   }
   for (int round = 0; round < n_rounds; round++) {
      for (int i = 0; i < n_cases; i++) {
         together[i].steps = (round + i) % 2 && !only_whole(i);
         together[i].n_values = 0;
         if (pthread_create(&threads[i], NULL, run, &together[i])) return 19;
      }
      for (int i = 0; i < n_cases; i++) pthread_join(threads[i], NULL);
      for (int i = 0; i < n_cases; i++)
         failures += differs(&alone[i], &together[i], "beside others");
   }
   printf("%d differences\n", failures);
   return failures != 0;
}
