!> Elements whose forces a user's functions give (fw_user_element). The thread that evaluates the
!> balance calls them, one after the other.
module fw_user_law
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_force_law, only: force_workspace, law_facts
   use fw_instant_law, only: element_motion, instant_law, reserve_motion
   use fw_fourier, only: fourier_type
   use fw_kinds, only: wp
   use fw_text, only: to_text
   use fw_user_element, only: bad_number, user_element
   use fw_user_path, only: differentiate_element, follow_element, new_path, not_settled, &
      slopes_of_step
   implicit none (type, external)
   private

   public :: new_user_law, user_law

   !> Step of the differences that stand for slopes, over the size of the input: where round-off and
   !> the square of the step meet.
   real(wp), parameter :: relative_step = 1.0e-5_wp

   type, extends(instant_law) :: user_law
      !> Of all sectors (n_elements): copies, which share the functions and pointers of the user.
      type(user_element), allocatable :: element(:)
   contains
      procedure :: act
      procedure :: reserve_path
      procedure :: differentiate_path
      procedure :: slopes_about
      procedure :: complaint
   end type user_law

contains

   !> Elements of one sector, repeated for as many as there are.
   type(user_law) function new_user_law(element, n_sectors) result(self)
      type(user_element), intent(in) :: element(:)
      integer, intent(in) :: n_sectors
      integer :: i, j, n

      n = size(element)
      call self%take_inputs(maxval([1, element%n_in]), n*n_sectors, .true.)
      allocate (self%element(n*n_sectors))
      do j = 0, n_sectors - 1
         do i = 1, n
            self%element(j*n + i) = element(i)
            self%present(element(i)%n_in + 1:, j*n + i) = .false.
         end do
      end do
      ! As of friction: what a function does between the instants is not known.
      self%facts = law_facts(is_odd=all(element%is_odd))
      self%takes_frequency = .true.
      if (any(element%n_state > 0)) self%remembers = self%element%n_state > 0
      self%needs_scratch = any(element%n_in /= self%n_in) .or. .not. all(element%has_derivative)
   end function new_user_law

   !> Forces of one element at all instants: of one that remembers by its path, of others by one
   !> call of the function. A refusal (`motion%status`) leaves numbers that are not finite, by which
   !> the solvers take the step back as after an overflow; `complaint` says later what it was.
   subroutine act(self, motion)
      class(user_law), intent(in) :: self
      type(element_motion), intent(inout) :: motion
      integer :: i, j, k, n

      n = self%element(motion%element)%n_in
      if (self%element(motion%element)%n_state > 0) then
         call follow_element(self%element(motion%element), motion, motion%path)
      else if (n == self%n_in) then
         call ask(self%element(motion%element), motion, motion%u, motion%v, motion%force, &
                  motion%by_u, motion%by_v)
      else
         ! Functions get arrays of their own size.
         associate (s => motion%scratch)
            do k = 1, motion%n_time
               do j = 1, n
                  s%u((k - 1)*n + j) = motion%u(j, k)
                  s%v((k - 1)*n + j) = motion%v(j, k)
               end do
            end do
            call ask_packed(self%element(motion%element), motion, n, s%u, s%v, s%force, s%by_u, &
                            s%by_v)
            motion%force = 0.0_wp
            do k = 1, motion%n_time
               do j = 1, n
                  motion%force(j, k) = s%force((k - 1)*n + j)
                  if (.not. motion%wants_slopes) cycle
                  do i = 1, n
                     motion%by_u(i, j, k) = s%by_u(((k - 1)*n + j - 1)*n + i)
                     motion%by_v(i, j, k) = s%by_v(((k - 1)*n + j - 1)*n + i)
                  end do
               end do
            end do
         end associate
      end if
      if (motion%status == 0) return
      motion%force = ieee_value(1.0_wp, ieee_quiet_nan)
      motion%by_u = 0.0_wp
      motion%by_v = 0.0_wp
   end subroutine act

   !> Room for the states and their derivatives, of the largest element that remembers.
   subroutine reserve_path(self, fourier, motion)
      class(user_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(inout) :: motion

      if (allocated(self%remembers)) motion%path = new_path(self%element, fourier)
   end subroutine reserve_path

   !> Derivatives of forces by the coefficients of the motion, of an element that remembers: they do
   !> not follow from slopes at the instants.
   subroutine differentiate_path(self, fourier, motion, jacobian)
      class(user_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(inout) :: motion
      real(wp), intent(inout), contiguous :: jacobian(:, :)

      call differentiate_element(self%element(motion%element), fourier, motion, motion%path, &
                                 jacobian)
   end subroutine differentiate_path

   !> Slopes by displacements at rest; of elements that remember, where one step has brought them
   !> there from the unstrained position.
   subroutine slopes_about(self, element, y, slope)
      class(user_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: slope(:, :)
      type(element_motion) :: motion
      integer :: m

      slope = 0.0_wp
      m = self%element(element)%n_in
      if (self%element(element)%n_state > 0) then
         call slopes_of_step(self%element(element), y(:m), slope(:m, :m))
         return
      end if
      call reserve_motion(self%n_in, 1, self%needs_scratch, motion)
      motion%element = element
      motion%omega = 1.0_wp
      motion%wants_slopes = .true.
      motion%u(:, 1) = y(:self%n_in)
      call self%act(motion)
      slope(:self%n_in, :self%n_in) = transpose(motion%by_u(:, :, 1))
   end subroutine slopes_about

   !> Shapes for flat arrays.
   subroutine ask_packed(element, motion, n, u, v, force, by_u, by_v)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer, intent(in) :: n
      real(wp), intent(inout) :: u(n, motion%n_time), v(n, motion%n_time), force(n, motion%n_time)
      real(wp), intent(inout) :: by_u(n, n, motion%n_time), by_v(n, n, motion%n_time)

      call ask(element, motion, u, v, force, by_u, by_v)
   end subroutine ask_packed

   !> Forces, and slopes as the function gives them or by differences of its forces: each input and
   !> each rate is moved at all instants at once, which takes four calls for each input however many
   !> instants there are.
   subroutine ask(element, motion, u, v, force, by_u, by_v)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      real(wp), intent(inout), contiguous :: u(:, :), v(:, :), force(:, :)
      real(wp), intent(inout), contiguous :: by_u(:, :, :), by_v(:, :, :)
      integer :: j

      call element%ask(motion%omega, motion%tau, u, v, &
                       motion%wants_slopes .and. element%has_derivative, force, by_u, by_v, &
                       motion%status, motion%instant)
      if (.not. motion%wants_slopes .or. element%has_derivative) return
      do j = 1, size(u, 1)
         call differ(element, motion, u, v, j, .false., by_u)
         call differ(element, motion, u, v, j, .true., by_v)
      end do
   end subroutine ask

   !> Slopes by one displacement or rate, by central differences.
   subroutine differ(element, motion, u, v, j, of_rate, slope)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      real(wp), intent(inout), contiguous :: u(:, :), v(:, :)
      integer, intent(in) :: j
      logical, intent(in) :: of_rate
      real(wp), intent(inout), contiguous :: slope(:, :, :)
      real(wp) :: step
      integer :: i, k, side

      if (motion%status /= 0) return
      ! By the size of the input over the period; what does not move at all is moved by a small
      ! number, since nothing tells its size.
      step = relative_step*merge(maxval(abs(v(j, :))), maxval(abs(u(j, :))), of_rate)
      if (.not. step > 0.0_wp) step = relative_step
      associate (s => motion%scratch, n => size(u, 1))
         do side = -1, 1, 2
            call move(side*step)
            call ask_once(element, motion, n, u, v, s%other_force)
            call move(-side*step)
            if (motion%status /= 0) return
            do k = 1, motion%n_time
               do i = 1, n
                  if (side == -1) slope(j, i, k) = 0.0_wp
                  slope(j, i, k) = slope(j, i, k) + &
                                   0.5_wp*side*s%other_force((k - 1)*n + i)/step
               end do
            end do
         end do
      end associate

   contains

      subroutine move(by)
         real(wp), intent(in) :: by

         if (of_rate) then
            v(j, :) = v(j, :) + by
         else
            u(j, :) = u(j, :) + by
         end if
      end subroutine move

   end subroutine differ

   !> Forces alone.
   subroutine ask_once(element, motion, n, u, v, force)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer, intent(in) :: n
      real(wp), intent(in), contiguous :: u(:, :), v(:, :)
      real(wp), intent(inout) :: force(n, motion%n_time)
      real(wp) :: none(n, n, 0)

      call element%ask(motion%omega, motion%tau, u, v, .false., force, none, none, motion%status, &
                       motion%instant)
   end subroutine ask_once

   !> What a function that gave no force was asked last.
   subroutine complaint(self, work, text)
      class(user_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      ! allow(C072): a text of the caller
      character(*), intent(out) :: text
      character(40) :: found
      integer :: j

      text = ''
      if (work%refusal%element == 0) return
      associate (r => work%refusal)
         found = 'returned '//to_text(r%status)
         if (r%status == bad_number) found = 'gave no finite number'
         if (r%status == not_settled) found = 'comes to no state that repeats'
         text = 'user law '//trim(self%element(r%element)%name)//' (element '// &
                to_text(r%element)//') '//trim(found)//' at instant '//to_text(r%instant)//', '
         do j = 1, self%element(r%element)%n_in
            if (j > 4) exit
            text = trim(text)//' u = '//to_text(r%u(j))//', v = '//to_text(r%v(j))
            if (j < min(4, self%element(r%element)%n_in)) text = trim(text)//','
         end do
      end associate
   end subroutine complaint

end module fw_user_law
