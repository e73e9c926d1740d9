!> What fw_run says about itself.
module fw_help
   implicit none (type, external)
   private

   public :: write_help

contains

   subroutine write_help(unit)
      integer, intent(in) :: unit

      write (unit, '(a)') &
         'Usage: fw_run [options] case.nml', &
         '', &
         'Periodic response of a structure with contact, friction and fretting wear by', &
         'harmonic balance. Reads a namelist, writes an HDF5 result file.', &
         '', &
         'Options:', &
         '  --set GROUP%KEY=VALUE  change one value of the namelist; may be repeated, the last', &
         '                         one holds; words need no quotes', &
         '  -o FILE                result file (default: name of the namelist with .h5,', &
         '                         beside it)', &
         '  --restart FILE         go on with the wear run of this result file, also of one that', &
         '                         was killed (FILE.part)', &
         '  --explain              say of points that were not found what was tried, what that', &
         '                         met, and what an integration in time from there comes to', &
         '  --keys [GROUP]         what every key accepts and means, its unit and its default;', &
         '                         --keys=json for programs', &
         '  --rules                which keys do not go together, and what to use instead', &
         '  --parts                what a model file may hold, as a table', &
         '  --remarks              what runs may remark, and when, as a table', &
         '  --messages             messages that ask for more than they say, and what to do', &
         '  --check                validate, print the effective input and the natural', &
         '                         frequencies within the sweep, run nothing', &
         '  -q                     errors only', &
         '  -v                     iterations and residual of every point', &
         '  --help                 this text', &
         '  --version              version number', &
         '  --                     end of the options', &
         '', &
         'Groups of the namelist:'
      write (unit, '(a)') &
         '  &case         title, kind of analysis, threads', &
         '  &model        mass, stiffness and damping, inline or from a file', &
         '  &cyclic       sectors around an axis and the wave that runs around it', &
         '  &contact      contact pairs, friction, gap, contact law', &
         '  &spring       nonlinear springs', &
         '  &load         static and harmonic loads', &
         '  &harmonics    method, number of harmonics, instants per period', &
         '  &sweep        frequencies', &
         '  &mode         nonlinear mode: which one, and its amplitudes', &
         '  &sensitivity  derivatives by parameters of the case', &
         '  &solver       nonlinear solver, tolerance', &
         '  &pseudo_time  pseudo-time integration', &
         '  &wear         fretting wear', &
         '  &time         time integration', &
         '  &output       result file, observed quantities', &
         'All keys with what each means: fw_run --keys; as a case has them: fw_run --check', &
         '', &
         'Examples:', &
         '  fw_run case.nml', &
         '  fw_run --set harmonics%n_harmonics=7 --set contact%mu=0.3 -o h7.h5 case.nml', &
         '', &
         'Exit status: 0 done; 2 wrong usage; 3 wrong input; 4 not converged (what was computed', &
         'is saved); 5 a file cannot be read or written; 6 ended by SIGINT, SIGTERM or', &
         'case%max_seconds (the points that are done are saved); 1 anything else.'
   end subroutine write_help

end module fw_help
