/* A call that is ended from another thread, within a point: fw_stop.
 *
 *    stop sector_48.h5
 *
 * The point has no solution to the tolerance asked for, and every fallback takes its time: without
 * the stop it takes minutes. Each line is a label, a status, the points kept and the seconds from
 * the stop to the end of the call. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include <fretwear.h>

static const char *model_path;

struct task {
   fw_handle handle;
   int in_steps, status;
};

static double now(void)
{
   struct timespec time;
   clock_gettime(CLOCK_MONOTONIC, &time);
   return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static fw_handle slow(const char *tolerance)
{
   static const char *const keys[][2] = {
      {"case%analysis", "point"}, {"case%threads", "1"}, {"model%source", "hdf5"},
      {"model%modal_damping", "1e-3"}, {"model%rotation_speed", "460.8"},
      {"load%harmonic_scale", "0.5"}, {"harmonics%n_harmonics", "7"},
      {"harmonics%n_time", "8192"}, {"sweep%unit", "Hz"}, {"sweep%start", "1017.8"}};
   fw_handle handle;

   if (fw_create(&handle) != FW_OK) exit(11);
   for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
      if (fw_set(handle, keys[i][0], keys[i][1]) != FW_OK) exit(12);
   if (fw_set(handle, "model%file", model_path) != FW_OK) exit(13);
   if (fw_set(handle, "solver%tolerance", tolerance) != FW_OK) exit(14);
   return handle;
}

static void *work(void *argument)
{
   struct task *task = argument;
   task->status = task->in_steps ? fw_solve(task->handle, 6395.0) : fw_run_case(task->handle);
   return NULL;
}

static int n_points(fw_handle handle)
{
   int n;
   if (fw_count(handle, "points", &n) != FW_OK) exit(15);
   return n;
}

static void stop_in(const char *label, int in_steps)
{
   struct task task = {slow("1e-30"), in_steps, -1};
   pthread_t thread;
   double begun;

   if (in_steps && fw_start(task.handle) != FW_OK) exit(16);
   if (pthread_create(&thread, NULL, work, &task)) exit(17);
   sleep(2);
   begun = now();
   if (fw_stop(task.handle) != FW_OK) exit(18);
   pthread_join(thread, NULL);
   printf("%s %d %d %.3f\n", label, task.status, n_points(task.handle), now() - begun);
   fw_destroy(task.handle);
}

int main(int argc, char **argv)
{
   fw_handle handle;
   double begun;
   int status;

   if (argc < 2) return 2;
   model_path = argv[1];
   stop_in("whole", 0);
   stop_in("step", 1);

   handle = slow("1e-30");
   fw_set(handle, "case%max_seconds", "0.5");
   begun = now();
   status = fw_run_case(handle);
   printf("limit %d %d %.3f\n", status, n_points(handle), now() - begun - 0.5);
   fw_destroy(handle);

   /* A stop that finds no call at work is refused, and does not end the next. */
   handle = slow("1e-6");
   fw_set(handle, "harmonics%n_time", "128");
   printf("idle %d\n", fw_stop(handle));
   status = fw_run_case(handle);
   printf("after %d %d\n", status, n_points(handle));
   return fw_destroy(handle);
}
