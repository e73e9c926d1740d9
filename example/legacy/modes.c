/* A nonlinear mode, and what the friction of a joint does to a response, from C.
 *
 *    modes mode.nml sensitivity.nml out.txt
 *
 * writes amplitude, frequency and damping ratio of every point of the mode, then frequency,
 * amplitude and its derivative by the friction coefficient of every point of the response. */
#include <stdio.h>
#include <stdlib.h>

#include "fretwear.h"

static void check(fw_handle handle, int status, const char *what)
{
   char text[500];
   if (status == FW_OK) return;
   fw_get_message(handle, text, sizeof text);
   fprintf(stderr, "%s: status %d, %s\n", what, status, text);
   exit(1);
}

/* Run a case, and write three numbers of each point by their names in a result file. */
static void table(const char *path, const char *const names[3], FILE *out)
{
   fw_handle handle;
   int n, point, k;
   double value;

   check(NULL, fw_create(&handle), "fw_create");
   check(handle, fw_load_file(handle, path), path);
   check(handle, fw_run_case(handle), "fw_run_case");
   check(handle, fw_count(handle, "points", &n), "points");
   for (point = 0; point < n; ++point) {
      for (k = 0; k < 3; ++k) {
         check(handle, fw_get(handle, names[k], point, 1, &value), names[k]);
         fprintf(out, " %.17e", value);
      }
      fputc('\n', out);
   }
   fw_destroy(handle);
}

int main(int argc, char **argv)
{
   static const char *const mode[3] = {"mode/first_harmonic", "omega", "mode/damping_ratio"};
   static const char *const response[3] = {
      "omega", "amplitude", "sensitivity/largest/contact_mu"};
   FILE *out;

   if (argc != 4 || !(out = fopen(argv[3], "w"))) return 2;
   table(argv[1], mode, out);
   table(argv[2], response, out);
   return fclose(out) == 0 ? 0 : 1;
}
