!> Options of analysis 'bounds' (group &bounds): of which quantity the range over all residual
!> tractions is looked for, and from how many of them.
module fw_bounds_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: from_to
   use fw_response_rows, only: quantity_words
   implicit none (type, external)
   private

   public :: bounds_options

   !> The centre and both ends of the gradient always are starts.
   integer, parameter :: fewest_starts = 3, most_starts = 1000

   type :: bounds_options
      !> As in quantity_words, of the first observed quantity or of the pairs.
      integer :: quantity = 1
      !> Residual tractions from which each end is looked for; those above the fewest are drawn.
      integer :: n_starts = 4
   contains
      procedure :: bind_keys
   end type bounds_options

contains

   !> The keys of group &bounds.
   subroutine bind_keys(self, keys)
      class(bounds_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('bounds', 'lowest and highest response over all residual tractions')
      call keys%bind_word(key('quantity', 'of the first observed quantity, or of all pairs'), &
                          self%quantity, quantity_words)
      call keys%bind(key('n_starts', &
                         'tractions to start from: centre, ends of the gradient, drawn corners', &
                         from_to(fewest_starts, most_starts)), self%n_starts)
   end subroutine bind_keys

end module fw_bounds_options
