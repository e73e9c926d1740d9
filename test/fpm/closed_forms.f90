!> What `fpm test` runs: the library as fpm builds it, against two closed forms of friction.
!>
!> 1. One harmonic of a mass on a spring with an elastic slider (Jenkins): its describing function
!>    (Caughey, 1960) balances the load exactly, at amplitudes that stick and that slip.
!> 2. Integration in time of a mass with rigid Coulomb friction: Den Hartog (1931), motion without
!>    stops and without viscous damping.
!>
!> The program ends with status 1 where one of them does not hold.
program closed_forms
   use, intrinsic :: iso_fortran_env, only: output_unit
   use fretwear, only: error_type, session_type, silent_observer, wp
   implicit none (type, external)

   real(wp), parameter :: pi = acos(-1.0_wp)
   !> Mass and stiffness are 1.
   real(wp), parameter :: damping = 0.04_wp, slider = 1.0_wp, load = 1.0_wp
   !> A residual of 1e-8 of the load is solved for; ten times as much.
   real(wp), parameter :: balance_tolerance = 1.0e-7_wp
   !> Measured 6e-7, of steps of second order that find each reversal.
   real(wp), parameter :: time_tolerance = 1.0e-5_wp
   character(*), parameter :: mass = "&model n_dof = 1, mass = 1.0, stiffness = 1.0, damping = "
   character(*), parameter :: pair = "&contact n_pairs = 1, side_1 = 1, 0, 0, mu = 1.0, "
   character(*), parameter :: rest = "&load cosine = 1.0 / &output observe = 1 / "
   logical :: good

   good = .true.
   call check_slider(0.5_wp)
   call check_slider(3.0_wp)
   call check_rigid(0.8_wp)
   call check_rigid(1.4_wp)
   if (.not. good) stop 1, quiet=.true.

contains

   !> The elastic slider with a limit, over a sweep: the amplitude a leaves
   !> |1 + k(a) - omega**2 + i (damping omega + h(a))| a = load.
   subroutine check_slider(limit)
      real(wp), intent(in) :: limit
      real(wp), allocatable :: omega(:), a(:)
      real(wp) :: error(11)

      call solve("&case analysis = 'frf' / "//mass//"0.04 / "//pair//"law = 'penalty', "// &
                 "tangential_stiffness = 1.0, normal_load = "//number(limit)//" / "//rest// &
                 "&harmonics n_harmonics = 1 / &sweep start = 0.6, end = 1.6, n_points = 11 /", &
                 omega, a)
      if (size(a) /= size(error)) then
         call report('points of the elastic slider', huge(1.0_wp), balance_tolerance)
         return
      end if
      error = abs(abs(cmplx(1.0_wp + held(a, limit) - omega**2, &
                            damping*omega + lost(a, limit), wp))*a - load)/load
      call report('one harmonic with an elastic slider, limit '//trim(number(limit)), &
                  maxval(error), balance_tolerance)
   end subroutine check_slider

   !> Stiffness in phase with the motion, of an amplitude a.
   elemental real(wp) function held(a, limit)
      real(wp), intent(in) :: a, limit
      real(wp) :: angle

      held = slider
      if (slider*a <= limit) return
      angle = acos(1.0_wp - 2.0_wp*limit/(slider*a))
      held = slider/pi*(angle - 0.5_wp*sin(2.0_wp*angle))
   end function held

   !> The same in quadrature: work of a period over pi a**2.
   elemental real(wp) function lost(a, limit)
      real(wp), intent(in) :: a, limit

      lost = max(0.0_wp, 4.0_wp*limit*(a - limit/slider)/(pi*a**2))
   end function lost

   !> Rigid friction of 0.2 of the load, at a frequency where the mass never stops.
   subroutine check_rigid(frequency)
      real(wp), intent(in) :: frequency
      real(wp), parameter :: limit = 0.2_wp
      real(wp), allocatable :: omega(:), a(:)
      real(wp) :: v, u, exact

      call solve("&case analysis = 'time' / "//mass//"0.0 / "//pair//"law = 'dlft', "// &
                 "normal_load = "//number(limit)//" / "//rest//"&harmonics n_harmonics = 25 / "// &
                 "&sweep start = "//number(frequency)//", end = "//number(frequency)// &
                 ", n_points = 1 /", omega, a)
      if (size(a) /= 1) then
         call report('points of rigid friction', huge(1.0_wp), time_tolerance)
         return
      end if
      v = 1.0_wp/(1.0_wp - frequency**2)
      u = sin(pi/frequency)/(frequency*(1.0_wp + cos(pi/frequency)))
      exact = sqrt(v**2 - (limit/load*u)**2)
      call report('rigid friction in time at '//trim(number(frequency)), abs(a(1)/exact - 1.0_wp), &
                  time_tolerance)
   end subroutine check_rigid

   !> Run a case; frequencies and amplitudes of its points, none where it failed.
   subroutine solve(text, omega, a)
      character(*), intent(in) :: text
      real(wp), allocatable, intent(out) :: omega(:), a(:)
      type(session_type), target :: session
      type(silent_observer) :: observer
      type(error_type), allocatable :: error
      real(wp), allocatable :: value(:)
      integer :: k

      allocate (omega(0), a(0))
      call session%load_text(text, 'closed_forms')
      call session%run(observer, error)
      do k = 1, session%points%n
         if (allocated(error)) exit
         call session%get('omega', k, value, error)
         if (allocated(error)) exit
         omega = [omega, value]
         call session%get('amplitude', k, value, error)
         if (.not. allocated(error)) a = [a, value]
      end do
      if (.not. allocated(error)) return
      write (output_unit, '(a)') error%message
      deallocate (a)
      allocate (a(0))
   end subroutine solve

   subroutine report(what, error, tolerance)
      character(*), intent(in) :: what
      real(wp), intent(in) :: error, tolerance

      write (output_unit, '(a,es9.2,a,es9.2)') what//': error ', error, ', tolerance ', tolerance
      good = good .and. error <= tolerance
   end subroutine report

   pure function number(value) result(text)
      real(wp), intent(in) :: value
      character(6) :: text

      write (text, '(f6.2)') value
      text = adjustl(text)
   end function number

end program closed_forms
