/* A run of a namelist that a line on the input ends, from another thread: fw_stop.
 *
 *    stop_run case.nml
 *
 * Status 0: it was ended. Its result stays in the handle; stops.py measures how long it took. */
#include <pthread.h>
#include <stdio.h>

#include <fretwear.h>

static void *wait_for_line(void *handle)
{
   int c;
   while ((c = getchar()) != '\n' && c != EOF) {}
   fw_stop(handle);
   return NULL;
}

int main(int argc, char **argv)
{
   pthread_t thread;
   fw_handle handle;
   int status;

   if (argc != 2 || fw_create(&handle) != FW_OK) return 2;
   if (fw_load_file(handle, argv[1]) != FW_OK) return 3;
   if (pthread_create(&thread, NULL, wait_for_line, handle) != 0) return 4;
   status = fw_run_case(handle);
   return status == FW_STOPPED ? 0 : 1;
}
