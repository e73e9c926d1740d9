!> What tells that the motion of a mode is no longer the stuck one: a pair slides within the period,
!> or is open for another share of it than at rest.
!>
!> Where no pair has moved since the assembly shares of the period tell it to all digits. A pair
!> that was moved, and has come to rest where it just bears the motion, touches its limit without
!> sliding: instants count as slip there, and events find a share of round-off. There the sliding
!> itself tells, which is zero but for what the march leaves.
module fw_onset_departure
   use fw_error, only: error_type
   use fw_force_law, only: force_workspace
   use fw_kinds, only: wp
   use fw_mode_system, only: mode_system
   implicit none (type, external)
   private

   public :: onset_departure, evaluate_motion

   type :: onset_departure
      !> Shares of stick, slip and separation at rest (3, n_pairs).
      real(wp), allocatable :: rest(:, :)
      !> Friction coefficients: pairs without friction slide at every amplitude (n_pairs).
      real(wp), allocatable :: mu(:)
   contains
      procedure :: begin
      procedure :: at_every_amplitude
      procedure :: by_shares
      procedure :: by_sliding
   end type onset_departure

   !> Change of the shares of the period that is no round-off of the march.
   real(wp), parameter :: share_change = 1.0e-9_wp
   !> Sliding under pressure, over the square of the forces, that a march may leave.
   real(wp), parameter :: least_sliding = 1.0e-10_wp
   !> Share of slip that events may find where a pair touches its limit: of 1e-8 of the forces.
   real(wp), parameter :: least_share = 1.0e-4_wp

contains

   !> The shares of a motion near rest.
   subroutine begin(self, system, amplitude, y, mu)
      class(onset_departure), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      real(wp), intent(in) :: mu(:)

      self%mu = mu
      allocate (self%rest(3, size(mu)), source=0.0_wp)
      if (size(mu) == 0) return
      call evaluate_motion(system, amplitude, y)
      call system%balance%pair_shares(self%rest)
   end subroutine begin

   !> Whether a pair parts and meets in the smallest motion, or slips throughout: the joints of
   !> Iwan and of Bouc and Wen do.
   pure logical function at_every_amplitude(self)
      class(onset_departure), intent(in) :: self

      at_every_amplitude = any(self%rest(3, :) > share_change .and. &
                               self%rest(3, :) < 1.0_wp - share_change) .or. &
                           any(self%mu > 0.0_wp .and. self%rest(2, :) >= 1.0_wp - share_change)
   end function at_every_amplitude

   !> Largest change of a share from that at rest, where the system stands; none where it is
   !> round-off.
   real(wp) function by_shares(self, system) result(departed)
      class(onset_departure), intent(in) :: self
      type(mode_system), intent(in) :: system
      real(wp) :: share(3, size(self%rest, 2))

      departed = 0.0_wp
      if (size(share) == 0) return
      call system%balance%pair_shares(share)
      departed = maxval(abs(share - self%rest))
      if (departed <= share_change) departed = 0.0_wp
   end function by_shares

   !> The root of the largest sliding of a motion, or the change of the share in which a pair is
   !> open. Both grow like the root of what the amplitude exceeds the onset by.
   real(wp) function by_sliding(self, system, amplitude, y) result(departed)
      class(onset_departure), intent(in) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      real(wp) :: share(3, size(self%rest, 2)), sliding(size(self%rest, 2))

      departed = 0.0_wp
      if (size(share) == 0) return
      associate (forces => system%balance%problem%forces)
         if (.not. forces%entry(forces%pairs)%law%facts%measures_slip) then
            call evaluate_motion(system, amplitude, y)
            departed = self%by_shares(system)
            return
         end if
         call measure(system, amplitude, y, system%balance%work(forces%pairs), sliding)
      end associate
      call system%balance%pair_shares(share)
      share = abs(share - self%rest)
      departed = maxval(share(3, :))
      if (departed <= share_change) departed = 0.0_wp
      if (system%balance%problem%forces%entry(system%balance%problem%forces%pairs) &
          %law%facts%follows_events) then
         ! What slides with its mass slides by little at first.
         sliding = max(sliding, merge(share(2, :)**2, 0.0_wp, share(2, :) > least_share))
      end if
      sliding = merge(sliding, 0.0_wp, self%mu > 0.0_wp .and. sliding > least_sliding)
      departed = max(departed, sqrt(maxval(sliding)))
   end function by_sliding

   !> Sliding of each pair over the square of its forces.
   subroutine measure(system, amplitude, y, work, sliding)
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      !> That of the pairs.
      type(force_workspace), intent(inout) :: work
      real(wp), intent(out) :: sliding(:)

      ! Laws measure it where asked to; none of it is differentiated here.
      if (.not. allocated(work%slip)) call work%measure_slip()
      work%measures_slip = .true.
      work%differentiates_slip = .false.
      call evaluate_motion(system, amplitude, y)
      work%measures_slip = .false.
      call work%measure_scale()
      sliding = work%slip/max(work%scale, tiny(1.0_wp))**2
   end subroutine measure

   !> The balance of a motion.
   subroutine evaluate_motion(system, amplitude, y)
      type(mode_system), intent(inout) :: system
      real(wp), intent(in) :: amplitude, y(:)
      type(error_type), allocatable :: ignored
      real(wp) :: r(system%n), x(system%n)

      x = y
      call system%set_parameter(log(amplitude), ignored)
      call system%residual(x, r)
   end subroutine evaluate_motion

end module fw_onset_departure
