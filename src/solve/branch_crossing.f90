!> Where a branch goes straight through a bifurcation: another branch crosses it there, and the sign
!> of det(dR/dx) dp/ds, which is the same all along a branch otherwise, is the other one beyond.
!>
!> The other sign may also mean that the corrector has come to another piece of the curve. Halving
!> the step tells: solutions that follow the cubic on either side of the change, down to where both
!> sides all but touch and their tangents agree, are one curve. It ends well before the place
!> itself, where dR/dx is singular and tangents are those of round-off.
module fw_branch_crossing
   use fw_branch_point, only: branch_point, metric_type
   use fw_branch_step, only: interpolate
   use fw_corrector, only: corrector_type, differ
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_parameter_system, only: parameter_system
   implicit none (type, external)
   private

   public :: goes_through

   !> Length of what is left of the step in the end, and halvings to get there.
   real(wp), parameter :: narrow = 2.0e-3_wp
   integer, parameter :: most_halvings = 12
   !> Distance of a solution from the cubic, over the step that it halves.
   real(wp), parameter :: beside = 0.05_wp
   !> Cosine of the angle between tangents on either side.
   real(wp), parameter :: along = 0.995_wp

contains

   !> Whether the step from `here` to `ahead`, whose orientations differ, stays on one curve. The
   !> system stands at `ahead` again afterwards, with its factors.
   subroutine goes_through(corrector, system, here, ahead, is_one, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: here, ahead
      logical, intent(out) :: is_one
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: low, high, middle
      real(wp), allocatable :: r(:)
      integer :: k
      logical :: done

      is_one = .false.
      low = here
      high = ahead
      do k = 1, most_halvings
         call halve(corrector, system, low, high, middle, done, error)
         if (allocated(error)) return
         if (.not. done) exit
         if (differ(middle, low)) then
            high = middle
         else
            low = middle
         end if
         is_one = corrector%metric%chord(low, high) <= narrow
         if (is_one) exit
      end do
      if (is_one) is_one = agree(corrector%metric, low, high)
      call system%set_parameter(ahead%p, error)
      if (allocated(error)) return
      allocate (r(system%n))
      call system%residual(ahead%x, r)
      call corrector%linear%prepare(system, done)
      is_one = is_one .and. done
   end subroutine goes_through

   !> The solution half-way, if it lies where the cubic has it and has an orientation.
   subroutine halve(corrector, system, low, high, middle, done, error)
      type(corrector_type), intent(inout) :: corrector
      class(parameter_system), intent(inout) :: system
      type(branch_point), intent(in) :: low, high
      type(branch_point), intent(out) :: middle
      logical, intent(out) :: done
      type(error_type), allocatable, intent(out) :: error
      type(branch_point) :: guess
      real(wp) :: length

      done = .false.
      length = corrector%metric%chord(low, high)
      middle = low
      call interpolate(corrector%metric, low, high, 0.5_wp, middle)
      guess = middle
      call corrector%correct(system, low, length, middle, error)
      if (allocated(error) .or. .not. middle%report%converged) return
      if (corrector%metric%chord(guess, middle) > beside*length) return
      call corrector%find_orientation(system, middle, error)
      if (allocated(error)) return
      done = middle%orientation /= 0
   end subroutine halve

   !> Whether the tangents of two points are those of one curve.
   pure logical function agree(metric, a, b)
      type(metric_type), intent(in) :: metric
      type(branch_point), intent(in) :: a, b

      agree = metric%inner(a%t_y, a%t_p, b%t_y, b%t_p) >= &
              along*metric%length(a%t_y, a%t_p)*metric%length(b%t_y, b%t_p)
   end function agree

end module fw_branch_crossing
