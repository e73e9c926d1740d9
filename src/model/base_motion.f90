!> Motion of the base, u_b cos(n omega t + phase) in any harmonic, as group &base gives it: of some
!> dofs, the supports, or of the ground in a direction R of all dofs.
!>
!> The structure moves by u = y + R u_b, and y is what is solved for. With K, M and C the matrices,
!> the load of y is
!>
!>   supports:  -(K R) u_b - (C R) u_b' - (M R) u_b''   on the other dofs, R = 1 at the supports,
!>   ground:    -M R u_b''                              (the ground goes along with R).
!>
!> u_b, its velocity or its acceleration is given: these are waves of powers 0, 1, 2 of the
!> frequency, or down to -1, -2.
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
      procedure :: moves_supports
      procedure :: moves_with_frame
      procedure :: apply
      procedure :: observe
   end type base_motion

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
      call keys%bind(key('dof', 'supports, dofs that move alike; negative: the other way', &
                         dof_numbers(), shape=':', repeats=.false., &
                         absent='of the file, else direction'), given)
      if (allocated(given)) call move_alloc(given, self%dof)
      call keys%bind(key('direction', 'motion of all dofs with the ground, in place of dof', &
                         shape='n_dof', repeats=.false., absent='of the file'), self%direction)
      call keys%bind_word(key('motion', 'what the amplitudes are of'), self%motion, motion_words)
      call keys%bind(key('harmonic', '0 to n_harmonics', from_to(0, most_harmonic), &
                         shape='n_terms'), self%harmonic, default=1)
      call keys%bind(key('amplitude', 'of each term, over the units of time to the first or '// &
                         'second power for a velocity or an acceleration', unit='L', &
                         shape='n_terms', absent='required with n_terms'), self%amplitude, needed)
      call keys%bind(key('phase', 'of cos(n omega t + phase)', unit='degrees', &
                         shape='n_terms'), self%phase, default=0.0_wp)
      call keys%bind_word(key('frame', 'what is observed: motion beside the base, or with it '// &
                              '(supports alone)'), self%frame, frame_words)
   end subroutine bind_keys

   !> Whether dofs of the model are given a motion.
   pure logical function moves_supports(self)
      class(base_motion), intent(in) :: self

      moves_supports = self%n_terms > 0 .and. allocated(self%dof)
   end function moves_supports

   !> Whether motion with the base is observed.
   pure logical function moves_with_frame(self)
      class(base_motion), intent(in) :: self

      moves_with_frame = self%frame == frame_absolute
   end function moves_with_frame

   !> From a structure with its supports to the one whose motion beside the base is solved for: the
   !> load of the base, and supports that nothing is joined to. Where motion with the base is
   !> observed the first support has a load of its own that moves it by u_b.
   pure subroutine apply(self, harmonic_scale, static_scale, model)
      class(base_motion), intent(in) :: self
      real(wp), intent(in) :: harmonic_scale, static_scale
      !> With its matrices and loads, without modal damping.
      type(model_type), intent(inout) :: model
      !> K R, C R, M R, and the load that moves the first support.
      real(wp) :: pulled(model%n_dof, 0:2), driven(model%n_dof)
      integer :: i, k

      if (self%n_terms == 0) return
      pulled = 0.0_wp
      driven = 0.0_wp
      pulled(:, 2) = matmul(model%mass, self%carried)
      if (self%moves_supports()) then
         pulled(:, 0) = matmul(model%stiffness, self%carried)
         pulled(:, 1) = matmul(model%damping, self%carried)
         pulled(abs(self%dof), :) = 0.0_wp
         call part_supports(self, model)
         if (self%frame == frame_absolute) then
            i = abs(self%dof(1))
            driven(i) = model%stiffness(i, i)*sign(1, self%dof(1))
         end if
      end if
      call note_motion(self, model)
      do i = 1, self%n_terms
         do k = 0, 2
            call add_load(self, i, k, -pulled(:, k), harmonic_scale, static_scale, model)
         end do
         call add_load(self, i, 0, driven, harmonic_scale, static_scale, model)
      end do
   end subroutine apply

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
      do j = 1, size(self%dof)
         i = abs(self%dof(j))
         model%stiffness(i, :) = 0.0_wp
         model%stiffness(:, i) = 0.0_wp
         model%mass(i, :) = 0.0_wp
         model%mass(:, i) = 0.0_wp
         model%damping(i, :) = 0.0_wp
         model%damping(:, i) = 0.0_wp
         model%stiffness(i, i) = support_stiffness*largest
      end do
   end subroutine part_supports

   !> A load proportional to the k-th derivative of u_b, of one term.
   pure subroutine add_load(self, term, k, load, harmonic_scale, static_scale, model)
      type(base_motion), intent(in) :: self
      integer, intent(in) :: term, k
      real(wp), intent(in) :: load(:), harmonic_scale, static_scale
      type(model_type), intent(inout) :: model
      real(wp) :: part(2)
      integer :: power, w

      if (.not. any(abs(load) > 0.0_wp)) return
      power = k + 1 - self%motion
      ! cos(n omega t + phase), a quarter of a turn for each derivative.
      part = self%amplitude(term)*turned(self%phase(term) + 90.0_wp*power)
      if (self%harmonic(term) == 0) then
         ! A constant has no derivatives, and is none but of a constant acceleration.
         if (power == 0) model%load_static = model%load_static + static_scale*part(1)*load
         return
      end if
      w = model%waves%place(self%harmonic(term), power)
      if (w == 0) then
         call add_wave(self%harmonic(term), power, model%n_dof, model%waves, model%load_wave)
         w = model%waves%n_waves()
      end if
      model%load_wave(:, 2*w - 1) = model%load_wave(:, 2*w - 1) + harmonic_scale*part(1)*load
      model%load_wave(:, 2*w) = model%load_wave(:, 2*w) + harmonic_scale*part(2)*load
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
