!> All linear modes with their damping, in ascending order of omega:
!>
!>   (K + i omega C) U = theta M U,   theta = omega^2 + i omega xi.
!>
!> At each omega this has as many theta as there are masses, whatever the damping and the Coriolis
!> forces; a mode is where one of them has Re theta = omega^2. At omega = 0 those of a stable
!> structure are above, at high omega all are below: the number of those below counts the modes that
!> were passed. Brackets in which it changes are halved until Newton's method from a vector of their
!> ends finds the one mode within. So none is left out and none is found twice, as Newton's method
!> from modes without damping does.
module fw_self_excited_modes
   use fw_kinds, only: wp
   use fw_lapack, only: zgeev
   use fw_linalg, only: complex_lu_type
   use fw_self_excited_mode, only: mode_pencil, refine_mode, self_excited_mode
   implicit none (type, external)
   private

   public :: mode_search

   !> The search, and what it has found.
   type :: mode_search
      type(mode_pencil) :: pencil
      !> K + shift M is regular.
      real(wp) :: shift = 0.0_wp
      !> What is wanted: modes up to this number and the next, or those about a frequency.
      integer :: number = 1
      real(wp) :: near = 0.0_wp
      !> Those that oscillate (n_found used), and how many do not.
      type(self_excited_mode), allocatable :: found(:)
      integer :: n_found = 0, n_overdamped = 0
      !> False where eigenvalues were not found.
      logical :: works = .true.
   contains
      procedure :: find
      procedure :: nearest_to
      procedure :: has_enough
      procedure, private :: sample_at
      procedure, private :: search_between
      procedure, private :: take_within
      procedure, private :: take_together
      procedure :: keep
   end type mode_search

   !> Eigenpairs at a frequency.
   type :: sample_type
      real(wp) :: omega = 0.0_wp
      complex(wp), allocatable :: theta(:), vector(:, :)
      !> Of the theta, those with a real part below omega**2.
      integer :: n_below = 0
   end type sample_type

   !> Eigenvalues below this part of the largest are massless directions: round-off.
   real(wp), parameter :: massless = 1.0e-12_wp
   !> Modes in a bracket of this part of its frequency have one frequency.
   real(wp), parameter :: one_frequency = 1.0e-9_wp
   !> The search ends at a mode that is this part above the one that is wanted.
   real(wp), parameter :: beyond = 1.0e-5_wp
   !> Of the frequency of a mode at the end of its bracket.
   real(wp), parameter :: round_off = 1.0e-11_wp
   !> Doublings of the highest frequency, far beyond what any damping asks for.
   integer, parameter :: most_doublings = 60

contains

   !> Modes from a lowest frequency on, as many as are wanted.
   subroutine find(self, lowest, marks)
      class(mode_search), intent(inout) :: self
      !> [rad/s]
      real(wp), intent(in) :: lowest
      !> Where modes may be expected, in ascending order: those without damping [rad/s].
      real(wp), intent(in) :: marks(:)
      type(sample_type) :: low, high
      real(wp) :: omega
      integer :: j

      call self%sample_at(lowest, low)
      do j = 1, size(marks) + most_doublings
         if (.not. self%works .or. self%has_enough()) return
         if (j > size(marks)) then
            if (low%n_below == size(low%theta)) return
            call self%sample_at(2.0_wp*low%omega, high)
         else
            ! Between two of them, where none is.
            call find_gap(marks, j, omega)
            if (.not. omega > low%omega) cycle
            call self%sample_at(omega, high)
         end if
         if (self%works) call self%search_between(low, high)
         low = high
      end do
   end subroutine find

   !> A frequency above mark j and below the next, 0 where the two are one.
   pure subroutine find_gap(marks, j, omega)
      real(wp), intent(in) :: marks(:)
      integer, intent(in) :: j
      real(wp), intent(out) :: omega
      real(wp), parameter :: no_gap = 1.0e-6_wp, beyond_all = 1.5_wp

      omega = beyond_all*marks(j)
      if (j == size(marks)) return
      omega = 0.5_wp*(marks(j) + marks(j + 1))
      if (marks(j + 1) - marks(j) <= no_gap*marks(j + 1)) omega = 0.0_wp
   end subroutine find_gap

   !> The one whose frequency is nearest to a given one.
   pure integer function nearest_to(self, omega)
      class(mode_search), intent(in) :: self
      real(wp), intent(in) :: omega
      integer :: j

      nearest_to = 1
      do j = 2, self%n_found
         ! Of one frequency the first.
         if (abs(self%found(j)%omega - omega) < abs(self%found(nearest_to)%omega - omega) - &
             one_frequency*omega) nearest_to = j
      end do
   end function nearest_to

   !> Whether the mode that is wanted and the next one are known.
   pure logical function has_enough(self)
      class(mode_search), intent(in) :: self
      integer :: j

      has_enough = .false.
      if (self%n_found == 0) return
      j = self%number
      if (self%near > 0.0_wp) j = self%nearest_to(self%near)
      if (j >= self%n_found) return
      ! The next one is not of the same frequency.
      associate (last => self%found(self%n_found)%omega, wanted => self%found(j)%omega)
         has_enough = last > (1.0_wp + beyond)*wanted
         if (self%near > 0.0_wp) has_enough = has_enough .and. &
                                              last - self%near > abs(wanted - self%near)
      end associate
   end function has_enough

   subroutine sample_at(self, omega, sample)
      class(mode_search), intent(inout) :: self
      real(wp), intent(in) :: omega
      type(sample_type), intent(out) :: sample
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: a(:, :), value(:), vector(:, :), work(:)
      complex(wp) :: room(1), unused(1, 1)
      real(wp) :: rwork(2*size(self%pencil%m, 1))
      integer, allocatable :: kept(:)
      integer :: info, j, n
      logical :: singular

      sample%omega = omega
      associate (p => self%pencil)
         n = size(p%m, 1)
         call lu%reserve(n)
         lu%matrix = p%k + self%shift*p%m + cmplx(0.0_wp, omega, wp)*p%c
         a = p%m
      end associate
      call lu%factor(singular)
      self%works = self%works .and. .not. singular
      if (singular) return
      call lu%solve(n, a)
      allocate (value(n), vector(n, n))
      call zgeev('N', 'V', n, a, n, value, unused, 1, vector, n, room, -1, rwork, info)
      allocate (work(max(1, int(real(room(1), wp)))))
      call zgeev('N', 'V', n, a, n, value, unused, 1, vector, n, work, size(work), rwork, info)
      self%works = self%works .and. info == 0
      kept = pack([(j, j=1, n)], abs(value) > massless*maxval(abs(value)))
      sample%theta = 1.0_wp/value(kept) - self%shift
      sample%vector = vector(:, kept)
      sample%n_below = count(real(sample%theta, wp) < omega**2)
   end subroutine sample_at

   !> The modes between two frequencies, in their order.
   recursive subroutine search_between(self, low, high)
      class(mode_search), intent(inout) :: self
      type(sample_type), intent(in) :: low, high
      type(sample_type) :: middle
      integer :: n
      logical :: done

      n = abs(high%n_below - low%n_below)
      if (n == 0 .or. .not. self%works) return
      if (self%has_enough()) return
      done = .false.
      if (n == 1) call self%take_within(low, high, low, done)
      if (n == 1 .and. .not. done) call self%take_within(low, high, high, done)
      if (done) return
      call self%sample_at(0.5_wp*(low%omega + high%omega), middle)
      if (.not. self%works) return
      if (high%omega - low%omega <= one_frequency*high%omega) then
         call self%take_together(middle, n)
         return
      end if
      call self%search_between(low, middle)
      if (self%works) call self%search_between(middle, high)
   end subroutine search_between

   !> The one mode in a bracket, from the vector of a sample that is nearest to it.
   subroutine take_within(self, low, high, sample, done)
      class(mode_search), intent(inout) :: self
      type(sample_type), intent(in) :: low, high, sample
      logical, intent(out) :: done
      type(self_excited_mode) :: mode
      integer :: j

      j = minloc(abs(real(sample%theta, wp) - 0.25_wp*(low%omega + high%omega)**2), dim=1)
      mode%omega = min(max(sqrt(max(real(sample%theta(j), wp), 0.0_wp)), low%omega), high%omega)
      mode%self_excitation = aimag(sample%theta(j))/sample%omega
      mode%shape = sample%vector(:, j)
      call refine_mode(self%pencil, conjg(mode%shape), mode, done)
      done = done .and. mode%omega > (1.0_wp - round_off)*low%omega .and. &
             mode%omega < (1.0_wp + round_off)*high%omega
      if (done) call self%keep(mode)
   end subroutine take_within

   !> Modes of one frequency, as the sample there has them.
   subroutine take_together(self, sample, n)
      class(mode_search), intent(inout) :: self
      type(sample_type), intent(in) :: sample
      integer, intent(in) :: n
      type(self_excited_mode) :: mode
      real(wp) :: distance(size(sample%theta))
      integer :: j, k

      distance = abs(real(sample%theta, wp) - sample%omega**2)
      do k = 1, n
         j = minloc(distance, dim=1)
         distance(j) = huge(1.0_wp)
         mode%omega = sample%omega
         mode%self_excitation = aimag(sample%theta(j))/sample%omega
         mode%shape = sample%vector(:, j)
         call self%keep(mode)
      end do
   end subroutine take_together

   !> One more, unless it does not oscillate.
   subroutine keep(self, mode)
      class(mode_search), intent(inout) :: self
      type(self_excited_mode), intent(in) :: mode
      type(self_excited_mode), allocatable :: longer(:)
      integer :: j

      if (mode%is_overdamped()) then
         self%n_overdamped = self%n_overdamped + 1
         return
      end if
      if (.not. allocated(self%found)) allocate (self%found(0))
      if (self%n_found == size(self%found)) then
         allocate (longer(2*self%n_found + 8))
         do j = 1, self%n_found
            longer(j) = self%found(j)
         end do
         call move_alloc(longer, self%found)
      end if
      self%n_found = self%n_found + 1
      ! Of one frequency those of less damping come first.
      do j = self%n_found, 2, -1
         if (mode%omega > (1.0_wp + one_frequency)*self%found(j - 1)%omega) exit
         if (mode%self_excitation >= self%found(j - 1)%self_excitation) exit
         self%found(j) = self%found(j - 1)
      end do
      self%found(j) = mode
   end subroutine keep

end module fw_self_excited_modes
