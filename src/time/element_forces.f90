!> Forces of elements that are neither pairs nor springs (dampers, polynomials, laws of a user
!> without states), at one instant after the other of an integration in time.
module fw_element_forces
   use fw_elements, only: element_list
   use fw_force_law, only: force_law, force_workspace
   use fw_instant_law, only: as_instant_law, element_motion, instant_law, reserve_motion
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_side, only: add_side
   implicit none (type, external)
   private

   public :: element_forces, new_element_forces, note_refusal

   !> The elements of one kind.
   type :: forces_of_kind
      class(instant_law), allocatable :: law
      !> Rows of B transposed, of the inputs of one element after the other (n_dof, inputs of all).
      real(wp), allocatable :: rows(:, :)
      !> What a unit force does to the accelerations: the same times the inverse of the mass, in
      !> the unit of whoever integrates.
      real(wp), allocatable :: push(:, :)
      type(element_motion), allocatable :: motion
   end type forces_of_kind

   type :: element_forces
      type(forces_of_kind), allocatable :: kind(:)
      !> What the last law said that had no force for a motion; 0: all had one, above 0 the run is
      !> to end. And that in words.
      integer :: status = 0
      !> Motions that had none so far: a few are steps that were too long, many a wall that shorter
      !> and shorter steps run against.
      integer :: n_refused = 0
      character(400) :: complaint = ''
   contains
      procedure :: add
   end type element_forces

contains

   !> The laws of the elements of a case; `kind` is empty where it has none.
   subroutine new_element_forces(elements, model, self)
      type(element_list), intent(in) :: elements
      type(model_type), intent(in) :: model
      type(element_forces), intent(out) :: self
      class(force_law), allocatable :: law
      integer :: c, e, k, n

      n = 0
      if (allocated(elements%slot)) then
         n = count([(elements%slot(k)%group%n_elements > 0, k=1, size(elements%slot))])
      end if
      allocate (self%kind(n))
      if (n == 0) return
      n = 0
      do k = 1, size(elements%slot)
         associate (group => elements%slot(k)%group)
            if (group%n_elements == 0) cycle
            n = n + 1
            call group%make_law(1, law)
            call as_instant_law(law, self%kind(n)%law)
            allocate (self%kind(n)%rows(model%n_dof, group%n_in*group%n_elements), source=0.0_wp)
            do e = 1, group%n_elements
               do c = 1, group%n_in
                  associate (row => self%kind(n)%rows(:, (e - 1)*group%n_in + c))
                     call add_side(group%row_side_1(c, e), 1.0_wp, row, model%rows)
                     call add_side(group%row_side_2(c, e), -1.0_wp, row, model%rows)
                  end associate
               end do
            end do
            allocate (self%kind(n)%motion)
            call reserve_motion(group%n_in, 1, self%kind(n)%law%needs_scratch, self%kind(n)%motion)
         end associate
      end do
   end subroutine new_element_forces

   !> Take what the elements push with away from the accelerations.
   subroutine add(self, tau, omega, displacement, rate, acceleration)
      class(element_forces), intent(inout) :: self
      !> omega t, and the frequency of the load [rad/s].
      real(wp), intent(in) :: tau, omega
      !> (n_dof), and by time.
      real(wp), intent(in) :: displacement(:), rate(:)
      real(wp), intent(inout) :: acceleration(:)
      integer :: c, e, k, r

      self%status = 0
      do k = 1, size(self%kind)
         associate (kind => self%kind(k), motion => self%kind(k)%motion)
            motion%omega = omega
            motion%tau(1) = tau
            do e = 1, kind%law%n_elements
               motion%element = e
               do c = 1, kind%law%n_in
                  r = (e - 1)*kind%law%n_in + c
                  motion%u(c, 1) = dot_product(kind%rows(:, r), displacement)
                  motion%v(c, 1) = dot_product(kind%rows(:, r), rate)
               end do
               call kind%law%act(motion)
               if (motion%status /= 0) then
                  call note_refusal(kind%law, motion, self)
                  return
               end if
               do c = 1, kind%law%n_in
                  r = (e - 1)*kind%law%n_in + c
                  acceleration = acceleration - motion%force(c, 1)*kind%push(:, r)
               end do
            end do
         end associate
      end do
   end subroutine add

   !> A motion that a law has no force for.
   subroutine note_refusal(law, motion, self)
      class(instant_law), intent(in) :: law
      type(element_motion), intent(inout) :: motion
      class(element_forces), intent(inout) :: self
      type(force_workspace) :: work
      integer :: n

      self%status = motion%status
      self%n_refused = self%n_refused + 1
      motion%status = 0
      n = min(law%n_in, size(work%refusal%u))
      work%refusal%element = motion%element
      work%refusal%instant = 1
      work%refusal%status = self%status
      work%refusal%omega = motion%omega
      work%refusal%u(:n) = motion%u(:n, 1)
      work%refusal%v(:n) = motion%v(:n, 1)
      call law%complaint(work, self%complaint)
   end subroutine note_refusal

end module fw_element_forces
