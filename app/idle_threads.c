/* What idle threads cost, settled before the libraries read it: OpenBLAS would start threads that
   this program never uses and that spin for some 30 ms, and those of OpenMP would spin for several
   milliseconds behind each parallel region. Libraries that are linked as archives start after this;
   shared ones have read the environment before, and keep their ways. Whoever sets these variables
   has the last word. */
#include <stdlib.h>

/* Below a millisecond: regions of a large joint follow one another faster than that. */
#define SPINS "10000"

__attribute__((constructor(101))) static void settle_idle_threads(void)
{
   setenv("OPENBLAS_NUM_THREADS", "1", 0);
   if (!getenv("OMP_WAIT_POLICY"))
      setenv("GOMP_SPINCOUNT", SPINS, 0);
}
