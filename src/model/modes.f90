!> Natural frequencies and damping of a linear structure, from M x = theta (K + s M) x: massless
!> dofs, and a stiffness that holds the structure only in part, are no exceptions.
module fw_modes
   use fw_kinds, only: wp
   use fw_linalg, only: has_pivots, solve_symmetric_above, solve_symmetric_eigen
   implicit none (type, external)
   private

   public :: mode_type, find_modes, least_width

   !> A linear mode: frequency, damping and shape.
   type :: mode_type
      !> Natural frequency [rad/s].
      real(wp) :: omega = 0.0_wp
      !> Width of its resonance at half of the power, c/m [rad/s]: 2 zeta omega; below 0 where the
      !> damping feeds it.
      real(wp) :: width = 0.0_wp
      !> Amplitude at resonance of every observed quantity under the vibratory load alone, bounded
      !> as if the width were no less than `least_width` (n_observed).
      real(wp), allocatable :: amplitude(:)
   end type mode_type

   !> Width that an undamped resonance counts with, as a part of its frequency: what a peak of a
   !> curve can be as good as undamped.
   real(wp), parameter :: least_width = 1.0e-6_wp
   !> Shifts that are tried, in parts of K over M.
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-3_wp, 1.0_wp]
   !> Dofs from which modes beyond the range are not computed, and what keeps one at its end.
   integer, parameter :: above_from = 100
   real(wp), parameter :: beyond = 1.0_wp - 1.0e-9_wp
   !> Eigenvalues below this part of the largest are massless directions: round-off.
   real(wp), parameter :: massless = 1.0e-13_wp

contains

   !> The modes with frequencies within a range; none where the pencil has no solution.
   subroutine find_modes(mass, damping, stiffness, load, observe, range, modes, loss)
      !> (n, n), symmetric.
      real(wp), intent(in) :: mass(:, :), damping(:, :), stiffness(:, :)
      !> Cosine and sine load (n, 2).
      real(wp), intent(in) :: load(:, :)
      !> Rows of observed quantities (n_observed, n).
      real(wp), intent(in) :: observe(:, :)
      !> Lowest and highest frequency [rad/s].
      real(wp), intent(in) :: range(2)
      type(mode_type), allocatable, intent(out) :: modes(:)
      !> Hysteretic damping in parts of the stiffness (default: none).
      real(wp), intent(in), optional :: loss
      real(wp), allocatable :: theta(:), shapes(:, :)
      real(wp) :: shift, square, part
      logical :: done
      integer, allocatable :: in_range(:)
      integer :: i, j, trial

      allocate (modes(0))
      allocate (in_range(0))
      do trial = merge(1, 2, has_pivots(stiffness)), size(shift_trials)
         shift = shift_trials(trial)*norm2(stiffness)/max(norm2(mass), tiny(1.0_wp))
         done = size(mass, 1) >= above_from .and. range(2) > 0.0_wp
         if (done) call solve_symmetric_above(mass, stiffness + shift*mass, &
                                              beyond/(range(2)**2 + shift), theta, shapes, done)
         if (.not. done) call solve_symmetric_eigen(mass, stiffness + shift*mass, theta, shapes, &
                                                    done)
         if (done) exit
      end do
      if (.not. done) return
      ! theta = 1/(omega**2 + shift), ascending: from the end omega rises, and massless directions,
      ! theta = 0, come last.
      do j = size(theta), 1, -1
         if (theta(j) <= massless*theta(size(theta))) exit
         square = 1.0_wp/theta(j) - shift
         if (square < range(1)**2 .or. square > range(2)**2 .or. square <= 0.0_wp) cycle
         in_range = [in_range, j]
      end do
      part = 0.0_wp
      if (present(loss)) part = loss
      deallocate (modes)
      allocate (modes(size(in_range)))
      do i = 1, size(in_range)
         j = in_range(i)
         ! x^T (K + shift M) x = 1, hence x^T M x = theta; over its root the modal mass is one.
         modes(i) = new_mode(sqrt(1.0_wp/theta(j) - shift), shapes(:, j)/sqrt(theta(j)), damping, &
                             part, load, observe)
      end do
   end subroutine find_modes

   !> A mode of unit modal mass.
   function new_mode(omega, shape_of, damping, loss, load, observe) result(mode)
      real(wp), intent(in) :: omega, shape_of(:), damping(:, :), loss, load(:, :), observe(:, :)
      type(mode_type) :: mode
      real(wp) :: drive

      mode%omega = omega
      mode%width = dot_product(shape_of, matmul(damping, shape_of)) + loss*omega
      drive = norm2(matmul(shape_of, load))
      ! U| = |o x| |x^T f|/(omega c) at resonance, with o the observed row and c the width.
      mode%amplitude = abs(matmul(observe, shape_of))*drive/ &
                       (omega*max(mode%width, least_width*omega))
   end function new_mode

end module fw_modes
