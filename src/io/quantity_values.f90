!> The numbers of each quantity in a point, laid out as h5py shows them (the last index runs
!> fastest); not allocated where they are not known. A flag is 1 or 0.
module fw_quantity_values
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_kinds, only: wp
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: amplitude, coefficients, control, converged, cycles, damping_ratio, depth, &
             dissipation, error_estimate, first_harmonic, fold, force, force_history, &
             fraction, harmonics, history, instants, iterations, load_scale, modal_amplitude, &
             multiplier_error, multipliers, nothing, omega, place, residual, seconds, &
             self_excitation, served_by, slip_history, stable, tangent, tangent_omega, &
             tangent_parameter, wear_energy, wear_rate, wear_volume

contains

   !> Of a quantity that is found in another way.
   subroutine nothing(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(values)) deallocate (values)
      associate (unused => point)
      end associate
   end subroutine nothing

   subroutine omega(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%omega]
   end subroutine omega

   !> (2H+1, n_observed) in memory: h5py shows the observed quantity last, so that it runs fastest.
   subroutine coefficients(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%coefficients)) values = by_rows(point%coefficients)
   end subroutine coefficients

   subroutine amplitude(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%amplitude)) values = point%amplitude
   end subroutine amplitude

   subroutine converged(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [flag(point%converged)]
   end subroutine converged

   subroutine iterations(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [real(point%iterations, wp)]
   end subroutine iterations

   subroutine residual(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%residual]
   end subroutine residual

   subroutine seconds(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%seconds]
   end subroutine seconds

   subroutine served_by(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [real(point%served_by, wp)]
   end subroutine served_by

   subroutine fold(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [flag(point%fold)]
   end subroutine fold

   subroutine tangent_omega(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%tangent_omega]
   end subroutine tangent_omega

   subroutine tangent_parameter(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%tangent_parameter]
   end subroutine tangent_parameter

   subroutine load_scale(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%load_scale]
   end subroutine load_scale

   subroutine control(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%control]
   end subroutine control

   subroutine place(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [point%place]
   end subroutine place

   subroutine tangent(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%tangent)) values = by_rows(point%tangent)
   end subroutine tangent

   subroutine harmonics(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [real(point%n_harmonics, wp)]
   end subroutine harmonics

   subroutine instants(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      values = [real(point%n_time, wp)]
   end subroutine instants

   !> Unknown where the point failed or no estimate was possible.
   subroutine error_estimate(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (point%converged .and. point%error_estimate < huge(1.0_wp)) then
         values = [point%error_estimate]
      end if
   end subroutine error_estimate

   !> Unknown where the multipliers are: -1 in the file, as where they leave it open.
   subroutine stable(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%multipliers)) values = [real(point%verdict, wp)]
   end subroutine stable

   !> Real and imaginary part of each, side by side.
   subroutine multipliers(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)
      integer :: n

      if (.not. allocated(point%multipliers)) return
      n = size(point%multipliers)
      allocate (values(2*n))
      values(1::2) = real(point%multipliers, wp)
      values(2::2) = aimag(point%multipliers)
   end subroutine multipliers

   !> NaN where no estimate was possible.
   subroutine multiplier_error(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (.not. allocated(point%multiplier_error)) return
      values = point%multiplier_error
      where (.not. values < huge(1.0_wp)) values = ieee_value(1.0_wp, ieee_quiet_nan)
   end subroutine multiplier_error

   !> Its order in memory (direction, pair, coefficient) is that of h5py reversed already.
   subroutine force(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%force)) values = reshape(point%force, [size(point%force)])
   end subroutine force

   !> (3, n_pairs) in memory, as h5py shows it reversed.
   subroutine fraction(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%fraction)) values = reshape(point%fraction, [size(point%fraction)])
   end subroutine fraction

   subroutine dissipation(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%dissipation)) values = point%dissipation
   end subroutine dissipation

   !> (n_time, n_observed) in memory: turned as the coefficients are.
   subroutine history(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%history)) values = by_rows(point%history)
   end subroutine history

   !> (3, n_pairs, n_time) in memory, as h5py shows it reversed; displacements likewise.
   subroutine force_history(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%force_history)) then
         values = reshape(point%force_history, [size(point%force_history)])
      end if
   end subroutine force_history

   subroutine slip_history(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%slip_history)) then
         values = reshape(point%slip_history, [size(point%slip_history)])
      end if
   end subroutine slip_history

   subroutine damping_ratio(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%first_harmonic)) values = [0.5_wp*point%self_excitation/point%omega]
   end subroutine damping_ratio

   subroutine self_excitation(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%first_harmonic)) values = [point%self_excitation]
   end subroutine self_excitation

   subroutine modal_amplitude(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%first_harmonic)) values = [point%modal_amplitude]
   end subroutine modal_amplitude

   subroutine first_harmonic(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%first_harmonic)) values = point%first_harmonic
   end subroutine first_harmonic

   !> A point with depths is a step of wear; any other has no row in these quantities.
   subroutine cycles(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%depth)) values = [point%cycles]
   end subroutine cycles

   subroutine depth(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%depth)) values = point%depth
   end subroutine depth

   subroutine wear_rate(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%wear_rate)) values = point%wear_rate
   end subroutine wear_rate

   subroutine wear_energy(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%wear_energy)) values = point%wear_energy
   end subroutine wear_energy

   subroutine wear_volume(point, values)
      type(point_type), intent(in) :: point
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(point%wear_volume)) values = point%wear_volume
   end subroutine wear_volume

   !> The elements of a matrix with the second index running fastest.
   pure function by_rows(array) result(flat)
      real(wp), intent(in) :: array(:, :)
      real(wp) :: flat(size(array))

      flat = reshape(transpose(array), [size(array)])
   end function by_rows

   !> Truth as a number: rows are reals until they are written.
   pure real(wp) function flag(is_true)
      logical, intent(in) :: is_true

      flag = merge(1.0_wp, 0.0_wp, is_true)
   end function flag

end module fw_quantity_values
