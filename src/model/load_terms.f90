!> Loads on single dofs in harmonics of the response, as the keys term_... of group &load give them:
!>
!>   amplitude (n omega)**power cos(n omega t + phase)   on a dof,
!>
!> n being the harmonic, or an engine order over the greatest common divisor of all orders: omega is
!> that divisor times the speed then.
module fw_load_terms
   use fw_divisor, only: common_divisor
   use fw_key, only: key, key_visitor
   use fw_key_range, only: side_numbers, from_to
   use fw_kinds, only: pi, wp
   use fw_load_waves, only: load_waves
   use fw_side, only: add_side
   implicit none (type, external)
   private

   public :: load_terms, add_wave, harmonics_from_orders, turned

   !> More terms, a higher harmonic or a higher power are taken for a mistake.
   integer, parameter :: most_terms = 1000000, most_harmonic = 100000, most_power = 9

   !> Loads as a case gives them, by harmonic or engine order.
   type :: load_terms
      integer :: n_terms = 0
      !> Signed dofs; harmonics or orders, and powers of the frequency (n_terms).
      integer, allocatable :: dof(:), harmonic(:), order(:), power(:)
      !> Amplitudes [force s**power] and phases [degrees] (n_terms).
      real(wp), allocatable :: amplitude(:), phase(:)
      !> Greatest common divisor of the orders; 0 where there are none.
      integer :: fundamental = 0
   contains
      procedure :: bind_keys
      procedure :: take_orders
      procedure :: add_to
   end type load_terms

contains

   !> Within group &load. The order of a term takes the place of its harmonic.
   subroutine bind_keys(self, keys, by_order)
      class(load_terms), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether orders are given.
      logical, intent(in) :: by_order
      logical :: needed

      call keys%bind(key('n_terms', 'further loads on single dofs, in any harmonic', &
                         from_to(0, most_terms)), self%n_terms)
      call keys%set_size('n_terms', self%n_terms)
      needed = self%n_terms > 0
      call keys%bind(key('term_dof', 'dof, or n_dof and a row; negative: turned', side_numbers(), &
                         shape='n_terms', absent='required with n_terms'), self%dof, needed)
      call keys%bind(key('term_harmonic', 'harmonic, 0 to n_harmonics', &
                         from_to(0, most_harmonic), shape='n_terms', &
                         absent='1, or by term_order'), self%harmonic)
      call keys%bind(key('term_order', &
                         'in place of harmonics: the frequency is their greatest common '// &
                         'divisor times the speed', from_to(1, most_harmonic), shape='n_terms', &
                         absent='term_harmonic'), self%order, needed .and. by_order)
      call keys%bind(key('term_amplitude', 'over the frequency to term_power', unit='F', &
                         shape='n_terms', absent='required with n_terms'), self%amplitude, needed)
      call keys%bind(key('term_phase', 'of cos(n omega t + phase)', unit='degrees', &
                         shape='n_terms'), self%phase, default=0.0_wp)
      call keys%bind(key('term_power', 'of the frequency of the term [rad/s]; 2: unbalance', &
                         from_to(0, most_power), shape='n_terms'), self%power, default=0)
   end subroutine bind_keys

   !> Harmonics from orders, or 1 where neither is given.
   pure subroutine take_orders(self)
      class(load_terms), intent(inout) :: self

      call harmonics_from_orders(self%n_terms, self%order, self%harmonic, self%fundamental)
   end subroutine take_orders

   !> Harmonics of terms: orders over their greatest common divisor; 1 where neither is given.
   pure subroutine harmonics_from_orders(n_terms, order, harmonic, fundamental)
      integer, intent(in) :: n_terms
      !> (n_terms); not allocated where harmonics are given, or nothing.
      integer, allocatable, intent(in) :: order(:)
      integer, allocatable, intent(inout) :: harmonic(:)
      !> The divisor; 0 where there are no orders.
      integer, intent(out) :: fundamental
      integer :: i

      fundamental = 0
      if (allocated(order)) then
         do i = 1, size(order)
            fundamental = common_divisor(fundamental, order(i))
         end do
         harmonic = order/max(fundamental, 1)
      else if (.not. allocated(harmonic)) then
         allocate (harmonic(n_terms), source=1)
      end if
   end subroutine harmonics_from_orders

   !> Add the terms to the static load and to the waves.
   pure subroutine add_to(self, static, waves, columns, rows)
      class(load_terms), intent(in) :: self
      !> (n_dof).
      real(wp), intent(inout) :: static(:)
      type(load_waves), intent(inout) :: waves
      !> Cosine and sine parts of the waves (n_dof, 2 n_waves).
      real(wp), allocatable, intent(inout) :: columns(:, :)
      !> Of the model, as in fw_side.
      real(wp), intent(in), optional :: rows(:, :)
      real(wp) :: part(2)
      integer :: i, k, w

      do i = 1, self%n_terms
         part = self%amplitude(i)*turned(self%phase(i))
         if (self%harmonic(i) == 0) then
            call add_side(self%dof(i), part(1), static, rows)
            cycle
         end if
         w = waves%place(self%harmonic(i), self%power(i))
         if (w == 0) then
            call add_wave(self%harmonic(i), self%power(i), size(static), waves, columns)
            w = waves%n_waves()
         end if
         do k = 1, 2
            call add_side(self%dof(i), part(k), columns(:, 2*w - 2 + k), rows)
         end do
      end do
   end subroutine add_to

   !> One wave more, without load.
   pure subroutine add_wave(harmonic, power, n_dof, waves, columns)
      integer, intent(in) :: harmonic, power, n_dof
      type(load_waves), intent(inout) :: waves
      real(wp), allocatable, intent(inout) :: columns(:, :)
      real(wp), allocatable :: wider(:, :)
      integer :: n

      n = waves%n_waves()
      if (n == 0) then
         waves%harmonic = [harmonic]
         waves%power = [power]
         if (allocated(columns)) deallocate (columns)
         allocate (columns(n_dof, 2), source=0.0_wp)
         return
      end if
      waves%harmonic = [waves%harmonic, harmonic]
      waves%power = [waves%power, power]
      allocate (wider(n_dof, 2*n + 2), source=0.0_wp)
      wider(:, :2*n) = columns
      call move_alloc(wider, columns)
   end subroutine add_wave

   !> Cosine and sine part of cos(tau + phase), exact at right angles.
   pure function turned(phase) result(part)
      !> [degrees]
      real(wp), intent(in) :: phase
      real(wp) :: part(2)
      real(wp) :: angle

      angle = modulo(phase, 360.0_wp)
      if (abs(modulo(angle, 90.0_wp)) <= 0.0_wp) then
         select case (nint(angle/90.0_wp))
         case (1)
            part = [0.0_wp, -1.0_wp]
         case (2)
            part = [-1.0_wp, 0.0_wp]
         case (3)
            part = [0.0_wp, 1.0_wp]
         case default ! a whole turn
            part = [1.0_wp, 0.0_wp]
         end select
         return
      end if
      part = [cos(angle*pi/180.0_wp), -sin(angle*pi/180.0_wp)]
   end function turned

end module fw_load_terms
