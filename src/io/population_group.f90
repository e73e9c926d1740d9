!> Group /population of a result file: the largest amplitude of each disk over its blades and the
!> sweep.
module fw_population_group
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: population_group

   type, extends(result_group) :: population_group
      !> Largest amplitude, sector from 0 (-1: none was solved), frequency, ratio to the tuned disk
      !> (n_observed, n_patterns).
      real(wp), allocatable :: amplitude(:, :), omega(:, :), amplification(:, :)
      integer, allocatable :: sector(:, :)
      !> Of the tuned disk (n_observed).
      real(wp), allocatable :: tuned(:)
      !> Points that converged, and those that were solved for (n_patterns).
      integer, allocatable :: converged(:), solved(:)
   contains
      procedure :: write => write_population
   end type population_group

contains

   subroutine write_population(self, to)
      class(population_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      character(*), parameter :: of_all = 'pattern observed'

      call to%put('/population/amplitude', self%amplitude, '<length>', of_all, &
                  'largest amplitude over the blades and the sweep')
      call to%put('/population/sector', self%sector, '', of_all, 'its sector, from 0')
      call to%put('/population/omega', self%omega, 'rad/s', of_all, 'its frequency')
      call to%put('/population/amplification', self%amplification, '1', of_all, &
                  'amplitude over that of the tuned disk')
      call to%put('/population/tuned', self%tuned, '<length>', 'observed', &
                  'largest amplitude of the tuned disk over the sweep')
      call to%put('/population/converged', self%converged, '', 'pattern', &
                  'points that were solved')
      call to%put('/population/solved', self%solved, '', 'pattern', &
                  'points that were asked for, maxima between the rows among them')
   end subroutine write_population

end module fw_population_group
