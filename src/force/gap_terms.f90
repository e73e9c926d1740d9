!> What an obstacle adds to gaps, as the keys gap_... of group &contact give it:
!>
!>   amplitude cos(n tau + phase)   of a pair, or of all,
!>
!> n being a harmonic of the response, or an order over the greatest common divisor of all orders.
module fw_gap_terms
   use fw_contact_data, only: contact_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: from_to
   use fw_kinds, only: wp
   use fw_load_terms, only: harmonics_from_orders, turned
   implicit none (type, external)
   private

   public :: gap_terms

   !> More terms, or a higher harmonic, are taken for a mistake.
   integer, parameter :: most_terms = 1000000, most_harmonic = 100000

   !> Gaps as a case gives them: harmonics or engine orders, amplitudes and phases.
   type :: gap_terms
      integer :: n_terms = 0
      !> Pairs, 0 for all; harmonics or orders (n_terms).
      integer, allocatable :: pair(:), harmonic(:), order(:)
      !> Amplitudes [length] and phases [degrees] (n_terms).
      real(wp), allocatable :: amplitude(:), phase(:)
      !> Greatest common divisor of the orders; 0 where there are none.
      integer :: fundamental = 0
   contains
      procedure :: bind_keys
      procedure :: take_orders
      procedure :: add_to
   end type gap_terms

contains

   !> Within group &contact. The order of a term takes the place of its harmonic.
   subroutine bind_keys(self, keys)
      class(gap_terms), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      logical :: needed

      call keys%bind(key('n_gap_terms', 'terms added to gap: obstacles that move or are uneven', &
                         from_to(0, most_terms)), self%n_terms)
      call keys%set_size('n_gap_terms', self%n_terms)
      needed = self%n_terms > 0
      call keys%bind(key('gap_pair', 'from 1; 0: all', from_to(0, most_terms), &
                         shape='n_gap_terms'), self%pair, default=0)
      call keys%bind(key('gap_harmonic', 'harmonic, 0 to n_harmonics', &
                         from_to(0, most_harmonic), shape='n_gap_terms', &
                         absent='1, or by gap_order'), self%harmonic)
      call keys%bind(key('gap_order', &
                         'in place of harmonics: the frequency is their greatest common '// &
                         'divisor times the speed', from_to(0, most_harmonic), &
                         shape='n_gap_terms', absent='gap_harmonic'), self%order)
      call keys%bind(key('gap_amplitude', 'widest at n tau = -gap_phase', unit='L', &
                         shape='n_gap_terms', absent='required with n_gap_terms'), self%amplitude, &
                     needed)
      call keys%bind(key('gap_phase', 'of cos(n tau + phase)', unit='degrees', &
                         shape='n_gap_terms'), self%phase, default=0.0_wp)
   end subroutine bind_keys

   !> Harmonics from orders, or 1 where neither is given.
   pure subroutine take_orders(self)
      class(gap_terms), intent(inout) :: self

      call harmonics_from_orders(self%n_terms, self%order, self%harmonic, self%fundamental)
   end subroutine take_orders

   !> Add the terms to the gaps of pairs that have a normal dof.
   pure subroutine add_to(self, has_normal, contact)
      class(gap_terms), intent(in) :: self
      !> (n_pairs).
      logical, intent(in) :: has_normal(:)
      type(contact_type), intent(inout) :: contact
      real(wp) :: share(contact%n_pairs), part(2)
      integer :: i

      do i = 1, self%n_terms
         share = 1.0_wp
         if (self%pair(i) > 0) then
            share = 0.0_wp
            share(self%pair(i)) = 1.0_wp
         end if
         where (.not. has_normal) share = 0.0_wp
         part = self%amplitude(i)*turned(self%phase(i))
         call contact%add_gap(self%harmonic(i), part(1)*share, part(2)*share)
      end do
   end subroutine add_to

end module fw_gap_terms
