/* Frequency response of a blade sector, frequency by frequency, from C.
 *
 *    frf_c sector.dat result.txt [points after which to stop]
 *
 * Writes a line for each point: omega, converged, amplitude, coefficients, contact forces,
 * fractions of stick, slip and open, dissipation. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fretwear.h>

/* The model of this program: what a host has in memory. */
struct sector {
   int n_dof, n_pairs;
   double *reals[10];
   int *sides[2];
   double *tip;
};

static const char *const real_names[10] = {
   "mass", "stiffness", "stiffness_rotation", "load/static", "load/static_rotation",
   "load/cosine", "load/sine", "contact/mu", "contact/gap", "contact/area"};
static const char *const side_names[2] = {"contact/side_1", "contact/side_2"};

static size_t real_count(const struct sector *sector, int i)
{
   size_t n = (size_t)sector->n_dof;
   if (i < 3) return n * n;
   return i < 7 ? n : (size_t)sector->n_pairs;
}

static double *read_reals(FILE *file, size_t n)
{
   double *values = malloc(n * sizeof *values);
   for (size_t i = 0; i < n; i++)
      if (!values || fscanf(file, "%lf", &values[i]) != 1) exit(1);
   return values;
}

static void read_sector(const char *path, struct sector *sector)
{
   FILE *file = fopen(path, "r");
   if (!file || fscanf(file, "%d %d", &sector->n_dof, &sector->n_pairs) != 2) exit(1);
   for (int i = 0; i < 10; i++) sector->reals[i] = read_reals(file, real_count(sector, i));
   for (int i = 0; i < 2; i++) {
      sector->sides[i] = malloc(3 * (size_t)sector->n_pairs * sizeof(int));
      for (int k = 0; k < 3 * sector->n_pairs; k++)
         if (fscanf(file, "%d", &sector->sides[i][k]) != 1) exit(1);
   }
   sector->tip = read_reals(file, (size_t)sector->n_dof);
   fclose(file);
}

static void free_sector(struct sector *sector)
{
   for (int i = 0; i < 10; i++) free(sector->reals[i]);
   for (int i = 0; i < 2; i++) free(sector->sides[i]);
   free(sector->tip);
}

/* Every call has a status; the handle has the words. */
static void check(fw_handle handle, int status, const char *what)
{
   char message[2000];
   if (status == FW_OK) return;
   fw_get_message(handle, message, sizeof message);
   fprintf(stderr, "%s: status %d: %s\n", what, status, message);
   exit(status);
}

/* Called after every point: report, and stop where the user asked for it. */
static int progress(void *user, const fw_progress *p)
{
   const int *stop_after = user;
   fprintf(stderr, "point %d: %.3f rad/s, %d iterations\n", p->point, p->omega, p->iterations);
   return *stop_after > 0 && p->point + 1 >= *stop_after;
}

static void set_up(fw_handle handle, const struct sector *sector)
{
   check(handle, fw_new_model(handle, sector->n_dof, sector->n_pairs), "model");
   for (int i = 0; i < 10; i++)
      check(handle, fw_put_reals(handle, real_names[i], real_count(sector, i), sector->reals[i]),
            real_names[i]);
   for (int i = 0; i < 2; i++)
      check(handle, fw_put_integers(handle, side_names[i], 3 * (size_t)sector->n_pairs,
                                    sector->sides[i]), side_names[i]);
   check(handle, fw_observe(handle, "tip", (size_t)sector->n_dof, sector->tip), "tip");
   check(handle, fw_set_real(handle, "model%modal_damping", 1e-3), "damping");
   check(handle, fw_set_real(handle, "model%rotation_speed", 460.8), "speed");
   check(handle, fw_set(handle, "contact%law", "dlft"), "law");
   check(handle, fw_set_real(handle, "load%harmonic_scale", 0.5), "load");
   check(handle, fw_set_integer(handle, "harmonics%n_harmonics", 3), "harmonics");
   check(handle, fw_set_integer(handle, "harmonics%n_time", 128), "instants");
   check(handle, fw_set(handle, "sweep%unit", "Hz"), "unit");
   check(handle, fw_set_real(handle, "sweep%start", 1017.0), "start");
   check(handle, fw_set_real(handle, "sweep%end", 1029.0), "end");
   check(handle, fw_set_integer(handle, "sweep%n_points", 25), "points");
}

static void write_point(fw_handle handle, FILE *out)
{
   static const char *const names[] = {"omega", "converged", "amplitude", "coefficients",
      "contact/force", "contact/fraction", "contact/dissipation"};
   for (int i = 0; i < 7; i++) {
      size_t n;
      double *values;
      check(handle, fw_size(handle, names[i], -1, &n), names[i]);
      values = malloc(n * sizeof *values);
      check(handle, fw_get(handle, names[i], -1, n, values), names[i]);
      for (size_t k = 0; k < n; k++) fprintf(out, "%.17g ", values[k]);
      free(values);
   }
   fprintf(out, "\n");
}

int main(int argc, char **argv)
{
   struct sector sector;
   fw_handle handle;
   FILE *out;
   int n_points, status = FW_OK;
   int stop_after = argc > 3 ? atoi(argv[3]) : 0;

   if (argc < 3 || !(out = fopen(argv[2], "w"))) return FW_USAGE;
   if (fw_get_interface_version() != FW_INTERFACE_VERSION) return FW_USAGE;
   fprintf(stderr, "Fretwear %s\n", fw_get_version());
   read_sector(argv[1], &sector);
   check(NULL, fw_create(&handle), "create");
   set_up(handle, &sector);
   free_sector(&sector); /* the library keeps copies */
   check(handle, fw_on_progress(handle, progress, &stop_after), "callback");

   check(handle, fw_start(handle), "start");
   check(handle, fw_count(handle, "frequencies", &n_points), "count");
   for (int k = 0; k < n_points && status != FW_STOPPED; k++) {
      double omega;
      check(handle, fw_get_frequency(handle, k, &omega), "frequency");
      status = fw_solve(handle, omega);
      /* A point that did not converge is written too, marked. */
      if (status != FW_NOT_CONVERGED && status != FW_STOPPED) check(handle, status, "solve");
      write_point(handle, out);
   }
   fclose(out);
   fw_destroy(handle);
   return status;
}
