/* Large pages for a large array, asked for before it is first written to: a system that clears
   pages of 4 kB one by one takes longer to hand out an array than to fill it. */
#if defined(__linux__)
#define _DEFAULT_SOURCE
#include <sys/mman.h>
#include <unistd.h>
#endif
#include <stddef.h>
#include <stdint.h>

/* A wish: where there are none, nothing changes. Pages that reach out of the array keep theirs. */
void fretwear_prefer_large_pages(void *array, size_t bytes)
{
#if defined(MADV_HUGEPAGE)
   uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
   uintptr_t first = ((uintptr_t)array + page - 1) / page * page;
   uintptr_t end = ((uintptr_t)array + bytes) / page * page;

   if (end > first)
      (void)madvise((void *)first, end - first, MADV_HUGEPAGE);
#else
   (void)array;
   (void)bytes;
#endif
}
