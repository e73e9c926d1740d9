/* Which BLAS is linked, and what the processor could run. OpenBLAS tells its kernel and takes a
   number of threads; of any other BLAS these symbols do not exist, and the program links all the
   same. */
#pragma weak openblas_get_config
#pragma weak openblas_get_corename
#pragma weak openblas_get_num_threads
#pragma weak openblas_set_num_threads

extern char *openblas_get_config(void);
extern char *openblas_get_corename(void);
extern int openblas_get_num_threads(void);
extern void openblas_set_num_threads(int);

/* Empty where it is no OpenBLAS. */
const char *fretwear_blas_config(void)
{
   return openblas_get_config ? openblas_get_config() : "";
}

const char *fretwear_blas_kernel(void)
{
   return openblas_get_corename ? openblas_get_corename() : "";
}

/* 1 where nothing is known: a BLAS without threads. */
int fretwear_blas_threads(void)
{
   return openblas_get_num_threads ? openblas_get_num_threads() : 1;
}

void fretwear_set_blas_threads(int n)
{
   if (openblas_set_num_threads)
      openblas_set_num_threads(n);
}

/* Vectors that processor and operating system have: 1 of AVX, 2 of AVX2 with fused products,
   3 of AVX-512; 0 below, and -1 for other processors. */
int fretwear_vector_level(void)
{
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__i386__))
   __builtin_cpu_init();
   if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
       __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
      return 3;
   if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
      return 2;
   return __builtin_cpu_supports("avx") ? 1 : 0;
#else
   return -1;
#endif
}
