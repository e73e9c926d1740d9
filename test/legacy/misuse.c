/* What a host can do wrong. Every line printed is: label, status, message; the program has to
 * reach its end. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <fretwear.h>

static void show(const char *label, fw_handle handle, int status)
{
   char message[2000];
   fw_get_message(handle, message, sizeof message);
   for (char *c = message; *c; c++)
      if (*c == '\n') *c = '|';
   printf("%s\t%d\t%s\n", label, status, message);
}

/* A mass on a spring that rubs on the ground. */
static fw_handle oscillator(void)
{
   static const double mass[] = {1}, stiffness[] = {1}, load[] = {1}, mu[] = {0.3};
   static const int side[] = {1, 0, 0};
   fw_handle handle;
   fw_create(&handle);
   fw_new_model(handle, 1, 1);
   fw_put_reals(handle, "mass", 1, mass);
   fw_put_reals(handle, "stiffness", 1, stiffness);
   fw_put_reals(handle, "load/cosine", 1, load);
   fw_put_reals(handle, "contact/mu", 1, mu);
   fw_put_integers(handle, "contact/side_1", 3, side);
   fw_set(handle, "contact%normal_load", "0.5");
   fw_set(handle, "contact%law", "penalty");
   fw_set(handle, "contact%tangential_stiffness", "1");
   fw_set(handle, "model%rayleigh_mass", "0.05");
   fw_set(handle, "sweep%start", "0.5");
   fw_set(handle, "sweep%end", "1.5");
   fw_set(handle, "sweep%n_points", "5");
   return handle;
}

/* In the middle of a call: reading is allowed, everything else is not. */
static int meddle(void *user, const fw_progress *progress)
{
   fw_handle handle = *(fw_handle *)user;
   double amplitude = -1;
   int status = fw_get(handle, "amplitude", -1, 1, &amplitude);
   if (progress->point > 0) return 0;
   printf("read in callback\t%d\t%d\n", status, amplitude == progress->amplitude);
   printf("solve in callback\t%d\t\n", fw_solve(handle, 1.0));
   printf("set in callback\t%d\t\n", fw_set(handle, "solver%tolerance", "1e-3"));
   printf("destroy in callback\t%d\t\n", fw_destroy(handle));
   return 0;
}

static int stop_at_third(void *user, const fw_progress *progress)
{
   ++*(int *)user;
   return progress->point == 2;
}

int main(void)
{
   double number = 0, buffer[4] = {7, 7, 7, 7};
   int n = 0, calls = 0;
   size_t size = 0;
   char text[8];
   fw_handle handle, stale;

   /* Handles. */
   show("null handle", NULL, fw_set(NULL, "solver%tolerance", "1e-9"));
   show("invented handle", NULL, fw_start((fw_handle)(intptr_t)123456));
   show("pointer as handle", NULL, fw_start((fw_handle)&handle));
   handle = oscillator();
   stale = handle;
   show("destroyed", handle, fw_destroy(handle));
   show("destroyed twice", stale, fw_destroy(stale));
   show("stale handle", stale, fw_run_case(stale));
   show("no place for a handle", NULL, fw_create(NULL));

   /* Keys. */
   handle = oscillator();
   show("no key", handle, fw_set(handle, "tolerance", "1e-9"));
   show("null key", handle, fw_set(handle, NULL, "1"));
   fw_set(handle, "solver%tolerence", "1e-9");
   show("unknown key", handle, fw_check(handle));
   fw_destroy(handle);
   handle = oscillator();
   fw_set(handle, "solver%tolerance", "-1");
   show("out of range", handle, fw_start(handle));
   show("set again", handle, fw_set(handle, "solver%tolerance", "1e-9"));
   show("good again", handle, fw_check(handle));
   show("text is cut", handle, fw_get_text(handle, "title", 0, text, 3, &size));
   printf("cut text\t%d\t%s\n", (int)size, text);

   /* Arrays. */
   show("unknown part", handle, fw_put_reals(handle, "masses", 1, &number));
   show("wrong size", handle, fw_put_reals(handle, "mass", 4, buffer));
   show("null array", handle, fw_put_reals(handle, "mass", 1, NULL));
   show("no dofs", handle, fw_new_model(handle, 0, 0));
   show("too many dofs", handle, fw_new_model(handle, 2000000000, 0));
   show("incomplete model", handle, (fw_new_model(handle, 2, 0), fw_start(handle)));
   buffer[1] = 1, buffer[2] = 2;
   fw_put_reals(handle, "mass", 4, buffer);
   fw_put_reals(handle, "stiffness", 4, buffer);
   show("not symmetric", handle, fw_start(handle));
   buffer[1] = buffer[2] = NAN;
   fw_put_reals(handle, "stiffness", 4, buffer);
   show("not a number", handle, fw_start(handle));
   fw_destroy(handle);
   fw_create(&handle);
   show("put without a model", handle, fw_put_reals(handle, "mass", 1, &number));
   show("nothing given", handle, fw_run_case(handle));
   show("memory asked for", handle,
        (fw_set(handle, "model%source", "memory"), fw_check(handle)));
   show("no such file", handle, fw_load_file(handle, "/does/not/exist.nml"));
   fw_load_text(handle, "&case title = 'x' /\n&model n_dof = 'two' /", "mine.nml");
   show("wrong namelist", handle, fw_check(handle));
   fw_destroy(handle);

   /* Order of calls, results. */
   handle = oscillator();
   show("solve before start", handle, fw_solve(handle, 1.0));
   show("count before start", handle, fw_count(handle, "observed", &n));
   show("get before solve", handle, fw_get(handle, "omega", -1, 1, &number));
   fw_start(handle);
   show("no such frequency", handle, fw_get_frequency(handle, 5, &number));
   show("omega = 0", handle, fw_solve(handle, 0.0));
   show("omega = nan", handle, fw_solve(handle, NAN));
   show("solve", handle, fw_solve(handle, 1.0));
   buffer[0] = buffer[1] = 7;
   show("small buffer", handle, fw_get(handle, "coefficients", -1, 2, buffer));
   printf("buffer\t%d\t\n", buffer[0] == 7 && buffer[1] == 7);
   show("unknown result", handle, fw_get(handle, "forces", -1, 4, buffer));
   show("no histories", handle, fw_size(handle, "history/observed", -1, &size));
   show("no such point", handle, fw_get(handle, "omega", 1, 1, &number));
   show("null buffer", handle, fw_get(handle, "omega", 0, 1, NULL));
   show("change", handle, fw_set(handle, "solver%tolerance", "1e-7"));
   show("solve after a change", handle, fw_solve(handle, 1.0));
   fw_set(handle, "sweep%continuation", "arclength");
   show("steps along a branch", handle, fw_start(handle));
   fw_set(handle, "sweep%continuation", "natural");

   /* Outcomes. */
   fw_set(handle, "output%file", "/does/not/exist.h5");
   show("no such directory", handle, fw_run_case(handle));
   fw_destroy(handle);
   handle = oscillator();
   fw_set(handle, "solver%max_iterations", "1");
   fw_set(handle, "solver%fallback", ".false.");
   fw_set(handle, "harmonics%n_harmonics", "7");
   show("not converged", handle, fw_run_case(handle));
   fw_start(handle);
   show("point not converged", handle, fw_solve(handle, 1.0));
   fw_destroy(handle);

   handle = oscillator();
   fw_on_progress(handle, meddle, &handle);
   show("meddled with", handle, fw_run_case(handle));
   fw_on_progress(handle, stop_at_third, &calls);
   fw_set(handle, "output%file", "stopped.h5");
   show("stopped", handle, fw_run_case(handle));
   fw_count(handle, "points", &n);
   printf("kept\t%d\t%d\n", n, calls);
   fw_set(handle, "sweep%continuation", "arclength");
   fw_set(handle, "sweep%max_points", "50");
   fw_set(handle, "output%file", "branch.h5");
   calls = 0;
   show("branch stopped", handle, fw_run_case(handle));
   fw_count(handle, "points", &n);
   printf("kept of branch\t%d\t%d\n", n, calls);
   fw_destroy(handle);
   printf("end\t0\t\n");
   return 0;
}
