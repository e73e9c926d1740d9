!> The waves on the cells of a uniform grid over the period, for pairs with two tangential
!> directions: at the nodes - the ends of the cells and their middles - and at the two Gauss points
!> of every half of a cell. They are the same for all pairs.
module fw_event_cells
   use fw_event_polynomial, only: fill_waves
   use fw_event_rotation, only: gauss_point
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: cells_type, new_cells, waves_at

   type :: cells_type
      !> Highest harmonic, cells in the period, and waves that are retained (parity may leave some
      !> out).
      integer :: degree = 0, n_cells = 0, n_coefficients = 0
      !> Width of half a cell.
      real(wp) :: half = 0.0_wp
      !> Waves at the nodes (n_coefficients, 2 n_cells), node 2k - 1 being the start of cell k.
      real(wp), allocatable :: node(:, :)
      !> Waves and their slopes at the Gauss points (n_coefficients, point, 2 n_cells).
      real(wp), allocatable :: gauss(:, :, :), gauss_slope(:, :, :)
      !> Weights of the waves in the coefficients (n_coefficients).
      real(wp), allocatable :: weight(:)
      !> cos(m tau) and sin(m tau) at the nodes, m = 0..2 degree (0:2 degree, 2 n_cells).
      real(wp), allocatable :: cosine(:, :), sine(:, :)
      !> Harmonics and their columns, as fourier_type has them.
      integer :: n_retained = 0
      integer, allocatable :: harmonic(:), column(:)
   contains
      procedure :: node_angle
   end type cells_type

contains

   !> The object holds some 10 n_coefficients n_cells numbers, once for all pairs.
   pure type(cells_type) function new_cells(fourier) result(self)
      !> Its instants are the ends of the cells.
      type(fourier_type), intent(in) :: fourier
      real(wp), allocatable :: unused(:)
      integer :: i, j, n

      self%degree = maxval(fourier%harmonic)
      self%n_cells = fourier%n_time
      self%n_coefficients = fourier%n_coefficients
      self%half = pi/real(self%n_cells, wp)
      self%n_retained = fourier%n_retained
      self%harmonic = fourier%harmonic
      self%column = fourier%column
      n = 2*self%n_cells
      allocate (unused(self%n_coefficients), self%weight(self%n_coefficients))
      allocate (self%node(self%n_coefficients, n))
      allocate (self%gauss(self%n_coefficients, 2, n), self%gauss_slope(self%n_coefficients, 2, n))
      allocate (self%cosine(0:2*self%degree, n), self%sine(0:2*self%degree, n))
      ! A coefficient is 1/pi times the integral against its wave, that of the constant 1/(2 pi).
      self%weight = 1.0_wp/pi
      if (fourier%has_constant()) self%weight(1) = 0.5_wp/pi
      do j = 1, n
         call waves_at(self, self%node_angle(j), self%node(:, j), unused)
         ! Up to twice the degree: products of two waves are integrated.
         call fill_waves(2*self%degree, self%node_angle(j), self%cosine(:, j), self%sine(:, j))
         do i = 1, 2
            call waves_at(self, self%node_angle(j) + gauss_point(i)*self%half, &
                          self%gauss(:, i, j), self%gauss_slope(:, i, j))
         end do
      end do
      ! At the starts of cells to the last bit what the transform takes, so that a force sampled
      ! there is that of the balance.
      self%node(:, ::2) = fourier%synthesis
   end function new_cells

   !> Angle of a node; node 2 n_cells + 1 is the end of the period.
   elemental real(wp) function node_angle(self, node)
      class(cells_type), intent(in) :: self
      integer, intent(in) :: node

      node_angle = pi*real(node - 1, wp)/real(self%n_cells, wp)
   end function node_angle

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

end module fw_event_cells
