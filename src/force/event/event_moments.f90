!> Moments of a piecewise constant weight chi over the period, and what follows from them exactly:
!>
!>   C_m = int chi cos(m tau),   S_m = int chi sin(m tau),   m = 0..2 degree.
!>
!> The projection of chi p on the waves, p a trigonometric polynomial, is the product of p with the
!> Gram matrix of the waves under chi, a Toeplitz plus a Hankel matrix of the moments:
!>
!>   int chi cos j cos k = (C_(k-j) + C_(k+j))/2,   int chi sin j sin k = (C_(k-j) - C_(k+j))/2,
!>   int chi sin j cos k = (S_(k+j) - S_(k-j))/2.
!>
!> Moments are stored for m = -2 degree..2 degree: C even, S odd.
module fw_event_moments
   use fw_kinds, only: pi, wp
   use fw_wave_sums, only: add_wave_products
   implicit none (type, external)
   private

   public :: moments_type

   type :: moments_type
      integer :: degree = 0
      !> (-2 degree:2 degree).
      real(wp), allocatable :: cosine(:), sine(:)
   contains
      procedure :: reserve
      procedure :: clear
      procedure :: add_step
      procedure :: add_ramp
      procedure :: finish
      procedure :: set
      procedure :: project
      procedure :: pairing
      procedure :: add_gram
   end type moments_type

contains

   !> Moments up to twice the degree: products of two waves have no more.
   pure subroutine reserve(self, degree)
      class(moments_type), intent(inout) :: self
      integer, intent(in) :: degree

      ! The storage includes the mirror images, so that the kernels need no case for k - j < 0.
      self%degree = degree
      allocate (self%cosine(-2*degree:2*degree), self%sine(-2*degree:2*degree), source=0.0_wp)
   end subroutine reserve

   !> Back to nothing gathered, with the same room.
   pure subroutine clear(self)
      class(moments_type), intent(inout) :: self

      self%cosine = 0.0_wp
      self%sine = 0.0_wp
   end subroutine clear

   !> chi falls by `drop` at an angle whose waves are given: up to the factor 1/m of `finish`, that
   !> is all that an integral of waves takes from there.
   !> By parts, int chi cos(m tau) = -1/m int chi' sin(m tau): only the jumps of chi count.
   pure subroutine add_step(self, drop, angle, cosines, sines)
      class(moments_type), intent(inout) :: self
      real(wp), intent(in) :: drop, angle
      !> (0:2 degree).
      real(wp), intent(in) :: cosines(0:), sines(0:)
      integer :: m

      ! m = 0 has no such form: the integral of 1 is the sum of drop times angle.
      self%cosine(0) = self%cosine(0) + drop*angle
      do m = 1, 2*self%degree
         self%cosine(m) = self%cosine(m) + drop*sines(m)
         self%sine(m) = self%sine(m) - drop*cosines(m)
      end do
   end subroutine add_step

   !> chi is slope tau up to an angle; a start there takes the slope with the other sign.
   !> By parts once more, int tau cos(m tau) = (tau sin(m tau) + cos(m tau)/m)/m.
   pure subroutine add_ramp(self, slope, angle, cosines, sines)
      class(moments_type), intent(inout) :: self
      real(wp), intent(in) :: slope, angle
      !> (0:2 degree).
      real(wp), intent(in) :: cosines(0:), sines(0:)
      integer :: m

      self%cosine(0) = self%cosine(0) + 0.5_wp*slope*angle**2
      do m = 1, 2*self%degree
         self%cosine(m) = self%cosine(m) + slope*(angle*sines(m) + cosines(m)/m)
         self%sine(m) = self%sine(m) + slope*(sines(m)/m - angle*cosines(m))
      end do
   end subroutine add_ramp

   !> Divide by m and mirror, once all steps are in.
   pure subroutine finish(self)
      class(moments_type), intent(inout) :: self
      integer :: m

      do m = 1, 2*self%degree
         self%cosine(m) = self%cosine(m)/real(m, wp)
         self%sine(m) = self%sine(m)/real(m, wp)
         self%cosine(-m) = self%cosine(m)
         self%sine(-m) = -self%sine(m)
      end do
   end subroutine finish

   !> State the moments themselves: m = 0..2 degree.
   pure subroutine set(self, cosine, sine)
      class(moments_type), intent(inout) :: self
      real(wp), intent(in) :: cosine(0:), sine(0:)
      integer :: m

      self%sine(0) = 0.0_wp
      self%cosine(0) = cosine(0)
      do m = 1, 2*self%degree
         self%cosine(m) = cosine(m)
         self%sine(m) = sine(m)
         self%cosine(-m) = cosine(m)
         self%sine(-m) = -sine(m)
      end do
   end subroutine set

   !> Add factor times the Fourier coefficients of chi p (harmonic k in coefficient(column)).
   pure subroutine project(self, factor, p, n_retained, harmonic, column, coefficient)
      class(moments_type), intent(in) :: self
      !> Real factor that multiplies the whole weight, such as mu or a sign.
      real(wp), intent(in) :: factor
      !> (0:degree, cosine and sine).
      !> Those harmonics of p that are not retained are zero, but are read.
      real(wp), intent(in) :: p(0:self%degree, 2)
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> Added to: (n_coefficients).
      real(wp), intent(inout) :: coefficient(*)
      real(wp) :: on_cosine, on_sine
      integer :: h, j, k

      do h = 1, n_retained
         k = harmonic(h)
         on_cosine = 0.0_wp
         on_sine = 0.0_wp
         !$omp simd reduction(+:on_cosine, on_sine)
         do j = 0, self%degree
            on_cosine = on_cosine + p(j, 1)*(self%cosine(k - j) + self%cosine(k + j)) + &
                        p(j, 2)*(self%sine(k + j) - self%sine(k - j))
            on_sine = on_sine + p(j, 1)*(self%sine(k + j) + self%sine(k - j)) + &
                      p(j, 2)*(self%cosine(k - j) - self%cosine(k + j))
         end do
         ! 1/2 of the products of waves, 1/pi of the coefficients, half of it for the constant.
         if (k == 0) then
            coefficient(column(h)) = coefficient(column(h)) + 0.25_wp/pi*factor*on_cosine
         else
            coefficient(column(h)) = coefficient(column(h)) + 0.5_wp/pi*factor*on_cosine
            coefficient(column(h) + 1) = coefficient(column(h) + 1) + 0.5_wp/pi*factor*on_sine
         end if
      end do
   end subroutine project

   !> int chi p q.
   !> Both polynomials over 0..degree, not over the retained harmonics only: derivatives of
   !> predictions are among them.
   pure real(wp) function pairing(self, p, q)
      class(moments_type), intent(in) :: self
      real(wp), intent(in) :: p(0:self%degree, 2), q(0:self%degree, 2)
      integer :: j, k

      pairing = 0.0_wp
      do k = 0, self%degree
         do j = 0, self%degree
            pairing = pairing + &
               q(k, 1)*(p(j, 1)*(self%cosine(k - j) + self%cosine(k + j)) + &
                        p(j, 2)*(self%sine(k + j) - self%sine(k - j))) + &
               q(k, 2)*(p(j, 1)*(self%sine(k + j) + self%sine(k - j)) + &
                        p(j, 2)*(self%cosine(k - j) - self%cosine(k + j)))
         end do
      end do
      pairing = 0.5_wp*pairing
   end function pairing

   !> Add factor times the derivative of the coefficients of chi p by those of p: (input, output).
   pure subroutine add_gram(self, factor, n_retained, harmonic, column, gram)
      class(moments_type), intent(in) :: self
      real(wp), intent(in) :: factor
      !> Harmonic numbers and columns of the retained coefficients (fourier_type).
      integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
      !> (n_coefficients, n_coefficients), added to.
      real(wp), intent(inout), contiguous :: gram(:, :)

      ! 1/2 of the products of waves, 1/pi of the coefficients; half of it for the constant as
      ! output, as in `project`.
      call add_wave_products(n_retained, harmonic, column, 2*self%degree, 0.5_wp/pi*factor, &
                             self%cosine, self%sine, size(gram, 1), gram)
   end subroutine add_gram

end module fw_event_moments
