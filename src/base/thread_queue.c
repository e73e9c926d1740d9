/* How long a thread has stood ready to run without a processor: what the other programs of a machine
   cost it. Linux tells; elsewhere nothing is known, which is -1. */
#if defined(__linux__)
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>
#endif

/* A file that tells of the thread that opens it, to any thread. */
int fretwear_open_queue(void)
{
#if defined(__linux__)
   return open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
#else
   return -1;
#endif
}

/* Time in the queue so far [s]: the second of three numbers, in nanoseconds. */
double fretwear_time_in_queue(int file)
{
#if defined(__linux__)
   char text[96], *rest;
   ssize_t n = file < 0 ? -1 : pread(file, text, sizeof text - 1, 0);

   if (n <= 0)
      return -1.0;
   text[n] = '\0';
   (void)strtoull(text, &rest, 10);
   return 1e-9 * (double)strtoull(rest, NULL, 10);
#else
   (void)file;
   return -1.0;
#endif
}

void fretwear_close_queue(int file)
{
#if defined(__linux__)
   if (file >= 0)
      (void)close(file);
#else
   (void)file;
#endif
}
