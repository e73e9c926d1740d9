!> One period of the pairs that dissipate most, at the highest maximum of the first observed
!> quantity: kept without being asked for.
module fw_peak_cycle
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_interrupt, only: interrupt_type
   use fw_kinds, only: wp
   use fw_pair_cycle, only: pair_cycle
   use fw_peak, only: peak_type
   use fw_peak_finder, only: peak_finder
   use fw_point, only: point_type
   use fw_sinks, only: point_sink
   use fw_strategy, only: keeps_cycles, point_request, point_strategy
   implicit none (type, external)
   private

   public :: cycle_keeper

   !> Takes the rows that have such a period, and keeps that of the highest.
   type, extends(point_sink) :: cycle_keeper
      real(wp) :: omega = 0.0_wp, amplitude = -1.0_wp
      !> Not allocated where there is none.
      type(pair_cycle), allocatable :: cycle
   contains
      procedure :: take
      procedure :: solve_at_peak
   end type cycle_keeper

contains

   subroutine take(self, point, error)
      class(cycle_keeper), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      if (.not. (point%converged .and. allocated(point%cycle))) return
      if (size(point%amplitude) == 0) return
      if (point%amplitude(1) <= self%amplitude) return
      self%omega = point%omega
      self%amplitude = point%amplitude(1)
      self%cycle = point%cycle
   end subroutine take

   !> Solve once more at the highest maximum, from the solution that is known there.
   subroutine solve_at_peak(self, case, finder, strategy, interrupt, peaks, error)
      class(cycle_keeper), intent(inout) :: self
      type(case_type), intent(in) :: case
      type(peak_finder), intent(inout) :: finder
      class(point_strategy), intent(inout), target :: strategy
      class(interrupt_type), intent(in), target :: interrupt
      type(peak_type), intent(in) :: peaks(:)
      type(error_type), allocatable, intent(out) :: error
      type(point_request) :: request
      type(point_type) :: point
      real(wp) :: highest
      integer :: k
      logical :: found

      ! Rows have theirs already where points cannot be had again.
      if (keeps_cycles(case) .or. .not. case%output%contact) return
      if (case%contact%n_pairs == 0) return
      highest = 0.0_wp
      do k = 1, size(peaks)
         if (peaks(k)%observed /= 1 .or. peaks(k)%amplitude <= highest) cycle
         highest = peaks(k)%amplitude
         request%omega = peaks(k)%omega
      end do
      if (.not. highest > 0.0_wp) return
      call finder%go_to(request%omega, found)
      if (.not. found) return
      request%fallback = .false.
      request%contact = .true.
      request%cycle = .true.
      request%interrupt => interrupt
      call strategy%solve_in_time(case, request, point, error)
      if (.not. allocated(error)) call self%take(point, error)
   end subroutine solve_at_peak

end module fw_peak_cycle
