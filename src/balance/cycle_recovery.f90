!> One period of the pairs that dissipate most, from a solution of the balance or from histories.
module fw_cycle_recovery
   use fw_balance_state, only: balance_state
   use fw_fourier, only: coefficient_count, fourier_type, new_fourier
   use fw_kinds, only: wp
   use fw_pair_cycle, only: busiest_pairs, thinned
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: recover_cycle, cycle_of_histories

   !> Instants where the forces are known at any.
   integer, parameter :: fine = 256

contains

   !> Of a point that has its contact, where the system was evaluated last.
   subroutine recover_cycle(system, m, q, point)
      type(balance_state), intent(inout) :: system
      !> Coordinates (m, n_coefficients).
      integer, intent(in) :: m
      real(wp), intent(in) :: q(m, *)
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: own(:, :, :), slip(:, :)
      type(fourier_type) :: instants
      integer :: n, n_pairs, i, k, stride

      if (.not. allocated(point%dissipation)) return
      allocate (point%cycle)
      point%cycle%pair = busiest_pairs(point%dissipation)
      n_pairs = size(point%cycle%pair)
      associate (work => system%work(system%problem%forces%pairs), kept => point%cycle, &
                 row => system%problem%joint%row, fourier => system%problem%fourier, &
                 law => system%problem%forces%entry(system%problem%forces%pairs)%law)
         n = fourier%n_time
         ! Between events forces are known at any instant.
         if (law%facts%follows_events) then
            n = max(n, fine)
            call move_alloc(work%force_time, own)
            allocate (work%force_time(size(own, 1), size(own, 2), n))
         end if
         call law%sample(work)
         stride = thinned(n, coefficient_count(maxval(fourier%harmonic)))
         n = n/stride
         allocate (kept%force(3, n_pairs, n))
         do k = 1, n
            do i = 1, n_pairs
               kept%force(:, i, k) = work%force_time(kept%pair(i), :, 1 + (k - 1)*stride)
            end do
         end do
         ! The workspace keeps its instants.
         if (allocated(own)) call move_alloc(own, work%force_time)
         allocate (slip(3*n_pairs, fourier%n_coefficients))
         call system%problem%incidence%gather(reshape(row(:, kept%pair), [3*n_pairs]), m, &
                                              fourier%n_coefficients, q, slip)
         instants = new_fourier(maxval(fourier%harmonic), n, .not. fourier%has_constant())
         kept%displacement = reshape(matmul(slip, instants%synthesis), [3, n_pairs, n])
      end associate
   end subroutine recover_cycle

   !> Of a point that has its contact and its histories.
   pure subroutine cycle_of_histories(point)
      type(point_type), intent(inout) :: point
      integer :: stride

      if (.not. (allocated(point%dissipation) .and. allocated(point%force_history))) return
      allocate (point%cycle)
      associate (kept => point%cycle)
         kept%pair = busiest_pairs(point%dissipation)
         stride = thinned(size(point%force_history, 3), size(point%coefficients, 1))
         kept%force = point%force_history(:, kept%pair, ::stride)
         kept%displacement = point%slip_history(:, kept%pair, ::stride)
      end associate
   end subroutine cycle_of_histories

end module fw_cycle_recovery
