!> The waves on the cells of the period, for pairs with two tangential directions: at the points of
!> a step of slip (fw_event_stages) over each cell, and on the uniform instants that isolate the
!> roots of N. They are the same for all pairs.
module fw_event_cells
   use fw_event_polynomial, only: fill_waves
   use fw_event_stages, only: cosine_and_sine, n_points, new_rule, rule_type
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi, wp
   implicit none (type, external)
   private

   public :: cells_type, new_cells, waves_at, waves_of_step, instant_of

   !> Width of a cell times the highest harmonic, at most.
   ! Six Gauss points then integrate a wave of twice that harmonic to 1e-7, and they are near enough
   ! for no switch to hide between two.
   real(wp), parameter :: widest = 3.0_wp
   !> Cells at least, whatever the harmonics: R may vary more than they do.
   integer, parameter :: fewest = 4

   type :: cells_type
      !> The quadrature of a step.
      type(rule_type) :: rule
      !> Highest harmonic, cells in the period, and waves that are retained (parity may leave some
      !> out).
      integer :: degree = 0, n_cells = 0, n_coefficients = 0
      !> Width of a cell.
      real(wp) :: width = 0.0_wp
      !> Waves and their slopes at the points of the cells (n_points, n_cells, n_coefficients).
      real(wp), allocatable :: wave(:, :, :), slope(:, :, :)
      !> Instants, at least 4 degree, and waves there (n_coefficients, n_time).
      integer :: n_time = 0
      real(wp), allocatable :: instant(:, :)
      !> Weights of the waves in the coefficients (n_coefficients).
      real(wp), allocatable :: weight(:)
      !> cos(m tau) and sin(m tau) at the points, m = 0..2 degree (0:2 degree, n_points, n_cells).
      real(wp), allocatable :: cosine(:, :, :), sine(:, :, :)
      !> Harmonics and their columns, as fourier_type has them.
      integer :: n_retained = 0
      integer, allocatable :: harmonic(:), column(:)
   contains
      procedure :: start_of
   end type cells_type

contains

   !> The object holds some 70 n_coefficients n_cells numbers, once for all pairs.
   pure type(cells_type) function new_cells(fourier) result(self)
      !> Its instants isolate roots.
      type(fourier_type), intent(in) :: fourier
      real(wp) :: wave(fourier%n_coefficients), slope(fourier%n_coefficients), angle
      integer :: i, j

      self%rule = new_rule()
      self%degree = maxval(fourier%harmonic)
      self%n_time = fourier%n_time
      self%n_coefficients = fourier%n_coefficients
      self%n_retained = fourier%n_retained
      self%harmonic = fourier%harmonic
      self%column = fourier%column
      self%n_cells = max(fewest, ceiling(2.0_wp*pi*real(self%degree, wp)/widest))
      ! Forces that are fitted at the instants are wanted there with the order of the ends of steps.
      if (.not. fourier%projects) self%n_cells = self%n_time
      self%width = 2.0_wp*pi/real(self%n_cells, wp)
      allocate (self%weight(self%n_coefficients))
      allocate (self%wave(n_points, self%n_cells, self%n_coefficients))
      allocate (self%slope, mold=self%wave)
      allocate (self%cosine(0:2*self%degree, n_points, self%n_cells))
      allocate (self%sine, mold=self%cosine)
      self%instant = fourier%synthesis
      ! A coefficient is 1/pi times the integral against its wave, that of the constant 1/(2 pi).
      self%weight = 1.0_wp/pi
      if (fourier%has_constant()) self%weight(1) = 0.5_wp/pi
      do j = 1, self%n_cells
         do i = 1, n_points
            angle = self%start_of(j) + self%width*self%rule%place(i)
            call waves_at(self, angle, wave, slope)
            self%wave(i, j, :) = wave
            self%slope(i, j, :) = slope
            ! Up to twice the degree: products of two waves are integrated.
            call fill_waves(2*self%degree, angle, self%cosine(:, i, j), self%sine(:, i, j))
         end do
      end do
   end function new_cells

   !> Angle where a cell starts; cell n_cells + 1 is the end of the period.
   elemental real(wp) function start_of(self, cell)
      class(cells_type), intent(in) :: self
      integer, intent(in) :: cell

      start_of = instant_of(self%n_cells, cell)
   end function start_of

   !> Instant k of n.
   elemental real(wp) function instant_of(n, k)
      integer, intent(in) :: n, k

      instant_of = 2.0_wp*pi*(real(k - 1, wp)/real(n, wp))
   end function instant_of

   !> Waves of the coefficients and their slopes at any angle.
   pure subroutine waves_at(self, angle, wave, slope)
      class(cells_type), intent(in) :: self
      real(wp), intent(in) :: angle
      !> (n_coefficients).
      real(wp), intent(out) :: wave(:), slope(:)
      real(wp) :: c, s, c_1, s_1, c_next, n
      integer :: h, k, m

      ! By rotation from harmonic to harmonic: one sine and cosine a call. Harmonics that are not
      ! retained are passed through, since the recurrence needs them.
      c_1 = cos(angle)
      s_1 = sin(angle)
      c = 1.0_wp
      s = 0.0_wp
      m = 0
      do h = 1, self%n_retained
         do while (m < self%harmonic(h))
            c_next = c*c_1 - s*s_1
            s = s*c_1 + c*s_1
            c = c_next
            m = m + 1
         end do
         k = self%column(h)
         n = real(m, wp)
         wave(k) = c
         slope(k) = -n*s
         if (m == 0) cycle
         wave(k + 1) = s
         slope(k + 1) = n*c
      end do
   end subroutine waves_at

   !> The same at all points of a step anywhere (n_points, n_coefficients).
   pure subroutine waves_of_step(self, from, h, wave, slope)
      class(cells_type), intent(in) :: self
      real(wp), intent(in) :: from, h
      real(wp), intent(out) :: wave(:, :), slope(:, :)
      real(wp), dimension(n_points) :: c, s, c_1, s_1, c_next
      integer :: i, j, k, m

      call cosine_and_sine(from + h*self%rule%place, c_1, s_1)
      c = 1.0_wp
      s = 0.0_wp
      m = 0
      do i = 1, self%n_retained
         do while (m < self%harmonic(i))
            do j = 1, n_points
               c_next(j) = c(j)*c_1(j) - s(j)*s_1(j)
               s(j) = s(j)*c_1(j) + c(j)*s_1(j)
               c(j) = c_next(j)
            end do
            m = m + 1
         end do
         k = self%column(i)
         ! Points innermost: one instruction for all of them.
         do j = 1, n_points
            wave(j, k) = c(j)
            slope(j, k) = -m*s(j)
         end do
         if (m == 0) cycle
         do j = 1, n_points
            wave(j, k + 1) = s(j)
            slope(j, k + 1) = m*c(j)
         end do
      end do
   end subroutine waves_of_step

end module fw_event_cells
