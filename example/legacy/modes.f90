!> A nonlinear mode, and what the friction of a joint does to a response, from modern Fortran.
!>
!>    modes mode.nml sensitivity.nml out.txt
!>
!> The lines written are those of modes.c.
program modes
   use fretwear, only: error_type, session_type, silent_observer, wp
   implicit none (type, external)
   character(200) :: path(3)
   integer :: k, unit

   do k = 1, 3
      call get_command_argument(k, path(k))
   end do
   open (newunit=unit, file=trim(path(3)), action='write', status='replace')
   call table(trim(path(1)), [character(32) :: 'mode/first_harmonic', 'omega', &
                              'mode/damping_ratio'])
   call table(trim(path(2)), [character(32) :: 'omega', 'amplitude', &
                              'sensitivity/largest/contact_mu'])
   close (unit)

contains

   !> Run a case, and write numbers of each point by their names in a result file.
   subroutine table(case, names)
      character(*), intent(in) :: case, names(:)
      type(session_type), target :: session
      type(silent_observer) :: observer
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:)
      real(wp) :: row(size(names))
      integer :: i, point

      call session%load_file(case, error)
      call check(error)
      call session%run(observer, error)
      call check(error)
      if (session%outcome%status /= 0) error stop 4
      do point = 1, session%points%n
         do i = 1, size(names)
            call session%get(trim(names(i)), point, values, error)
            call check(error)
            row(i) = values(1)
         end do
         write (unit, '(1p, *(e26.17e3))') row
      end do
   end subroutine table

   subroutine check(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      write (*, '(a)') error%message
      error stop 1
   end subroutine check

end program modes
