!> Linear modes of a structure about its position at rest, with closed pairs stuck: elastic ones as
!> their springs, rigid ones held; nonlinear springs as their slopes. Nonlinear modes start from
!> them, and are them below the onset of slip.
!>
!> First those without damping and with the Hermitian part of K; then the one in question among
!> those with all of it (fw_mode_choice), and the self-excitation xi that cancels its damping,
!>
!>   (K - theta M + i omega C) U = 0,   theta = omega^2 + i omega xi,   exact whatever the damping.
!>
!> Of a cyclic structure they are waves of the nodal diameter of harmonic 1, with Hermitian M; what
!> the air adds to K and Coriolis forces to C tells the two directions apart.
module fw_stuck_modes
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_open
   use fw_hermitian, only: solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_linalg, only: solve_symmetric_eigen
   use fw_mode_choice, only: choose_mode, list_modes, mode_choice, mode_from_rest, modes_at_rest
   use fw_self_excited_mode, only: mode_pencil, refine_mode, self_excited_mode
   implicit none (type, external)
   private

   public :: stuck_modes, find_stuck_modes

   type :: stuck_modes
      !> Of the elastic modes without damping in ascending order: frequencies [rad/s] (n_modes).
      real(wp), allocatable :: omega(:)
      !> K with its stuck pairs, M and C of the coordinates, rows of the observed quantities.
      complex(wp), allocatable, private :: stiffness(:, :), mass(:, :), damping(:, :)
      complex(wp), allocatable :: observe(:, :)
      !> Coordinates that rigid pairs do not hold.
      integer, allocatable, private :: free(:)
      !> Those without damping in the coordinates that are free, and all matrices of these.
      type(modes_at_rest), private :: rest
      type(mode_pencil), private :: pencil
      !> What `choose` has chosen.
      type(mode_choice) :: choice
   contains
      procedure :: choose
      procedure :: undamped
      procedure :: list
      procedure :: frequency
      procedure :: shape_of
      procedure :: refine
   end type stuck_modes

   !> Shifts of a stiffness that does not hold the structure, in parts of K over M.
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-6_wp, 1.0e-3_wp, 1.0_wp]
   !> Eigenvalues below this part of the largest are massless directions: round-off.
   real(wp), parameter :: massless = 1.0e-13_wp
   !> Squares of frequencies below this part of the shift are rigid motions.
   real(wp), parameter :: rigid = 1.0e-7_wp

contains

   !> The modes where the balance was evaluated last: at rest. Nothing of its structure is condensed
   !> in harmonic 1.
   subroutine find_stuck_modes(system, modes, done, slides, harmonic)
      type(balance_state), intent(in) :: system
      type(stuck_modes), intent(out) :: modes
      !> False where a part has neither stiffness nor mass.
      logical, intent(out) :: done
      !> Pairs hold nothing tangentially (default: they do).
      logical, intent(in), optional :: slides
      !> Place of the harmonic whose waves are meant, the first where it is not given.
      integer, intent(in), optional :: harmonic
      logical, allocatable :: held(:)
      integer :: first, h, j, m

      associate (structure => system%problem%structure)
         m = structure%n_coordinates
         h = findloc(system%problem%fourier%harmonic, 1, dim=1)
         if (present(harmonic)) h = harmonic
         allocate (modes%stiffness(m, m), modes%observe(structure%n_observed, m), held(m))
         allocate (modes%mass, modes%damping, mold=modes%stiffness)
         call structure%parts(h, modes%stiffness, modes%mass, modes%damping, modes%observe)
      end associate
      held = .false.
      first = 1
      if (present(slides)) first = merge(3, 1, slides)
      call add_slopes(system, h, first, modes%stiffness, held)
      modes%free = pack([(j, j=1, m)], .not. held)
      call solve_undamped(modes, done)
   end subroutine find_stuck_modes

   !> Slopes of all laws; rigid pairs that bear hold their coordinates.
   subroutine add_slopes(system, h, first, block, held)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      !> The first component of pairs that holds.
      integer, intent(in) :: first
      complex(wp), intent(inout) :: block(:, :)
      logical, intent(inout) :: held(:)
      real(wp) :: force, slope
      integer :: c, i, k, row

      do k = 1, system%problem%forces%n_laws
         if (k == system%problem%forces%pairs) cycle
         do i = 1, size(system%problem%forces%entry(k)%row, 2)
            call add_element(system, k, i, h, block)
         end do
      end do
      associate (entry => system%problem%forces%entry(system%problem%forces%pairs), &
                 work => system%work(system%problem%forces%pairs))
         do i = 1, size(entry%row, 2)
            do c = first, size(entry%row, 1)
               row = entry%row(c, i)
               if (row == 0 .or. work%state(i) == pair_open) cycle
               ! Stuck, whatever slipped on the way to rest.
               slope = entry%law%slope_at_rest(i, c)
               if (c == 3 .and. entry%law%facts%is_curved) then
                  call entry%law%press_at(i, work%prediction(i, 3, 1) + work%offset(i), force, &
                                          slope)
               end if
               if (.not. abs(slope) > 0.0_wp) cycle
               if (entry%law%prediction%takes(i)) then
                  held(system%problem%incidence%coordinate_of(row)) = .true.
               else
                  call system%problem%incidence%add_block(row, h, &
                     cmplx(entry%law%prediction%stiffness(i, c)*slope, kind=wp), block)
               end if
            end do
         end do
      end associate
   end subroutine add_slopes

   !> Slopes of a spring or another element at its elongation.
   subroutine add_element(system, law, element, h, block)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: law, element, h
      complex(wp), intent(inout) :: block(:, :)
      real(wp) :: rest(system%problem%forces%entry(law)%law%n_components)
      real(wp) :: slope(size(rest), size(rest))
      integer :: c, d

      associate (entry => system%problem%forces%entry(law), work => system%work(law))
         rest = 0.0_wp
         ! Harmonic 0 is the first of those retained.
         if (system%problem%fourier%has_constant()) rest = work%prediction(element, :, 1)
         call entry%law%slopes_about(element, rest, slope)
         do d = 1, size(rest)
            do c = 1, size(rest)
               if (entry%row(c, element) == 0 .or. entry%row(d, element) == 0) cycle
               if (.not. abs(slope(c, d)) > 0.0_wp) cycle
               call system%problem%incidence%add_coupling( &
                  entry%row(c, element), entry%row(d, element), h, &
                  cmplx(entry%law%prediction%stiffness(element, d)*slope(c, d), kind=wp), block)
            end do
         end do
      end associate
   end subroutine add_element

   !> M x = value (K + shift M) x, so that massless coordinates are no exception.
   subroutine solve_undamped(self, done)
      type(stuck_modes), intent(inout) :: self
      logical, intent(out) :: done
      complex(wp), allocatable :: k(:, :), vectors(:, :)
      real(wp), allocatable :: values(:), square(:)
      real(wp) :: shift
      integer, allocatable :: order(:)
      integer :: j, trial

      self%pencil%k = self%stiffness(self%free, self%free)
      self%pencil%m = self%mass(self%free, self%free)
      self%pencil%c = self%damping(self%free, self%free)
      ! Forces of the air are not Hermitian.
      k = 0.5_wp*(self%pencil%k + conjg(transpose(self%pencil%k)))
      done = size(self%free) > 0
      if (.not. done) return
      associate (m => self%pencil%m)
         do trial = 1, size(shift_trials)
            shift = shift_trials(trial)*norm2(abs(k))/max(norm2(abs(m)), tiny(1.0_wp))
            call solve_pencil(m, k + shift*m, values, vectors, done)
            if (done) exit
         end do
      end associate
      if (.not. done) return
      ! In descending order of the values: ascending frequencies.
      order = [(j, j=size(values), 1, -1)]
      order = pack(order, values(order) > massless*maxval(abs(values)))
      square = 1.0_wp/values(order) - shift
      ! Rigid motions have no frequency and do not count.
      self%rest%rigid_motions = vectors(:, pack(order, square <= rigid*shift))
      order = pack(order, square > rigid*shift)
      square = 1.0_wp/values(order) - shift
      self%omega = sqrt(square)
      self%rest%omega = self%omega
      self%rest%shape = vectors(:, order)
      self%rest%shift = shift
   end subroutine solve_undamped

   !> Real matrices have real modes, and take a quarter of the time.
   subroutine solve_pencil(a, b, values, vectors, done)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), allocatable, intent(out) :: values(:)
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      logical, intent(out) :: done
      real(wp), allocatable :: real_vectors(:, :)

      if (any(abs(aimag(a)) > 0.0_wp) .or. any(abs(aimag(b)) > 0.0_wp)) then
         call solve_hermitian_eigen(a, b, values, vectors, done)
      else
         call solve_symmetric_eigen(real(a, wp), real(b, wp), values, real_vectors, done)
         if (done) vectors = cmplx(real_vectors, kind=wp)
      end if
   end subroutine solve_pencil

   !> Take the mode of a number, or the one nearest to a frequency, among those that oscillate.
   subroutine choose(self, number, near)
      class(stuck_modes), intent(inout) :: self
      integer, intent(in) :: number
      !> 0: by number [rad/s].
      real(wp), intent(in) :: near

      call choose_mode(self%pencil, self%rest, number, near, self%choice)
   end subroutine choose

   !> The shape of a mode without damping, of any size (n_coordinates).
   pure subroutine undamped(self, number, shape)
      class(stuck_modes), intent(in) :: self
      !> Of those in `omega`.
      integer, intent(in) :: number
      complex(wp), intent(out) :: shape(:)

      shape = (0.0_wp, 0.0_wp)
      shape(self%free) = self%rest%shape(:, number)
   end subroutine undamped

   !> Frequencies of all modes that oscillate, as they are numbered [rad/s].
   subroutine list(self, omega)
      class(stuck_modes), intent(in) :: self
      real(wp), allocatable, intent(out) :: omega(:)

      call list_modes(self%pencil, self%rest, omega)
   end subroutine list

   !> About its frequency: that without damping where Newton's method starts there [rad/s].
   pure real(wp) function frequency(self)
      class(stuck_modes), intent(in) :: self

      frequency = self%choice%mode%omega
      if (self%choice%from_rest > 0) frequency = self%omega(self%choice%from_rest)
   end function frequency

   !> About its shape, of any size (n_coordinates).
   pure function shape_of(self) result(shape)
      class(stuck_modes), intent(in) :: self
      complex(wp) :: shape(size(self%stiffness, 1))

      shape = (0.0_wp, 0.0_wp)
      if (self%choice%from_rest > 0) then
         shape(self%free) = self%rest%shape(:, self%choice%from_rest)
      else
         shape(self%free) = self%choice%mode%shape
      end if
   end function shape_of

   !> The chosen mode exactly, b^T U = 1.
   subroutine refine(self, row, omega, self_excitation, shape, done)
      class(stuck_modes), intent(in) :: self
      !> The row b (n_coordinates).
      complex(wp), intent(in) :: row(:)
      !> [rad/s]
      real(wp), intent(out) :: omega, self_excitation
      !> U (n_coordinates).
      complex(wp), intent(out) :: shape(:)
      !> False where Newton's method came to another one.
      logical, intent(out) :: done
      type(self_excited_mode) :: mode

      associate (choice => self%choice, b => row(self%free))
         done = choice%from_rest > 0
         if (done) then
            associate (phi => self%rest%shape(:, choice%from_rest))
               mode = mode_from_rest(self%pencil, self%omega(choice%from_rest), phi/sum(b*phi))
            end associate
            call refine_mode(self%pencil, b, mode, done)
            done = done .and. mode%is_nearly(choice%mode, choice%part)
         end if
         if (.not. done) then
            ! Another row b, another way.
            mode = choice%mode
            call refine_mode(self%pencil, b, mode, done)
            done = done .and. mode%is_nearly(choice%mode, choice%part)
         end if
      end associate
      omega = mode%omega
      self_excitation = mode%self_excitation
      shape = (0.0_wp, 0.0_wp)
      shape(self%free) = mode%shape
   end subroutine refine

end module fw_stuck_modes
