!> A contact pair whose side has mass, rubbing in one tangential direction: the law as a local
!> oscillator,
!>
!>   m x'' + c x' + k x + lambda = P,   lambda in Q Sgn(x'),   Q = mu N,
!>
!> followed from event to event until the period repeats (fw_oscillator_turn), and integrated
!> exactly. Where some position holds the pair through the whole period, every periodic motion is
!> such a position (two motions never move apart in m x'**2 + k x**2), and the one that slow
!> sweeping from the start leads to is taken: the play operator of fw_event_path, without mass.
module fw_oscillator_pair
   use fw_event_curves, only: curves_type
   use fw_event_pair, only: event_pair_type
   use fw_event_path, only: phase_open, phase_stick
   use fw_event_polynomial, only: differentiate, fill_waves
   use fw_kinds, only: pi, wp
   use fw_oscillator, only: oscillator_type
   use fw_oscillator_search, only: wave_type
   use fw_oscillator_turn, only: newton_step, side_of, turn_type, waves_type
   implicit none (type, external)
   private

   public :: oscillator_pair_type

   type, extends(event_pair_type) :: oscillator_pair_type
      !> What drives the mass; the segments of the last turn.
      type(waves_type) :: waves
      type(turn_type) :: turn
      !> Whether the path is that of the oscillator, not that of the play operator.
      logical :: swings = .false.
      !> Change of X over the last turn in the norm of the energy, as a part of the size of the
      !> motion; turns that were run.
      real(wp) :: drift = 0.0_wp
      integer :: n_turns = 0
      !> Waves on the grid (n_grid, 0:degree).
      real(wp), allocatable, private :: grid_cosine(:, :), grid_sine(:, :)
      !> Room for P - Q and their answers (0:degree, cosine and sine).
      real(wp), allocatable, private :: answer(:, :)
   contains
      procedure :: reserve_oscillator
      procedure :: follow => follow_oscillator
      procedure :: derivative => derivative_of_oscillator
      procedure :: friction_path
      procedure :: path_derivative => path_of_oscillator
   end type oscillator_pair_type

   interface
      !> See fw_oscillator_derivative.
      pure module subroutine derivative_of_oscillator(self, n_retained, harmonic, column, &
                                                      by_tangential, by_normal, normal)
         class(oscillator_pair_type), intent(inout) :: self
         integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
         real(wp), intent(inout) :: by_tangential(:, :), by_normal(:, :), normal(:, :)
      end subroutine derivative_of_oscillator

      pure module subroutine path_of_oscillator(self, n_retained, harmonic, column, &
                                                by_tangential, by_normal)
         class(oscillator_pair_type), intent(inout) :: self
         integer, intent(in) :: n_retained, harmonic(n_retained), column(n_retained)
         real(wp), intent(inout) :: by_tangential(:), by_normal(:)
      end subroutine path_of_oscillator

      !> The integral of e^(i n tau) times the velocity of a free motion, over X at its start.
      pure module subroutine integrate_wave(oscillator, n, a, b, phi, row)
         type(oscillator_type), intent(in) :: oscillator
         integer, intent(in) :: n
         !> From a to b, and Phi(b - a).
         real(wp), intent(in) :: a, b, phi(2, 2)
         complex(wp), intent(out) :: row(2)
      end subroutine integrate_wave

      pure module subroutine integrate_free(oscillator, curves, a, b, weight)
         type(oscillator_type), intent(in) :: oscillator
         type(curves_type), intent(in) :: curves
         real(wp), intent(in) :: a, b
         real(wp), intent(out) :: weight(2)
      end subroutine integrate_free
   end interface

   !> Angles of the grid for each wave of the highest harmonic, and at least.
   integer, parameter :: grid_per_harmonic = 8, least_grid = 16
   !> Turns without Newton's method first, and all.
   ! Plain turns shed what the start has of fast decay; Newton's method ends slow decay.
   integer, parameter :: plain_turns = 2, max_turns = 400
   !> Change of X over a turn that counts as none, as a part of the motion, and that below which a
   !> turn that brings no improvement shows round-off.
   real(wp), parameter :: periodic = 1.0e-15_wp, near_round_off = 1.0e-11_wp
   !> Part of the change that a step of Newton's method may leave.
   ! Else plain turns, which never move two motions apart, are the surer way.
   real(wp), parameter :: sufficient = 0.7_wp

contains

   !> Room for polynomials of a degree, sampled on a grid, and n_coefficients waves.
   pure subroutine reserve_oscillator(self, degree, n_grid, n_coefficients)
      class(oscillator_pair_type), intent(inout) :: self
      integer, intent(in) :: degree, n_grid, n_coefficients
      real(wp) :: cosines(0:degree), sines(0:degree)
      integer :: k, n, s

      call self%reserve(degree, n_grid, n_coefficients)
      call self%turn%reserve(degree)
      n = max(least_grid, grid_per_harmonic*degree)
      allocate (self%grid_cosine(n, 0:degree), self%grid_sine(n, 0:degree))
      do k = 1, n
         call fill_waves(degree, 2.0_wp*pi*real(k - 1, wp)/real(n, wp), cosines, sines)
         self%grid_cosine(k, :) = cosines
         self%grid_sine(k, :) = sines
      end do
      associate (w => self%waves)
         allocate (w%position(0:degree, 2, -1:1), w%lift(2*degree + 2), source=0.0_wp)
         allocate (self%answer(0:degree, 2), source=0.0_wp)
         do s = -1, 1
            call w%rate(s)%reserve(degree, n)
         end do
         allocate (w%lower, w%upper)
         call w%lower%reserve(degree, n)
         call w%upper%reserve(degree, n)
      end associate
   end subroutine reserve_oscillator

   !> Find the periodic path, and the moments of its sets. The curves have been filled before.
   pure subroutine follow_oscillator(self, x_start)
      class(oscillator_pair_type), intent(inout) :: self
      !> Position where the assembly starts, times k [force].
      real(wp), intent(in) :: x_start

      ! The play operator first: it decides whether the pair is held, and gives the roots of N.
      call self%event_pair_type%follow(x_start)
      ! A pair that never bears does not rub, and the balance alone moves it.
      self%swings = self%rubs .and. .not. (is_held(self) .or. self%path%open)
      self%drift = 0.0_wp
      self%n_turns = 1
      if (.not. self%swings) return
      call fill_drive(self)
      call find_period(self)
      call take_path(self)
      call self%fill_moments()
   end subroutine follow_oscillator

   !> Whether the play operator sticks through the period.
   pure logical function is_held(self)
      type(oscillator_pair_type), intent(in) :: self

      is_held = self%path%closed .and. self%path%n_segments == 1
      if (is_held) is_held = self%path%phase(1) == phase_stick
   end function is_held

   !> The answers to P - side Q, their samples, and where the pair lifts and lands.
   pure subroutine fill_drive(self)
      type(oscillator_pair_type), intent(inout) :: self
      complex(wp) :: force, answer
      integer :: j, n, s

      associate (w => self%waves, c => self%curves)
         do s = -1, 1
            do n = 0, c%degree
               ! U_n = c_n - i s_n, as everywhere.
               force = cmplx(c%tangential(n, 1) - s*c%mu*c%normal(n, 1), &
                             -c%tangential(n, 2) + s*c%mu*c%normal(n, 2), wp)
               answer = (0.0_wp, 0.0_wp)
               ! Not 0/E_n: an undamped oscillator at its resonance would make NaN of it.
               if (abs(force) > 0.0_wp) answer = force/w%oscillator%impedance(n)
               w%position(n, 1, s) = real(answer, wp)
               w%position(n, 2, s) = -aimag(answer)
            end do
            call differentiate(c%degree, w%position(:, :, s), w%rate(s)%p)
            call sample(self, w%rate(s))
         end do
         w%lower%p = c%lower
         w%upper%p = c%upper
         call sample(self, w%lower)
         call sample(self, w%upper)
      end associate
      associate (w => self%waves, p => self%path)
         w%starts_open = p%phase(1) == phase_open
         ! Changes between open and any other phase of the play operator are the roots of N.
         w%n_lifts = 0
         do j = 2, p%n_segments
            if ((p%phase(j) == phase_open) .eqv. (p%phase(j - 1) == phase_open)) cycle
            w%n_lifts = w%n_lifts + 1
            w%lift(w%n_lifts) = p%angle(j)
         end do
      end associate
   end subroutine fill_drive

   !> Values and slopes of a wave on the grid, and the bounds that follow from them.
   pure subroutine sample(self, wave)
      type(oscillator_pair_type), intent(in) :: self
      type(wave_type), intent(inout) :: wave
      integer :: n

      wave%value = wave%p(0, 1)
      wave%slope = 0.0_wp
      do n = 1, wave%degree
         wave%value = wave%value + (wave%p(n, 1)*self%grid_cosine(:, n) + &
                                    wave%p(n, 2)*self%grid_sine(:, n))
         wave%slope = wave%slope + real(n, wp)*(wave%p(n, 2)*self%grid_cosine(:, n) - &
                                                wave%p(n, 1)*self%grid_sine(:, n))
      end do
      call wave%measure()
   end subroutine sample

   !> Turns until X repeats: from the third on by Newton's method with the derivative of a turn, a
   !> step being kept only if it brings X nearer to repeating.
   pure subroutine find_period(self)
      type(oscillator_pair_type), intent(inout) :: self
      real(wp) :: x(2), next(2), tried(2), change, tried_change, size_of_motion
      logical :: singular

      associate (o => self%waves%oscillator, turn => self%turn)
         size_of_motion = o%energy_norm([sum(abs(self%waves%position(:, :, 0))), &
                                         sum(abs(self%waves%rate(0)%p))])
         ! Start at rest where slow sweeping leads.
         x = [self%path%z_end/o%k, 0.0_wp]
         call turn%run(self%waves, x)
         next = turn%last
         change = o%energy_norm(next - x)
         self%n_turns = 1
         do while (change > periodic*size_of_motion .and. self%n_turns < max_turns)
            if (self%n_turns >= plain_turns) then
               call newton_step(turn%monodromy, next - x, tried, singular)
               tried = x + tried
               if (.not. singular) then
                  ! The turn of x is lost, its end is not.
                  call turn%run(self%waves, tried)
                  self%n_turns = self%n_turns + 1
                  tried_change = o%energy_norm(turn%last - tried)
                  if (tried_change <= sufficient*change .or. &
                      tried_change <= near_round_off*size_of_motion) then
                     x = tried
                     next = turn%last
                     ! No gain, but at round-off: enough.
                     if (tried_change > sufficient*change) change = 0.0_wp
                     change = min(change, tried_change)
                     cycle
                  end if
               end if
            end if
            x = next
            call turn%run(self%waves, x)
            next = turn%last
            change = o%energy_norm(next - x)
            self%n_turns = self%n_turns + 1
         end do
         self%drift = o%energy_norm(turn%last - x)/size_of_motion
         ! An unfinished turn never counts as settled.
         if (.not. turn%complete) self%drift = huge(1.0_wp)
      end associate
   end subroutine find_period

   !> The segments of the last turn as the path of the pair, positions times k.
   pure subroutine take_path(self)
      type(oscillator_pair_type), intent(inout) :: self
      integer :: n

      associate (p => self%path, turn => self%turn)
         n = turn%n_segments
         if (n > size(p%phase)) call widen(self, size(turn%phase))
         p%n_segments = n
         p%phase(:n) = turn%phase(:n)
         p%angle(:n + 1) = turn%angle(:n + 1)
         p%z(:n) = self%waves%oscillator%k*turn%x(1, :n)
         ! z does not stand for itself here: its derivative is that of the motion.
         p%set(:n) = .false.
         p%moved = .true.
         p%z_end = self%waves%oscillator%k*turn%last(1)
      end associate
   end subroutine take_path

   !> Room for the segments of a turn in the path: once.
   pure subroutine widen(self, n)
      type(oscillator_pair_type), intent(inout) :: self
      integer, intent(in) :: n

      associate (p => self%path)
         deallocate (p%phase, p%angle, p%z, p%set_at, p%weight, p%set)
         allocate (p%phase(n), p%angle(n + 1), p%z(n), p%set_at(n), p%weight(n), p%set(n))
      end associate
   end subroutine widen

   !> int N |dx| over the period times k, x the motion of the mass: what wears. In slip it is the
   !> integral of N times the driven velocity, by moments, and of N times the free one, whose
   !> exponentials are integrated with the waves of N in closed form.
   real(wp) function friction_path(self) result(path)
      class(oscillator_pair_type), intent(inout) :: self
      real(wp) :: weight(2)
      integer :: j

      if (.not. self%swings) then
         path = self%event_pair_type%friction_path()
         return
      end if
      path = 0.0_wp
      do j = 1, self%turn%n_segments
         ! Only slip wears.
         if (side_of(self%turn%phase(j)) == 0) cycle
         call integrate_free(self%waves%oscillator, self%curves, self%turn%angle(j), &
                             self%turn%angle(j + 1), weight)
         path = path + side_of(self%turn%phase(j))*sum(weight*self%turn%free(:, j))
      end do
      self%one%cosine = self%contact%cosine - self%stick%cosine
      self%one%sine = self%contact%sine - self%stick%sine
      associate (w => self%waves, c => self%curves)
         ! Parts of the driven velocities that do not, and do, turn over with the side of slip.
         self%answer = 0.5_wp*(w%rate(-1)%p + w%rate(1)%p)
         path = path + self%slip%pairing(c%normal, self%answer)
         self%answer = 0.5_wp*(w%rate(1)%p - w%rate(-1)%p)
         path = path + self%one%pairing(c%normal, self%answer)
      end associate
      path = path*self%waves%oscillator%k
   end function friction_path

end module fw_oscillator_pair
