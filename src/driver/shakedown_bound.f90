!> The largest amplitude at which pairs that vibrate can stick for some constant offset of their
!> tangential forces (Melan's bound): with offsets x and the amplitude A
!>
!>   |T_i(t)| <= mu_i N_i(t),   T_i = x_i + A c_i(t),   N_i = N_0i + sum_j C_ij x_j + A n_i(t)
!>
!> at every instant, maximise A. The set is convex. Newton's method on A and the logarithms of what
!> is left to the limits, with ever less weight on these, leads to its end through the inside.
module fw_shakedown_bound
   use fw_kinds, only: pi, wp
   use fw_linalg, only: lu_type
   use fw_shakedown_limits, only: pair_limits, shakedown_limits
   implicit none (type, external)
   private

   public :: shakedown_type

   type, extends(shakedown_limits) :: shakedown_type
      !> Instants at which laws decide, 0: all the time.
      integer :: n_time = 0
   contains
      procedure :: maximise
   end type shakedown_type

   !> Instants of a period where laws decide all the time: 2e-6 of a force is left between two; few
   !> of them serve while the limits are further than `seen`.
   integer, parameter :: many = 1440, few = 96
   real(wp), parameter :: seen = 3.0e-3_wp

contains

   !> From offsets that bear an amplitude to the largest one; both are scaled to be of order one.
   subroutine maximise(self, x, done)
      class(shakedown_type), intent(in) :: self
      !> Offsets, then the amplitude (n).
      real(wp), intent(inout) :: x(:)
      logical, intent(out) :: done
      !> Part of the amplitude that the weight of the limits may take, growth of the weight of the
      !> amplitude, and steps for each.
      real(wp), parameter :: small = 1.0e-7_wp, growth = 4.0_wp
      integer, parameter :: most_steps = 100, most_stages = 100
      !> An amplitude, over the likely one, that has no bound.
      real(wp), parameter :: unbounded = 1.0e6_wp
      complex(wp), allocatable :: wave(:)
      real(wp) :: scale, weight, within
      integer :: every, k, stage
      logical :: failed, is_fine

      is_fine = self%n_time > 0
      every = merge(self%n_time, many, self%n_time > 0)
      wave = waves(merge(self%n_time, few, self%n_time > 0))
      ! Pairs that do not vibrate bear any amplitude.
      done = allowed(self, wave, x) .and. any(abs(self%cycle) > 0.0_wp)
      if (done) scale = likely(self, x)
      if (done) weight = 1.0_wp/scale
      do stage = 1, most_stages
         if (.not. done) exit
         do k = 1, most_steps
            call improve(self, wave, weight, x, done, failed)
            if (done .or. failed) exit
         end do
         ! What bears any amplitude has no bound, and what ends on the way is none.
         done = done .and. x(self%n) < unbounded*scale
         if (.not. done) exit
         ! Part of the amplitude that the weight of the limits takes.
         within = 2.0_wp*size(wave)*self%n_pairs/(weight*x(self%n))
         if (within < small .and. is_fine) then
            if (size(wave) == every .or. allowed(self, waves(every), x)) exit
            ! Instants between those that were chosen decide.
            call refine(waves(every))
         else if (within < seen .and. .not. is_fine) then
            call refine(near_limits(self, waves(every), x))
         else
            weight = growth*weight
         end if
      end do
      done = done .and. stage <= most_stages

   contains

      !> Other instants, from a little inside.
      subroutine refine(other)
         complex(wp), intent(in) :: other(:)

         is_fine = .true.
         wave = other
         x(self%n) = (1.0_wp - 2.0_wp*seen)*x(self%n)
         weight = 2.0_wp*size(wave)*self%n_pairs/(seen*x(self%n))
      end subroutine refine

   end subroutine maximise

   !> Of all instants those that may decide: at which a pair is near to its limit, and some between.
   pure function near_limits(self, wave, x) result(chosen)
      type(shakedown_type), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: x(:)
      complex(wp), allocatable :: chosen(:)
      !> Part of the squared limit that is left.
      real(wp), parameter :: near = 0.3_wp
      type(pair_limits) :: limits
      logical :: takes(size(wave))
      integer :: i

      takes = .false.
      takes(::size(wave)/few) = .true.
      do i = 1, self%n_pairs
         call self%find(i, wave, x, limits)
         if (all(self%place(:, i) == 0)) then
            takes = takes .or. limits%left < near*maxval(limits%left)
         else
            takes = takes .or. limits%left < near*(self%mu(i)*limits%normal)**2
         end if
      end do
      chosen = pack(wave, takes)
   end function near_limits

   !> An amplitude of the order of the largest one: at which the first pair would come to its limit
   !> if it was unloaded at rest.
   pure real(wp) function likely(self, x) result(amplitude)
      type(shakedown_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: normal(self%n_pairs), used(self%n_pairs)

      normal = self%normal + matmul(self%coupling, x(:self%n - 1))
      used = norm2(abs(self%cycle(1:2, :)), dim=1)/self%mu + abs(self%cycle(3, :))
      amplitude = 1.0_wp/maxval(used/normal)
   end function likely

   !> exp(i t) at the instants of a period.
   pure function waves(n_time) result(wave)
      integer, intent(in) :: n_time
      complex(wp) :: wave(n_time)
      real(wp) :: angle
      integer :: k

      do k = 1, n_time
         angle = 2.0_wp*pi*real(k - 1, wp)/real(n_time, wp)
         wave(k) = cmplx(cos(angle), sin(angle), wp)
      end do
   end function waves

   !> Whether every pair bears, below its limit.
   pure logical function allowed(self, wave, x)
      type(shakedown_type), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: x(:)

      allowed = x(self%n) > 0.0_wp .and. self%height(wave, 0.0_wp, x) < huge(1.0_wp)
   end function allowed

   !> A step of Newton's method, shortened to stay inside; done where it changes nothing.
   subroutine improve(self, wave, weight, x, done, failed)
      type(shakedown_type), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: weight
      real(wp), intent(inout) :: x(:)
      logical, intent(out) :: done
      !> No step was found.
      logical, intent(out) :: failed
      !> Far less than what the weight of all limits leaves open.
      real(wp), parameter :: no_change = 1.0e-3_wp
      real(wp) :: gradient(size(x)), step(size(x)), decrement
      type(lu_type) :: lu
      logical :: singular, halted

      call lu%reserve(self%n)
      call self%slopes(wave, x, gradient, lu%matrix(:self%n, :self%n))
      gradient(self%n) = gradient(self%n) - weight
      call lu%factor(singular)
      done = .false.
      failed = singular
      if (singular) return
      step = -gradient
      call lu%solve(step)
      decrement = sqrt(max(0.0_wp, -dot_product(gradient, step)))
      done = decrement <= no_change
      call search(self, wave, weight, step, -decrement**2, x, halted)
      ! Round-off leaves nothing to go.
      done = done .or. halted
   end subroutine improve

   !> Go along a step: as far as it is allowed and does what its slope promises, then further while
   !> that still helps.
   subroutine search(self, wave, weight, step, slope, x, halted)
      type(shakedown_type), intent(in) :: self
      complex(wp), intent(in) :: wave(:)
      real(wp), intent(in) :: weight, step(:), slope
      real(wp), intent(inout) :: x(:)
      logical, intent(out) :: halted
      !> Part of what the slope promises that a step has to bring.
      real(wp), parameter :: share = 0.1_wp
      integer, parameter :: most_halvings = 60, most_doublings = 20
      real(wp) :: length, value, start, further
      integer :: k

      start = self%height(wave, weight, x)
      length = 1.0_wp
      do k = 1, most_halvings
         value = self%height(wave, weight, x + length*step)
         if (value <= start + share*length*slope) exit
         length = 0.5_wp*length
      end do
      halted = k > most_halvings
      if (halted) return
      if (k == 1) then
         do k = 1, most_doublings
            further = self%height(wave, weight, x + 2.0_wp*length*step)
            if (.not. further < value) exit
            value = further
            length = 2.0_wp*length
         end do
      end if
      x = x + length*step
   end subroutine search

end module fw_shakedown_bound
