!> A response whose amplitude is given and whose vibratory load is found,
!>
!>   R(q, s) = Z q + forces - F_0 - s F_1 = 0,    g(q, s) = 0,
!>
!>   first harmonic   g = (|U_1|^2 - a^2)/(2 a^2),       largest   g = max |u(tau)|/a - 1,
!>
!> g times the norm of the load, so that one tolerance serves both. U = T q + s U_F is the observed
!> quantity with what the load moves where the coordinates rest. As a curve in s cut by a plane that
!> turns with the point: the border is dg, at the instant of the largest |u| for the latter.
!> Single valued in the frequency where the response to a given load has folds; where it folds all
!> the same, at internal resonances, it can be followed: its own parameter is the place of the
!> state, the frequency or the parameter that it goes along.
module fw_control_system
   use fw_balance_state, only: balance_state
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_control_options, only: of_first_harmonic
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_plane_system, only: plane_system
   use fw_recovery, only: largest_magnitude, observe, peak_angles
   use fw_structure_operator, only: by_frequency
   implicit none (type, external)
   private

   public :: control_system, new_control_system

   type, extends(plane_system) :: control_system
      !> Only pointed at; its parameter is the scale of the vibratory load.
      type(balance_state), pointer :: state => null()
      !> The observed quantity, and what its amplitude is (fw_control_options).
      integer :: observed = 1, of = of_first_harmonic
      !> a [length]
      real(wp) :: amplitude = 1.0_wp
      !> Unit of s among the unknowns, which a branch takes to make it as large as the others.
      real(wp) :: load_unit = 1.0_wp
      !> The least norm that residuals are compared to, where that follows the load; 0: it is held.
      real(wp) :: least_reference = 0.0_wp
      !> T (n_coordinates, n_retained), U_F and the static part (n_retained).
      complex(wp), allocatable, private :: row(:, :), by_load(:), constant(:)
      !> U at the last point (n_retained), and the place that T is of.
      complex(wp), allocatable :: motion(:)
      real(wp), private :: place = 0.0_wp
      logical, private :: stands = .false.
      !> dg = sum of Re(weight dU) at the last linearized point (n_retained).
      complex(wp), allocatable, private :: weight(:)
   contains
      procedure :: stand
      procedure :: take
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: condition_slope
      procedure :: move
      procedure :: size_of_motion
      procedure :: conditions
      procedure :: choose
   end type control_system

contains

   !> Put the scale of the load beside the unknowns of a state, which has to live as long.
   subroutine new_control_system(state, observed, of, self)
      type(balance_state), intent(inout), target :: state
      integer, intent(in) :: observed, of
      type(control_system), intent(out) :: self
      real(wp) :: nothing(state%n)

      nothing = 0.0_wp
      call self%cut(state, nothing, 0.0_wp, nothing, 0.0_wp)
      self%state => state
      self%observed = observed
      self%of = of
      ! The load is what is looked for: residuals are compared to that of the guess.
      self%holds_reference = .true.
      associate (s => state%problem%structure, n => state%problem%fourier%n_retained)
         allocate (self%row(s%n_coordinates, n), self%by_load(n), self%constant(n), &
                   self%motion(n), self%weight(n), source=(0.0_wp, 0.0_wp))
      end associate
   end subroutine new_control_system

   !> Go to a place, a frequency or a value; the state stays at its load.
   subroutine stand(self, place, error)
      class(control_system), intent(inout) :: self
      real(wp), intent(in) :: place
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: observed(:, :)
      real(wp) :: rest(self%state%n), scale
      integer :: h

      if (self%stands .and. abs(place - self%place) <= 0.0_wp) return
      self%stands = .false.
      call self%state%set_place(place, error)
      if (allocated(error)) return
      associate (p => self%state%problem)
         allocate (observed(p%structure%n_observed, p%fourier%n_retained))
         scale = self%state%parameter()
         call self%state%set_parameter(1.0_wp, error)
         if (allocated(error)) return
         rest = 0.0_wp
         call observe(self%state, rest, observed)
         do h = 1, p%fourier%n_retained
            self%by_load(h) = merge((0.0_wp, 0.0_wp), observed(self%observed, h), &
                                    p%fourier%harmonic(h) == 0)
            self%constant(h) = observed(self%observed, h) - self%by_load(h)
         end do
         if (p%structure%knows_field) then
            call find_row(self)
         else
            call try_units(self, observed)
         end if
         call self%state%set_parameter(scale, error)
      end associate
      if (allocated(error)) return
      self%place = place
      self%stands = .true.
   end subroutine stand

   !> The further unknown is the load, in its unit.
   subroutine take(self, z, error)
      class(control_system), intent(inout) :: self
      real(wp), intent(in) :: z(:)
      type(error_type), allocatable, intent(out) :: error

      call self%plane_system%take(self%load_unit*z, error)
      if (self%least_reference > 0.0_wp) self%reference = max(self%state%reference, &
                                                              self%least_reference)
   end subroutine take

   !> As a curve of its own: over the place.
   subroutine set_parameter(self, parameter, error)
      class(control_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%stand(parameter, error)
   end subroutine set_parameter

   !> By the place: dR/dplace, and that of what is observed while the coordinates stay. The load is
   !> that where the state stands.
   subroutine parameter_derivative(self, x, dr)
      class(control_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      complex(wp), allocatable :: q(:, :), slope(:, :)
      integer :: m, n

      n = self%state%n
      associate (s => self%state%problem%structure, f => self%state%problem%fourier)
         allocate (slope(s%n_observed, f%n_retained))
         if (self%state%goes_along()) then
            call self%state%along%mover%derive(self%state, self%state%along%value, x(:n), dr(:n), &
                                               slope)
         else
            call self%state%derivative_by(by_frequency, x(:n), dr(:n))
            m = s%n_coordinates
            allocate (q(m, f%n_retained))
            call amplitudes_of(f%harmonic, f%column, m, x(:n), m, q)
            call s%observed_slope(self%state%structure_state, q, slope)
         end if
      end associate
      dr(n + 1) = self%condition_slope(slope)
   end subroutine parameter_derivative

   !> What a slope of the observed quantities at held unknowns (n_observed, n_retained) does to the
   !> condition at the last linearized point.
   pure real(wp) function condition_slope(self, observed) result(slope)
      class(control_system), intent(in) :: self
      complex(wp), intent(in) :: observed(:, :)

      slope = sum(real(self%weight*observed(self%observed, :), wp))
   end function condition_slope

   !> T by the transpose of the condensation, which is symmetric.
   subroutine find_row(self)
      class(control_system), intent(inout) :: self
      complex(wp), allocatable :: observed(:, :), field(:, :)

      associate (p => self%state%problem, s => self%state%problem%structure)
         allocate (observed(s%n_observed, p%fourier%n_retained), source=(0.0_wp, 0.0_wp))
         allocate (field(s%whole_size(), p%fourier%n_retained))
         observed(self%observed, :) = (1.0_wp, 0.0_wp)
         call s%observe_back(observed, field)
         call s%condense_field(self%state%structure_state, field, self%row)
      end associate
   end subroutine find_row

   !> T column by column, all harmonics at once.
   subroutine try_units(self, at_rest)
      class(control_system), intent(inout) :: self
      !> Observed where all coordinates rest (n_observed, n_retained).
      complex(wp), intent(in) :: at_rest(:, :)
      complex(wp) :: q(size(self%row, 1), size(self%row, 2))
      complex(wp) :: observed(size(at_rest, 1), size(at_rest, 2))
      integer :: j

      q = (0.0_wp, 0.0_wp)
      do j = 1, size(q, 1)
         q(j, :) = (1.0_wp, 0.0_wp)
         call self%state%problem%structure%recover(self%state%structure_state, q, observed)
         self%row(j, :) = observed(self%observed, :) - at_rest(self%observed, :)
         q(j, :) = (0.0_wp, 0.0_wp)
      end do
   end subroutine try_units

   !> U of unknowns q under s times the load.
   subroutine move(self, q, s)
      class(control_system), intent(inout) :: self
      real(wp), intent(in) :: q(:), s
      integer :: h, k, m

      m = size(self%row, 1)
      associate (fourier => self%state%problem%fourier)
         do h = 1, fourier%n_retained
            k = (fourier%column(h) - 1)*m
            self%motion(h) = self%constant(h) + s*self%by_load(h) + &
                             sum(self%row(:, h)*q(k + 1:k + m))
            if (fourier%harmonic(h) == 0) cycle
            ! q = c - i s.
            self%motion(h) = self%motion(h) - (0.0_wp, 1.0_wp)* &
                             sum(self%row(:, h)*q(k + m + 1:k + 2*m))
         end do
      end associate
   end subroutine move

   !> What is to be the amplitude, of the motion.
   real(wp) function size_of_motion(self) result(size)
      class(control_system), intent(in) :: self

      if (self%of == of_first_harmonic) then
         size = abs(first_of(self))
      else
         size = largest_magnitude(coefficients(self))
      end if
   end function size_of_motion

   !> U_1; 0 where the balance has no first harmonic.
   complex(wp) function first_of(self)
      type(control_system), intent(in) :: self
      integer :: h

      h = findloc(self%state%problem%fourier%harmonic, 1, dim=1)
      first_of = (0.0_wp, 0.0_wp)
      if (h > 0) first_of = self%motion(h)
   end function first_of

   !> U as coefficients (0, c1, s1, ...).
   function coefficients(self) result(c)
      type(control_system), intent(in) :: self
      real(wp), allocatable :: c(:)
      integer :: h, n

      associate (harmonic => self%state%problem%fourier%harmonic)
         allocate (c(2*maxval(harmonic) + 1), source=0.0_wp)
         do h = 1, size(harmonic)
            n = harmonic(h)
            c(max(1, 2*n)) = real(self%motion(h), wp)
            if (n > 0) c(2*n + 1) = -aimag(self%motion(h))
         end do
      end associate
   end function coefficients

   subroutine conditions(self, q, z, g)
      class(control_system), intent(inout) :: self
      real(wp), intent(in) :: q(:), z(:)
      real(wp), intent(out) :: g(:)

      self%x = q
      call self%move(q, self%load_unit*z(1))
      if (self%of == of_first_harmonic) then
         g = 0.5_wp*self%reference*((abs(first_of(self))/self%amplitude)**2 - 1.0_wp)
      else
         g = self%reference*(self%size_of_motion()/self%amplitude - 1.0_wp)
      end if
   end subroutine conditions

   !> The plane of the present point.
   subroutine choose(self)
      class(control_system), intent(inout) :: self
      complex(wp) :: slope(size(self%row, 1), size(self%row, 2))
      real(wp) :: angle(2), side(2), largest
      integer :: h, k, n_peaks

      self%weight = (0.0_wp, 0.0_wp)
      associate (weight => self%weight, fourier => self%state%problem%fourier, &
                 m => size(self%row, 1))
         if (self%of == of_first_harmonic) then
            h = findloc(fourier%harmonic, 1, dim=1)
            if (h > 0) weight(h) = self%reference/self%amplitude**2*conjg(self%motion(h))
         else
            call peak_angles(coefficients(self), largest, n_peaks, angle, side)
            do k = 1, n_peaks
               weight = weight + self%reference/self%amplitude*side(k)/n_peaks* &
                        cmplx(cos(fourier%harmonic*angle(k)), sin(fourier%harmonic*angle(k)), wp)
            end do
         end if
         do h = 1, fourier%n_retained
            slope(:, h) = conjg(weight(h)*self%row(:, h))
         end do
         call coefficients_of(fourier%harmonic, fourier%column, m, m, slope, self%border)
      end associate
      self%border_p = sum(real(self%weight*self%by_load, wp))
      call self%plane_system%choose()
      if (abs(self%load_unit - 1.0_wp) <= 0.0_wp) return
      self%slope = self%load_unit*self%slope
      self%column = self%load_unit*self%column
      self%corner_p = self%load_unit*self%corner_p
   end subroutine choose

end module fw_control_system
