!> One period of the pairs that dissipate most: what a picture of a peak draws.
module fw_pair_cycle
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: pair_cycle, busiest_pairs, thinned

   !> Pairs that are kept, and instants of a period above which every second is left out, and so on.
   integer, parameter :: most_pairs = 6, most_instants = 512

   type :: pair_cycle
      !> Their numbers, those that dissipate most first (n_kept).
      integer, allocatable :: pair(:)
      !> Relative displacements and contact forces, as the law gives them (3, n_kept, n_time).
      real(wp), allocatable :: displacement(:, :, :), force(:, :, :)
   end type pair_cycle

contains

   !> The pairs of the largest friction energy, in that order; of equal ones the first.
   pure function busiest_pairs(dissipation) result(pair)
      !> Per cycle (n_pairs).
      real(wp), intent(in) :: dissipation(:)
      integer, allocatable :: pair(:)
      logical :: is_left(size(dissipation))
      integer :: i, n

      n = min(most_pairs, size(dissipation))
      allocate (pair(n))
      is_left = .true.
      do i = 1, n
         pair(i) = maxloc(dissipation, dim=1, mask=is_left)
         ! No energy that is a number: the first that is left.
         if (pair(i) == 0) pair(i) = findloc(is_left, .true., dim=1)
         is_left(pair(i)) = .false.
      end do
   end function busiest_pairs

   !> Every how many instants of a period are kept: they stay evenly spaced.
   pure integer function thinned(n_time, least) result(stride)
      !> Instants that there are, and that have to stay.
      integer, intent(in) :: n_time, least

      associate (most => max(most_instants, least))
         stride = max(1, (n_time + most - 1)/most)
      end associate
      do while (modulo(n_time, stride) > 0)
         stride = stride + 1
      end do
      ! A number that nothing divides so keeps all of its instants.
      if (n_time/stride < least) stride = 1
   end function thinned

end module fw_pair_cycle
