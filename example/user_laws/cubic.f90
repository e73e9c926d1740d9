!> The same spring as an object of a program in Fortran.
module cubic_law
   use fretwear, only: user_call, user_law_type, wp
   implicit none (type, external)
   private

   public :: cubic_type

   type, extends(user_law_type) :: cubic_type
      real(wp) :: c = 0.0_wp
   contains
      procedure :: evaluate
   end type cubic_type

contains

   subroutine evaluate(self, call, force, du, dv, status)
      class(cubic_type), intent(inout) :: self
      type(user_call), intent(in) :: call
      real(wp), intent(out) :: force(:, :)
      real(wp), intent(inout) :: du(:, :, :), dv(:, :, :)
      integer, intent(inout) :: status

      force = self%c*call%u**3
      if (call%wants_derivative) du(1, 1, :) = 3.0_wp*self%c*call%u(1, :)**2
      associate (unused => dv, unused_too => status)
      end associate
   end subroutine evaluate

end module cubic_law

program cubic
   use cubic_law, only: cubic_type
   use fretwear, only: error_type, session_type, silent_observer, wp
   implicit none (type, external)
   type(session_type) :: session
   type(cubic_type) :: law
   type(silent_observer) :: observer
   type(error_type), allocatable :: error
   real(wp), allocatable :: amplitude(:)

   law%c = 0.5_wp
   call session%load_text('&case analysis = ''point'' / &model n_dof = 1 mass = 1 '// &
                          'damping = 0.1 stiffness = 1 / &load cosine = 0.3 / '// &
                           '&harmonics n_harmonics = 9 / '// &
                          '&sweep start = 1.2 / &solver tolerance = 1e-11 /', 'cubic')
   call session%add_law('cubic', law, side_1=[1], odd=.true.)
   call session%run(observer, error, write_file=.false.)
   if (.not. allocated(error)) call session%get('amplitude', 0, amplitude, error)
   if (allocated(error)) error stop error%message
   print '(a, f13.10)', 'amplitude: ', amplitude(1)
end program cubic
