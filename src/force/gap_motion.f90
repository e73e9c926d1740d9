!> Gaps that change in harmonics of the response, as those of an obstacle that moves or is not
!> round: the gap of a pair has the part Re(a exp(i n tau)) of harmonics n > 0 beside its constant.
module fw_gap_motion
   use fw_contact_data, only: contact_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: gap_motion, take_gap_motion

   !> What is added to the constant gaps of the pairs.
   type :: gap_motion
      !> Harmonics above 0 (n_harmonics), and complex amplitudes a = cosine - i sine [length]
      !> (n_pairs, n_harmonics).
      integer, allocatable :: harmonic(:)
      complex(wp), allocatable :: amplitude(:, :)
   contains
      procedure :: add_to
      procedure :: add_to_row
      procedure :: at_angle
      procedure :: slope_at
      procedure :: amplitude_of
      procedure :: work_of
      procedure :: swing
   end type gap_motion

contains

   !> Of the pairs of a case; not allocated where their gaps stand still.
   pure subroutine take_gap_motion(contact, motion)
      type(contact_type), intent(in) :: contact
      type(gap_motion), allocatable, intent(out) :: motion

      if (.not. allocated(contact%gap_harmonic)) return
      if (size(contact%gap_harmonic) == 0) return
      allocate (motion)
      motion%harmonic = contact%gap_harmonic
      motion%amplitude = cmplx(contact%gap_cosine, -contact%gap_sine, wp)
   end subroutine take_gap_motion

   !> Add the gaps to the coefficients of the openings of the pairs.
   pure subroutine add_to(self, fourier, opening)
      class(gap_motion), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> (n_pairs, n_coefficients) [length].
      real(wp), intent(inout) :: opening(:, :)
      integer :: h, j, k

      do j = 1, size(self%harmonic)
         h = findloc(fourier%harmonic, self%harmonic(j), dim=1)
         if (h == 0) cycle
         k = fourier%column(h)
         opening(:, k) = opening(:, k) + real(self%amplitude(:, j), wp)
         opening(:, k + 1) = opening(:, k + 1) - aimag(self%amplitude(:, j))
      end do
   end subroutine add_to

   !> The same of one pair, in coefficients of all harmonics (0, c1, s1, c2, s2, ..).
   pure subroutine add_to_row(self, pair, opening)
      class(gap_motion), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(inout) :: opening(:)
      integer :: j

      do j = 1, size(self%harmonic)
         associate (a => self%amplitude(pair, j), n => self%harmonic(j))
            if (2*n + 1 > size(opening)) cycle
            opening(2*n) = opening(2*n) + real(a, wp)
            opening(2*n + 1) = opening(2*n + 1) - aimag(a)
         end associate
      end do
   end subroutine add_to_row

   !> What is added to the gap of a pair at an angle [rad].
   pure real(wp) function at_angle(self, pair, tau) result(gap)
      class(gap_motion), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(in) :: tau
      integer :: j

      gap = 0.0_wp
      do j = 1, size(self%harmonic)
         associate (a => self%amplitude(pair, j), n => self%harmonic(j))
            gap = gap + real(a, wp)*cos(n*tau) - aimag(a)*sin(n*tau)
         end associate
      end do
   end function at_angle

   !> Its derivative by the angle.
   pure real(wp) function slope_at(self, pair, tau) result(slope)
      class(gap_motion), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(in) :: tau
      integer :: j

      slope = 0.0_wp
      do j = 1, size(self%harmonic)
         associate (a => self%amplitude(pair, j), n => self%harmonic(j))
            slope = slope - n*(real(a, wp)*sin(n*tau) + aimag(a)*cos(n*tau))
         end associate
      end do
   end function slope_at

   !> Its complex amplitude in a harmonic.
   pure complex(wp) function amplitude_of(self, pair, harmonic) result(a)
      class(gap_motion), intent(in) :: self
      integer, intent(in) :: pair, harmonic
      integer :: j

      a = (0.0_wp, 0.0_wp)
      j = findloc(self%harmonic, harmonic, dim=1)
      if (j > 0) a = self%amplitude(pair, j)
   end function amplitude_of

   !> Work of the normal forces along the motion of the gaps over a period,
   !> sum_n pi n (lambda_c g_s - lambda_s g_c) (n_pairs).
   pure function work_of(self, fourier, force) result(work)
      class(gap_motion), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Normal forces (n_pairs, n_coefficients).
      real(wp), intent(in) :: force(:, :)
      real(wp) :: work(size(force, 1))
      integer :: h, j, k

      work = 0.0_wp
      do j = 1, size(self%harmonic)
         h = findloc(fourier%harmonic, self%harmonic(j), dim=1)
         if (h == 0) cycle
         k = fourier%column(h)
         work = work + pi*self%harmonic(j)*(-force(:, k)*aimag(self%amplitude(:, j)) - &
                                            force(:, k + 1)*real(self%amplitude(:, j), wp))
      end do
   end function work_of

   !> How far the gap of each pair departs from its constant at most (n_pairs) [length].
   pure function swing(self)
      class(gap_motion), intent(in) :: self
      real(wp) :: swing(size(self%amplitude, 1))

      swing = sum(abs(self%amplitude), dim=2)
   end function swing

end module fw_gap_motion
