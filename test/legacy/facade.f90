!> A host in modern Fortran: the facade alone, an observer of its own, a model in memory.
!>
!>    facade sector_16.h5 out.txt
module host_observer
   use fretwear, only: observer_type, point_type
   implicit none (type, external)
   private

   public :: counter

   type, extends(observer_type) :: counter
      integer :: n = 0
      integer :: stop_after = huge(1)
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
   end type counter

contains

   subroutine on_start(self, case_title, n_points)
      class(counter), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points

      if (len(case_title) > 0 .and. n_points >= 0) self%n = 0
   end subroutine on_start

   subroutine on_point(self, index, n_points, point)
      class(counter), intent(inout) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point

      if (point%converged .and. (n_points == 0 .or. index <= n_points)) self%n = self%n + 1
      self%stop_requested = self%n >= self%stop_after
   end subroutine on_point

   subroutine on_message(self, text)
      class(counter), intent(inout) :: self
      character(*), intent(in) :: text

      if (len(text) == 0) self%n = -1
   end subroutine on_message

   subroutine on_end(self)
      class(counter), intent(inout) :: self

      if (self%n < 0) error stop 9
   end subroutine on_end

end module host_observer

program facade
   ! allow(C121): a facade that needs no list is what this tests
   use fretwear
   use host_observer, only: counter
   implicit none (type, external)
   type(session_type), target :: session
   type(counter) :: observer
   type(error_type), allocatable :: error
   character(1000) :: argument
   real(wp) :: omega
   real(wp), allocatable :: values(:)
   integer :: k, unit

   call get_command_argument(1, argument)
   call session%load_file(trim(argument), error)
   if (allocated(error)) error stop 1
   call session%set('sweep%n_points', '25', error)
   if (allocated(error)) error stop 2
   call get_command_argument(2, argument)
   open (newunit=unit, file=trim(argument))

   call session%start(error)
   if (allocated(error)) error stop 3
   do k = 1, session%n_frequencies()
      call session%frequency(k, omega, error)
      if (allocated(error)) error stop 4
      call session%solve(omega, observer, error)
      if (allocated(error)) error stop 5
      call session%get('coefficients', 0, values, error)
      if (allocated(error)) error stop 6
      write (unit, '(8(es26.17e3))') omega, values
   end do
   if (observer%n /= 25 .or. session%points%n /= 25) error stop 7
   close (unit)

   observer%stop_after = 3
   call session%run(observer, error)
   if (allocated(error)) error stop 8
   if (session%outcome%status /= status_stopped .or. session%points%n /= 3) error stop 10

   call session%set('solver%tolerence', '1', error)
   if (allocated(error)) error stop 11
   call session%check(error)
   if (.not. allocated(error)) error stop 12
   if (error%status /= status_input) error stop 13
end program facade
