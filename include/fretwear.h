/* Fretwear: vibration with contact, friction and fretting wear by harmonic balance.
 *
 * A handle holds one case: a namelist, single keys and a model in arrays, in whatever mixture and
 * order. It is run as a whole, or frequency by frequency, and its results are copied out.
 *
 * - Every function but three returns one of the statuses below. fw_get_message has the words.
 *   Nothing prints and nothing ends the program.
 * - Handles share nothing: different threads may use different handles at the same time. One
 *   handle serves one thread at a time; while a call is at work on it, its callback may read
 *   (fw_get, fw_size, fw_count, fw_get_text), any thread may end it (fw_stop), and every other
 *   call is refused with FW_USAGE.
 * - A handle that was destroyed, or never created, is recognised and refused with FW_USAGE.
 * - Units are those of the model, as long as they fit each other; omega is in rad/s.
 * - Callbacks must return: no longjmp and no C++ exception may pass through the library.
 *
 * docs/library.md says more, with what to do about threads.
 */
#ifndef FRETWEAR_H
#define FRETWEAR_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What fw_get_interface_version returns for this header. */
#define FW_INTERFACE_VERSION 1

/* Statuses; those from FW_FAILURE to FW_IO are the exit statuses of the program fw_run. */
enum fw_status {
   FW_OK = 0,
   FW_FAILURE = 1,       /* anything that has no status of its own */
   FW_USAGE = 2,         /* wrong call: handle, name, size, order of calls, null pointer */
   FW_INPUT = 3,         /* something is wrong in the case */
   FW_NOT_CONVERGED = 4, /* what was computed is there, marked */
   FW_IO = 5,            /* a file cannot be read or written */
   FW_STOPPED = 6        /* by the callback, fw_stop or case%max_seconds; what is done is there */
};

typedef struct fw_session *fw_handle;

/* What a progress callback is told of a point that was solved. */
typedef struct fw_progress {
   int point;        /* from 0 */
   int n_points;     /* points of the run, 0 where this is not known */
   double omega;     /* [rad/s] */
   int converged;    /* 1 or 0 */
   int iterations;
   double residual;  /* relative to the load */
   double amplitude; /* the largest of the observed quantities */
} fw_progress;

/* Called after every point; anything but 0 ends the run there, or makes fw_solve return
   FW_STOPPED. The struct is valid during the call. */
typedef int (*fw_progress_callback)(void *user, const fw_progress *progress);

/* Something worth knowing, such as a fallback that was taken. */
typedef void (*fw_message_callback)(void *user, const char *text);

/* Version of the library, such as "0.1.0", and of this interface. */
const char *fw_get_version(void);
int fw_get_interface_version(void);

/* Create and destroy. A handle that fw_create failed to create is null. */
int fw_create(fw_handle *handle);
int fw_destroy(fw_handle handle);

/* What the last call on this handle that failed had to say ("" after a call that did not fail).
   Copies at most size - 1 characters and a null; returns the length of the whole text. */
size_t fw_get_message(fw_handle handle, char *buffer, size_t size);

/* Input. Take a namelist as of fw_run, from a file or as text; a later one replaces it. `name`
   stands for the path: in messages, and for relative files. */
int fw_load_file(fw_handle handle, const char *path);
int fw_load_text(fw_handle handle, const char *text, const char *name);

/* Set a key on top of the namelist, with or without one, by its name there: "solver%tolerance" to
   "1e-9", "contact%mu" to "0.3, 0.4", "contact%law" to "dlft". That a key exists and that its
   value is in range shows in fw_check, fw_start and fw_run_case. */
int fw_set(fw_handle handle, const char *key, const char *value);
int fw_set_real(fw_handle handle, const char *key, double value);
int fw_set_integer(fw_handle handle, const char *key, int value);

/* Begin a model in memory; it stands in for the group &model and for a model file. */
int fw_new_model(fw_handle handle, int n_dof, int n_pairs);

/* Give a part of it by the name of its dataset in a model file; `n` says how many values there
   are and is checked. Everything is copied.
   n_dof * n_dof: "mass", "stiffness" (both required), "damping", "stiffness_rotation"; symmetric;
                  "structural_damping", symmetric; row after row "coriolis", skew, and
                  "circulatory", "stiffness_unsymmetric", "damping_unsymmetric", any
   n_dof * n_dof: "speed/I/stiffness", n_dof: "speed/I/static", at the 2 to 4 rotation speeds
                  "speed/value" (I from 0), in place of "stiffness" and "stiffness_rotation"
   n_dof:         "load/static", "load/cosine", "load/sine", "load/static_rotation"
   n_rows n_dof:  "row/matrix", displacements that are combinations of dofs, row after row
   n_pairs:       "contact/mu", "contact/gap", "contact/area", "contact/normal_load",
                  "contact/slider_1", "contact/slider_2", "contact/residual",
                  "contact/gap_rotation", "contact/normal_load_rotation",
                  "contact/tangential_stiffness", "contact/normal_stiffness",
                  "contact/normal_coefficient", "contact/normal_exponent",
                  "contact/reference_force", "contact/decay_length", "contact/slip_speed",
                  "contact/mu_dynamic", "contact/weakening_speed", "contact/weakening_exponent",
                  "contact/mu_viscous", "contact/speed_1", "contact/speed_2", "contact/iwan_chi",
                  "contact/iwan_beta", "contact/bouc_wen_exponent", "contact/bouc_wen_beta"
   n_springs:     "spring/coefficient", as many as "spring/side_1" has dofs
   m * 2:         "contact/table", overclosure and force of each point
   3 * n_pairs:   "contact/position", pair after pair
   m * n_pairs:   "contact/gap_cosine", "contact/gap_sine", gaps of m harmonics each, harmonic after
                  harmonic; "contact/gap_harmonic" (fw_put_integers) before them
   m * n_dof:     "load/harmonic_cosine", "load/harmonic_sine", a load of m harmonics each, harmonic
                  after harmonic
   Of sectors, with "cyclic/n_sectors" before them; complex numbers are two values each, matrices
   come row after row:
   2 * k * k:     "nodal_diameter/K/mass", before the others of nodal diameter K, of order k; then
                  the same with stiffness, damping, stiffness_rotation, coriolis. Then n_dof of the
                  model counts the displacements in front, and there is no "mass" and "stiffness"
   2 * k:         "nodal_diameter/K/load/static", likewise cosine, sine, static_rotation
   2 * k * rows:  "nodal_diameter/K/observe/matrix"
   2 * a * a:     "aero/sector/M" or "aero/nodal_diameter/M"
   a * n_dof:     "aero/modes"
   The right interface is exp(-2 pi i K/N) times the left one: conjugate the other sign. */
int fw_put_reals(fw_handle handle, const char *name, size_t n, const double *values);

/* 3 * n_pairs: "contact/side_1" (required where there are pairs), "contact/side_2"; the signed
   numbers, from 1, of the dofs (t1, t2, n) of a pair, 0 for none or the ground.
   n_springs: "spring/side_1", as many nonlinear springs as it has dofs; "spring/side_2",
   "spring/sector_2", "spring/power" (0, 0 and 3 without them).
   m: "load/harmonic", the harmonics 0, 1, .. of the loads above.
   Of sectors: 1: "cyclic/n_sectors"; "cyclic/left" and "cyclic/right", as many each; n_pairs:
   "contact/sector_2". */
int fw_put_integers(fw_handle handle, const char *name, size_t n, const int *values);

/* Observe a linear combination of the dofs (n = n_dof). Without any, every dof is observed. With
   n = 0 only the name is given: the rows are those of nodal_diameter/K/observe/matrix. */
int fw_observe(fw_handle handle, const char *name, size_t n, const double *row);

/* Laws of your own; docs/user_laws.md has a whole example.

   A law gives the forces of one element at all instants of a period: of its n_in displacements u
   (differences of dofs) and their rates v = du/dt. Arrays are (n_time, n_in), the input running
   fastest. It returns 0, a negative number where it has no force for this motion (the step is taken
   back), or a positive one, which ends the run. */
typedef struct fw_law_call {
   size_t size;                /* of this struct */
   int n_time, n_in, n_state, n_parameters;
   int wants_derivative;       /* 1: fill du and dv, which come in as zeros */
   double omega;               /* [rad/s] */
   const double *tau, *u, *v;  /* omega t (n_time); u, v (n_time, n_in) */
   const double *parameters;   /* (n_parameters) */
} fw_law_call;

/* force (n_time, n_in), on the side of the stiffness, comes in as zeros; du, dv (n_time, n_in, n_in):
   force i by u_j and by v_j at [(t*n_in + i)*n_in + j], null where they are not wanted. */
typedef int (*fw_law_force)(void *user, const fw_law_call *call, double *force, double *du,
                            double *dv);

/* A law that remembers gives a step, from one instant to the next: call has n_time = 2 with tau, u
   and v before and after. It fills the state and the forces (n_in) at the end and, where they are
   wanted, dstate (n_state, n_state + 4 n_in): by (state, u, v before, u, v after), and dforce
   (n_in, n_state + 2 n_in): by (state after, u, v after), the second index running fastest. */
typedef int (*fw_law_step)(void *user, const fw_law_call *call, const double *state,
                           double *state_after, double *force, double *dstate, double *dforce);

enum fw_law_flags {
   FW_LAW_ODD = 1,           /* opposite motions have opposite forces: you promise it */
   FW_LAW_THREAD_SAFE = 2,   /* may be called from several threads; else the calling one alone */
   FW_LAW_NO_DERIVATIVE = 4  /* du and dv are never filled: differences stand for them */
};

typedef struct fw_law {
   size_t size;                 /* sizeof(fw_law) */
   int n_in, n_state, n_parameters;
   const int *side_1, *side_2;  /* signed dofs (n_in); side_2 null: the ground */
   const double *parameters, *start;   /* start: states of the unstrained element, null: 0 */
   unsigned flags;
   fw_law_force force;
   fw_law_step step;            /* with states; else force, and null here */
   void *user;                  /* handed on as it is */
} fw_law;

/* Add an element with a law to the case; the struct is copied, function and `user` have to live as
   long as the handle. A library that &user names exports `const int fw_law_interface = 1;`
   and functions fw_law_force; of a step, beside fw_law_step NAME, `const int NAME_states` and, if
   it is not 0, `const double NAME_start[]`. */
int fw_add_law(fw_handle handle, const char *name, const fw_law *law);

/* Callbacks; NULL removes one. `user` is passed on as it is. */
int fw_on_progress(fw_handle handle, fw_progress_callback callback, void *user);
int fw_on_message(fw_handle handle, fw_message_callback callback, void *user);

/* Everything that would refuse the case before it is computed. */
int fw_check(fw_handle handle);

/* Run the whole case, whatever its analysis. A result file is written where output%file names
   one; the results are in the handle in any case. Forgets earlier points. */
int fw_run_case(fw_handle handle);

/* The one function for a handle that is at work in another thread: fw_run_case or fw_solve there
   ends, within a point too, with FW_STOPPED; the points that were finished are kept. FW_USAGE where
   no call is at work on the handle. Not for signal handlers: let a thread call it. */
int fw_stop(fw_handle handle);

/* Or step by step. fw_start builds the system for the frequencies between sweep%start and
   sweep%end and forgets earlier points; every change of the case asks for a new start. fw_solve
   starts from the solutions before it: neighbours are cheap, jumps are not. */
int fw_start(fw_handle handle);
int fw_solve(fw_handle handle, double omega);

/* Frequency k (from 0) of the sweep, to the bit the one that fw_run_case takes; there are
   "frequencies" of them. */
int fw_get_frequency(fw_handle handle, int k, double *omega);

/* How many there are: "points" that were solved, "frequencies" of the sweep, "dofs", "pairs",
   "observed" quantities, "coefficients" of a Fourier series (2 H + 1). */
int fw_count(fw_handle handle, const char *what, int *n);

/* Results of a point (from 0; -1 is the last one) by the name of their dataset in a result file,
   in its layout: the last index runs fastest. fw_size says how many values there are; fw_get
   copies them to a buffer with room for n, and leaves one that is too small as it is.
   1: "omega", "converged", "iterations", "residual", "seconds", "served_by", "fold"; with
   accuracy "harmonics", "instants", "error_estimate"; with a sweep over another
   parameter "parameter", of a load "load/scale", which &control has with "control/amplitude";
   of a base that moves "base/coefficients"; "structural/dissipation", energy per cycle, and
   "speed", where the case has them
   (2H+1, n_observed):    "coefficients", in the order (0, c1, s1, c2, s2, ...)
   (n_observed):          "amplitude", largest magnitude over the period
   with group &stress "stress/worst" (1), "stress/amplitude", "stress/mean" and
   "stress/utilisation" (n_stress, of every sector), "stress/coefficients" (2H+1, n_stress, 6)
   with &cyclic mistuned "blades/largest", "blades/sector" (n_quantities, of a sector) and
   "blades/content" (n_quantities, n_sectors)
   (2H+1, n_pairs, 3):    "contact/force", components (t1, t2, n)
   (n_pairs, 3):          "contact/fraction" of the period in stick, slip and open
   (n_pairs):             "contact/dissipation", "contact/obstacle_work", energy per cycle
   (2H+1, laws, n_in):    "user/force" of laws of your own, and (laws): "user/work" per cycle
   "history/observed", "history/force", "history/relative_displacement",
   "floquet/multipliers", "floquet/stable": where the case asks for them.
   "sensitivity/QUANTITY/PARAMETER" ([n_observed][, n_pairs or values of sectors]), "sensitivity/deviation/QUANTITY":
   derivatives, with group &sensitivity.
   "mode/damping_ratio", "mode/self_excitation", "mode/modal_amplitude" (1) and
   "mode/first_harmonic" (n_observed): of the points of a nonlinear mode.
   "wear/cycles" (1), "wear/depth", "wear/rate" and "wear/energy" (n_pairs), "wear/volume"
   (n_patches): of the steps of a wear run. */
int fw_size(fw_handle handle, const char *name, int point, size_t *n);
int fw_get(fw_handle handle, const char *name, int point, size_t n, double *values);

/* Texts: "title", "namelist" (the effective input), "summary" (of fw_run_case, line by line),
   "observed" (name of quantity k, from 0; k means nothing to the others). Copies at most
   size - 1 characters and a null; `length`, unless it is null, is that of the whole text. */
int fw_get_text(fw_handle handle, const char *what, int k, char *buffer, size_t size,
                size_t *length);

#ifdef __cplusplus
}
#endif

#endif
