!> Response control (group &control): amplitudes that the response is to have, for which the
!> vibratory load is found.
module fw_control_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: control_options, of_first_harmonic, of_largest

   character(*), parameter :: of_words(*) = [character(14) :: 'first_harmonic', 'largest']
   integer, parameter :: of_first_harmonic = 1, of_largest = 2

   type :: control_options
      !> In the order in which they are gone through [length]; none where it is not allocated.
      real(wp), allocatable :: amplitude(:)
      !> Of which observed quantity.
      integer :: observed = 1
      !> What the amplitude is.
      integer :: of = of_first_harmonic
   contains
      procedure :: bind_keys
      procedure :: is_wanted
   end type control_options

contains

   !> The keys of group &control but for what is observed.
   subroutine bind_keys(self, keys)
      class(control_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('control', 'responses of given amplitudes')
      call keys%bind(key('amplitude', 'for which the load factor is found, one after the other', &
                         above(0.0_wp), unit='L', shape=':', repeats=.false., &
                         absent='none: the load is given', only="analysis = 'frf', 'point'"), &
                     self%amplitude)
      call keys%bind_word(key('of', 'of the first harmonic, or the largest of the period'), &
                          self%of, of_words)
   end subroutine bind_keys

   pure logical function is_wanted(self)
      class(control_options), intent(in) :: self

      is_wanted = allocated(self%amplitude)
   end function is_wanted

end module fw_control_options
