!> What follows from the curve of a nonlinear mode: responses near its resonance, and limit cycles,
!> amplitudes at which its self-excitation vanishes, so that the motion keeps itself alive.
module fw_mode_cycles
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_mode_group, only: mode_row, mode_table
   use fw_nonlinear_mode, only: mode_path
   use fw_newton, only: solver_report
   implicit none (type, external)
   private

   public :: cycle_finder, synthesize

   type :: cycle_finder
      !> Ends of intervals of ln A in which the self-excitation vanishes, with their unknowns
      !> (n, 2) one after the other.
      real(wp), allocatable :: bracket(:, :), bracket_y(:, :)
      !> ln A of the last row with damping, and its unknowns.
      real(wp) :: last_p = 0.0_wp
      real(wp), allocatable :: last_y(:)
   contains
      procedure :: note
      procedure :: find
   end type cycle_finder

   !> The self-excitation of a limit cycle, over its frequency, and halvings to get there.
   real(wp), parameter :: no_excitation = 1.0e-13_wp
   integer, parameter :: most_trials = 60
   !> Self-excitation over the frequency that is none.
   real(wp), parameter :: no_damping = 1.0e-9_wp

contains

   !> Keep two rows between which the self-excitation changes its sign.
   subroutine note(self, row, y)
      class(cycle_finder), intent(inout) :: self
      type(mode_row), intent(in) :: row
      real(wp), intent(in) :: y(:)
      integer :: n

      n = size(y)
      if (.not. allocated(self%bracket)) allocate (self%bracket(2, 0), self%bracket_y(n, 0))
      ! Round-off of an undamped mode has no sign.
      if (abs(row%self_excitation) <= no_damping*row%omega) return
      if (allocated(self%last_y)) then
         if (self%last_y(n)*y(n) < 0.0_wp .and. row%converged) then
            self%bracket = reshape([self%bracket, self%last_p, log(row%amplitude)], &
                                    [2, size(self%bracket, 2) + 1])
            self%bracket_y = reshape([self%bracket_y, self%last_y, y], &
                                      [n, size(self%bracket_y, 2) + 2])
         end if
      end if
      self%last_p = log(row%amplitude)
      self%last_y = y
   end subroutine note

   !> Where the self-excitation vanishes the motion keeps itself alive: false position with
   !> halvings of the weight (Illinois), each value of the self-excitation a solution.
   subroutine find(self, path, table, error)
      class(cycle_finder), intent(in) :: self
      type(mode_path), intent(inout) :: path
      type(mode_table), intent(inout) :: table
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      if (.not. allocated(self%bracket)) return
      do k = 1, size(self%bracket, 2)
         call find_cycle(path, self%bracket(:, k), self%bracket_y(:, 2*k - 1:2*k), table, error)
         if (allocated(error)) return
      end do
   end subroutine find

   subroutine find_cycle(path, ends, ends_y, table, error)
      type(mode_path), intent(inout) :: path
      real(wp), intent(in) :: ends(2), ends_y(:, :)
      type(mode_table), intent(inout) :: table
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report
      real(wp) :: p(2), y(size(ends_y, 1), 2), trial(size(ends_y, 1)), weight(2), share, middle
      integer :: k, n, side

      n = size(trial)
      p = ends
      y = ends_y
      weight = ends_y(n, :)
      do k = 1, most_trials
         share = weight(1)/(weight(1) - weight(2))
         middle = p(1) + share*(p(2) - p(1))
         trial = y(:, 1) + share*(y(:, 2) - y(:, 1))
         call path%solve(middle, trial, report, error)
         ! A bracket across a jump of the curve has no limit cycle in it.
         if (allocated(error) .or. .not. report%converged) return
         if (abs(trial(n)) <= no_excitation*trial(n - 1) .or. &
             abs(p(2) - p(1)) <= epsilon(1.0_wp)*max(1.0_wp, abs(middle))) exit
         ! The new point takes the end of its sign; the other counts half where it stays again.
         side = merge(1, 2, trial(n)*y(n, 1) > 0.0_wp)
         if (k > 1 .and. weight(side)*y(n, side) > 0.0_wp .and. &
             abs(weight(side) - y(n, side)) <= 0.0_wp) weight(3 - side) = 0.5_wp*weight(3 - side)
         p(side) = middle
         y(:, side) = trial
         weight(side) = trial(n)
      end do
      ! Stable where damping grows with the amplitude.
      call table%add_cycle(exp(middle), path%mode%system%frequency_unit*trial(n - 1), &
                           (ends_y(n, 2) - ends_y(n, 1))*(ends(2) - ends(1)) > 0.0_wp)
   end subroutine find_cycle

   !> Responses of one mode: P^2 = a^2 ((omega^2 - W^2)^2 + (2 zeta omega W)^2), which for each
   !> amplitude a has two frequencies W, or none.
   subroutine synthesize(scales, table)
      !> Factors of the load; not allocated where nothing is asked for.
      real(wp), allocatable, intent(in) :: scales(:)
      type(mode_table), intent(inout) :: table
      real(wp) :: centre, half, force, zeta
      integer :: j, k

      if (.not. allocated(scales) .or. table%n == 0) return
      table%scale = scales
      allocate (table%response_omega(2, table%n, size(table%scale)), &
                source=ieee_value(1.0_wp, ieee_quiet_nan))
      do j = 1, size(table%scale)
         do k = 1, table%n
            associate (row => table%row(k))
               zeta = 0.5_wp*row%self_excitation/row%omega
               force = table%scale(j)*row%force/row%modal_amplitude
               half = force**2 - 4.0_wp*zeta**2*row%omega**4*(1.0_wp - zeta**2)
               if (half < 0.0_wp) cycle
               half = sqrt(half)
               centre = row%omega**2*(1.0_wp - 2.0_wp*zeta**2)
               if (centre - half > 0.0_wp) table%response_omega(1, k, j) = sqrt(centre - half)
               if (centre + half > 0.0_wp) table%response_omega(2, k, j) = sqrt(centre + half)
            end associate
         end do
      end do
   end subroutine synthesize

end module fw_mode_cycles
