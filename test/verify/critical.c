/* Critical sections of OpenMP as mutexes of pthread, which a race detector sees; those of libgomp
 * are its own. Linked into the program, these stand before the ones of the library. */
#include <pthread.h>

enum { most = 64 };

static pthread_mutex_t list = PTHREAD_MUTEX_INITIALIZER;
static void **names[most];
static pthread_mutex_t locks[most];
static int n_names;

/* The mutex of a section, made at its first use. */
static pthread_mutex_t *lock_of(void **name)
{
   int i;

   pthread_mutex_lock(&list);
   for (i = 0; i < n_names && names[i] != name; i++) {}
   if (i == n_names && i < most) {
      names[i] = name;
      pthread_mutex_init(&locks[i], NULL);
      n_names++;
   }
   pthread_mutex_unlock(&list);
   return &locks[i];
}

void GOMP_critical_name_start(void **name)
{
#ifdef UNGUARDED
   (void)name;
#else
   pthread_mutex_lock(lock_of(name));
#endif
}

void GOMP_critical_name_end(void **name)
{
#ifdef UNGUARDED
   (void)name;
#else
   pthread_mutex_unlock(lock_of(name));
#endif
}
