!> Motion of the base, u_b cos(n omega t + phase) in any harmonic, as group &base gives it: of some
!> dofs, the supports, or of the ground in a direction R of all dofs.
!>
!> The structure moves by u = y + R u_b, and y is what is solved for. With K, M and C the matrices,
!> the load of y is
!>
!>   supports:  -(K R) u_b - (C R) u_b' - (M R) u_b''   on the other dofs, R = 1 at the supports,
!>   ground:    -M R u_b''                              (the ground goes along with R).
!>
!> Unsymmetric and circulatory parts are in K and C, and of hysteretic damping D supports add
!> -i D R u_b. Coriolis forces are forces of inertia: with Omega G of a rotating structure a ground
!> adds -Omega G R u_b', too.
!>
!> u_b, its velocity or its acceleration is given: these are waves of powers 0, 1, 2 of the
!> frequency, or down to -1, -2. What grows with a speed that follows the frequency has as many
!> powers more.
module fw_base_motion
   use fw_key, only: key, key_visitor
   use fw_key_range, only: dof_numbers, from_to
   use fw_kinds, only: wp
   use fw_load_terms, only: add_wave, turned
   use fw_model, only: model_type
   implicit none (type, external)
   private

   public :: base_motion
   public :: motion_displacement, motion_velocity, motion_acceleration

   character(*), parameter :: motion_words(*) = &
      [character(12) :: 'displacement', 'velocity', 'acceleration']
   integer, parameter :: motion_displacement = 1, motion_velocity = 2, motion_acceleration = 3

   character(*), parameter :: frame_words(*) = [character(8) :: 'relative', 'absolute']
   integer, parameter :: frame_relative = 1, frame_absolute = 2

   !> More terms or a higher harmonic are taken for a mistake.
   integer, parameter :: most_terms = 1000000, most_harmonic = 100000
   !> Stiffness of a support that nothing is joined to any more, over the largest of the structure.
   real(wp), parameter :: support_stiffness = 1.0e-6_wp

   !> Motion of supports, or of the ground in a direction, in harmonics of the response.
   type :: base_motion
      integer :: n_terms = 0
      !> Signed dofs of the supports, or R of the ground (n_dof); one of the two is allocated.
      integer, allocatable :: dof(:)
      real(wp), allocatable :: direction(:)
      integer :: motion = motion_displacement, frame = frame_relative
      !> Harmonics, amplitudes, and phases [degrees] (n_terms).
      integer, allocatable :: harmonic(:)
      real(wp), allocatable :: amplitude(:), phase(:)
      !> R (n_dof).
      real(wp), allocatable :: carried(:)
   contains
      procedure :: bind_keys
      procedure :: has_constant
      procedure :: moves_supports
      procedure :: moves_with_frame
      procedure :: apply
      procedure :: observe
   end type base_motion

   !> What the base pulls with: a force for each unit of a derivative of u_b.
   type :: pull_type
      !> (n_dof)
      real(wp), allocatable :: force(:)
      !> Which derivative; power of the rotation speed, where that follows the frequency; whether
      !> i times it is meant, in harmonics above 0.
      integer :: derivative = 0, growth = 0
      logical :: is_hysteretic = .false.
   end type pull_type

contains

   !> Group &base; what a model file holds stays where nothing is given.
   subroutine bind_keys(self, keys)
      class(base_motion), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      integer, allocatable :: given(:)
      logical :: needed

      call keys%open('base', 'motion of the supports, or of the ground')
      call keys%bind(key('n_terms', 'harmonic motions that add up', from_to(0, most_terms)), &
                     self%n_terms)
      call keys%set_size('n_terms', self%n_terms)
      needed = self%n_terms > 0
      call keys%bind(key('dof', 'supports that move alike; negative: the other way', &
                         dof_numbers(), shape=':', repeats=.false., &
                         absent='of the file, else direction'), given)
      if (allocated(given)) call move_alloc(given, self%dof)
      call keys%bind(key('direction', 'motion of all dofs with the ground', shape='n_dof', &
                         repeats=.false., absent='of the file'), self%direction)
      call keys%bind_word(key('motion', 'what the amplitudes are of'), self%motion, motion_words)
      call keys%bind(key('harmonic', '0 to n_harmonics', from_to(0, most_harmonic), &
                         shape='n_terms'), self%harmonic, default=1)
      call keys%bind(key('amplitude', &
                         'over the time to the first or second power for a velocity or an '// &
                         'acceleration', unit='L', shape='n_terms', &
                         absent='required with n_terms'), self%amplitude, needed)
      call keys%bind(key('phase', 'of cos(n omega t + phase)', unit='degrees', &
                         shape='n_terms'), self%phase, default=0.0_wp)
      call keys%bind_word(key('frame', 'motion beside the base, or with it (supports alone)'), &
                          self%frame, frame_words)
   end subroutine bind_keys

   !> Whether dofs of the model are given a motion.
   pure logical function moves_supports(self)
      class(base_motion), intent(in) :: self

      moves_supports = self%n_terms > 0 .and. allocated(self%dof)
   end function moves_supports

   !> Whether a constant is among the terms.
   pure logical function has_constant(self)
      class(base_motion), intent(in) :: self

      has_constant = .false.
      if (self%n_terms > 0) has_constant = any(self%harmonic == 0)
   end function has_constant

   !> Whether motion with the base is observed.
   pure logical function moves_with_frame(self)
      class(base_motion), intent(in) :: self

      moves_with_frame = self%frame == frame_absolute
   end function moves_with_frame

   !> From a structure with its supports to the one whose motion beside the base is solved for: the
   !> load of the base, and supports that nothing is joined to. Where motion with the base is
   !> observed the first support has a load of its own that moves it by u_b.
   pure subroutine apply(self, harmonic_scale, static_scale, speed, coriolis, model)
      class(base_motion), intent(in) :: self
      real(wp), intent(in) :: harmonic_scale, static_scale
      !> [rad/s], and G, which may not be there.
      real(wp), intent(in) :: speed
      real(wp), allocatable, intent(in) :: coriolis(:, :)
      !> With its matrices and loads, without modal damping.
      type(model_type), intent(inout) :: model
      type(pull_type), allocatable :: pulls(:)
      real(wp) :: driven(model%n_dof)
      integer :: i, k

      if (self%n_terms == 0) return
      allocate (pulls(0))
      if (self%moves_supports()) then
         call pull_supports(self, model, pulls)
         call part_supports(self, model)
         if (self%frame == frame_absolute) then
            i = abs(self%dof(1))
            driven = 0.0_wp
            driven(i) = model%stiffness(i, i)*sign(1, self%dof(1))
            pulls = [pulls, pull_type(driven), &
                     pull_type(model%loss_factor*driven, is_hysteretic=.true.)]
         end if
      else
         call add_pull(self, -matmul(model%mass, self%carried), 2, 0, pulls)
         if (allocated(coriolis)) call add_pull(self, -speed*matmul(coriolis, self%carried), 1, 0, &
                                                pulls)
         if (allocated(model%cyclic%speed)) call pull_inertia(self, model, pulls)
      end if
      call note_motion(self, model)
      do i = 1, self%n_terms
         do k = 1, size(pulls)
            call add_load(self, i, pulls(k), harmonic_scale, static_scale, model)
         end do
      end do
   end subroutine apply

   !> What supports pull with by all matrices of the structure.
   pure subroutine pull_supports(self, model, pulls)
      type(base_motion), intent(in) :: self
      type(model_type), intent(in) :: model
      type(pull_type), allocatable, intent(inout) :: pulls(:)
      real(wp), allocatable :: by_growth(:)
      integer :: p

      call add_pull(self, -matmul(model%stiffness, self%carried), 0, 0, pulls)
      call add_pull(self, -matmul(model%damping, self%carried), 1, 0, pulls)
      call add_pull(self, -matmul(model%mass, self%carried), 2, 0, pulls)
      if (model%loss_factor > 0.0_wp) call add_pull( &
         self, -model%loss_factor*matmul(model%stiffness, self%carried), 0, 0, pulls, .true.)
      associate (whole => model%cyclic)
         if (allocated(whole%structural)) call add_pull( &
            self, -matmul(whole%structural, self%carried), 0, 0, pulls, .true.)
         if (allocated(whole%circulatory)) call add_pull( &
            self, -matmul(whole%circulatory, self%carried), 0, 0, pulls)
         if (allocated(whole%coriolis)) call add_pull( &
            self, -matmul(whole%coriolis, self%carried), 1, 0, pulls)
      end associate
      if (.not. allocated(model%cyclic%speed)) return
      call pull_inertia(self, model, pulls)
      associate (speed => model%cyclic%speed)
         if (allocated(speed%circulatory)) call add_pull( &
            self, -matmul(speed%circulatory, self%carried), 0, 1, pulls)
         if (.not. allocated(speed%growth%stiffness)) return
         do p = 1, size(speed%growth%stiffness, 3)
            by_growth = -matmul(speed%growth%stiffness(:, :, p), self%carried)
            call add_pull(self, by_growth, 0, 2*p, pulls)
            call add_pull(self, speed%rayleigh*by_growth, 1, 2*p, pulls)
            call add_pull(self, speed%loss*by_growth, 0, 2*p, pulls, .true.)
         end do
      end associate
   end subroutine pull_supports

   !> Coriolis forces of a speed that follows the frequency.
   pure subroutine pull_inertia(self, model, pulls)
      type(base_motion), intent(in) :: self
      type(model_type), intent(in) :: model
      type(pull_type), allocatable, intent(inout) :: pulls(:)

      if (.not. allocated(model%cyclic%speed%coriolis)) return
      call add_pull(self, -matmul(model%cyclic%speed%coriolis, self%carried), 1, 1, pulls)
   end subroutine pull_inertia

   !> Supports themselves are not pulled.
   pure subroutine add_pull(self, force, derivative, growth, pulls, is_hysteretic)
      type(base_motion), intent(in) :: self
      real(wp), intent(in) :: force(:)
      integer, intent(in) :: derivative, growth
      type(pull_type), allocatable, intent(inout) :: pulls(:)
      !> (default: no)
      logical, intent(in), optional :: is_hysteretic
      type(pull_type) :: pull

      pull%force = force
      if (self%moves_supports()) pull%force(abs(self%dof)) = 0.0_wp
      pull%derivative = derivative
      pull%growth = growth
      if (present(is_hysteretic)) pull%is_hysteretic = is_hysteretic
      pulls = [pulls, pull]
   end subroutine add_pull

   !> What the base itself does, for results: a wave for each term.
   pure subroutine note_motion(self, model)
      class(base_motion), intent(in) :: self
      type(model_type), intent(inout) :: model
      integer :: i

      allocate (model%base_parts(1 + 2*self%n_terms), source=0.0_wp)
      model%base_waves%harmonic = self%harmonic
      model%base_waves%power = [(1 - self%motion, i=1, self%n_terms)]
      do i = 1, self%n_terms
         associate (part => self%amplitude(i)*turned(self%phase(i) + &
                                                     90.0_wp*(1 - self%motion)))
            if (self%harmonic(i) > 0) then
               model%base_parts(2*i:2*i + 1) = part
            else
               ! What leads away has no place; it takes part in no wave.
               if (self%motion == motion_displacement) model%base_parts(1) = &
                  model%base_parts(1) + part(1)
               model%base_waves%harmonic(i) = 1
            end if
         end associate
      end do
   end subroutine note_motion

   !> Supports on springs of their own.
   pure subroutine part_supports(self, model)
      type(base_motion), intent(in) :: self
      type(model_type), intent(inout) :: model
      real(wp) :: largest
      integer :: i, j

      largest = maxval(abs(model%stiffness))
      call part(self%dof, model%stiffness)
      call part(self%dof, model%mass)
      call part(self%dof, model%damping)
      call part(self%dof, model%cyclic%coriolis)
      call part(self%dof, model%cyclic%circulatory)
      call part(self%dof, model%cyclic%structural)
      if (allocated(model%cyclic%speed)) then
         associate (speed => model%cyclic%speed)
            call part(self%dof, speed%coriolis)
            call part(self%dof, speed%circulatory)
            if (allocated(speed%growth%stiffness)) then
               do j = 1, size(speed%growth%stiffness, 3)
                  call part(self%dof, speed%growth%stiffness(:, :, j))
               end do
            end if
            if (allocated(speed%growth%load)) speed%growth%load(abs(self%dof), :) = 0.0_wp
         end associate
      end if
      do j = 1, size(self%dof)
         i = abs(self%dof(j))
         model%stiffness(i, i) = support_stiffness*largest
      end do
   end subroutine part_supports

   !> Rows and columns that nothing is joined to any more, of a matrix that may not be there.
   pure subroutine part(dof, matrix)
      integer, intent(in) :: dof(:)
      real(wp), intent(inout), optional :: matrix(:, :)

      if (.not. present(matrix)) return
      matrix(abs(dof), :) = 0.0_wp
      matrix(:, abs(dof)) = 0.0_wp
   end subroutine part

   !> A load proportional to a derivative of u_b, of one term.
   pure subroutine add_load(self, term, pull, harmonic_scale, static_scale, model)
      type(base_motion), intent(in) :: self
      integer, intent(in) :: term
      type(pull_type), intent(in) :: pull
      real(wp), intent(in) :: harmonic_scale, static_scale
      type(model_type), intent(inout) :: model
      real(wp) :: parts(2)
      integer :: power, w

      if (.not. any(abs(pull%force) > 0.0_wp)) return
      power = pull%derivative + 1 - self%motion
      ! cos(n omega t + phase), a quarter of a turn for each derivative and for i.
      parts = self%amplitude(term)*turned(self%phase(term) + 90.0_wp*power + &
                                          merge(90.0_wp, 0.0_wp, pull%is_hysteretic))
      if (self%harmonic(term) == 0) then
         ! A constant has no derivatives, and is none but of a constant acceleration.
         if (power == 0 .and. pull%growth == 0 .and. .not. pull%is_hysteretic) then
            model%load_static = model%load_static + static_scale*parts(1)*pull%force
         end if
         return
      end if
      ! The speed is omega/order: a power of the frequency n omega over n order.
      if (pull%growth > 0) then
         parts = parts/(self%harmonic(term)*model%cyclic%speed%order)**pull%growth
         power = power + pull%growth
      end if
      w = model%waves%place(self%harmonic(term), power)
      if (w == 0) then
         call add_wave(self%harmonic(term), power, model%n_dof, model%waves, model%load_wave)
         w = model%waves%n_waves()
      end if
      model%load_wave(:, 2*w - 1) = model%load_wave(:, 2*w - 1) + &
                                    harmonic_scale*parts(1)*pull%force
      model%load_wave(:, 2*w) = model%load_wave(:, 2*w) + harmonic_scale*parts(2)*pull%force
   end subroutine add_load

   !> What is observed, in the frame that is asked for (n_observed, n_dof).
   pure subroutine observe(self, rows)
      class(base_motion), intent(in) :: self
      real(wp), intent(inout) :: rows(:, :)
      real(wp) :: of_base(size(rows, 1))

      if (.not. self%moves_supports()) return
      of_base = matmul(rows, self%carried)
      rows(:, abs(self%dof)) = 0.0_wp
      if (self%frame == frame_absolute) rows(:, abs(self%dof(1))) = of_base*sign(1, self%dof(1))
   end subroutine observe

end module fw_base_motion
