!> Group /bounds of a result file: the lowest and the highest response of each frequency over the
!> residual tractions of the pairs.
module fw_bounds_group
   use fw_kinds, only: wp
   use fw_response_rows, only: dissipation, quantity_words, wear_volume
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: bounds_group

   type, extends(result_group) :: bounds_group
      !> As in quantity_words.
      integer :: quantity = 1
      !> Lowest, highest and central value (3, n_points); NaN where the centre has no solution.
      real(wp), allocatable :: range(:, :)
      !> Shares at the lowest and the highest value (n_pairs, 2, n_points).
      real(wp), allocatable :: residual(:, :, :)
      !> Responses that were solved and that could not be (2, n_points).
      integer, allocatable :: counts(:, :)
   contains
      procedure :: write => write_bounds
   end type bounds_group

contains

   subroutine write_bounds(self, to)
      class(bounds_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      character(*), parameter :: of_pairs = 'point pair'
      character(8) :: unit
      real(wp), allocatable :: shares(:, :)

      unit = '<length>'
      if (self%quantity == dissipation) unit = '<energy>'
      if (self%quantity == wear_volume) unit = '<volume>'
      call to%put('/bounds/lowest', self%range(1, :), unit, 'point', &
                  'lowest value over the residual tractions')
      call to%put('/bounds/highest', self%range(2, :), unit, 'point', &
                  'highest value over the residual tractions')
      call to%put('/bounds/centre', self%range(3, :), unit, 'point', &
                  'value at residual tractions in the middle')
      shares = self%residual(:, 1, :)
      call to%put('/bounds/residual_lowest', shares, '1', of_pairs, &
                  'residual tractions of the lowest value, -1 to 1')
      shares = self%residual(:, 2, :)
      call to%put('/bounds/residual_highest', shares, '1', of_pairs, &
                  'residual tractions of the highest value, -1 to 1')
      call to%put('/bounds/solved', self%counts(1, :), '', 'point', &
                  'responses that were solved, the centre among them')
      call to%put('/bounds/failed', self%counts(2, :), '', 'point', &
                  'residual tractions behind a fold of the response, or without a solution, '// &
                  'which are no ends')
      call to%note('/', 'bounds_quantity', trim(quantity_words(self%quantity)))
   end subroutine write_bounds

end module fw_bounds_group
