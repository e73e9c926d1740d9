!> Elements of a user that remember: their state z is stepped from instant to instant,
!>
!>   (z_k, f_k) = step(z_k-1, u_k-1, v_k-1, u_k, v_k),
!>
!> turn after turn until it repeats. The first turn comes from the unstrained element, which is
!> strained to the motion in one step. What has not repeated after a few turns is looked for by
!> Newton's method on z_N(z_0) = z_0, with (I - M) inverted where it is regular: what keeps all that
!> it has come to, as friction that sticks, stays where the turns have left it.
!>
!> Derivatives by the coefficients of the motion are stepped alongside, through all turns.
module fw_user_path
   use fw_fourier, only: fourier_type
   use fw_instant_law, only: element_motion, path_room
   use fw_kinds, only: pi, wp
   use fw_step_room, only: new_step_room, step_room
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   public :: differentiate_element, follow_element, new_path, not_settled, slopes_of_step, &
             step_slopes

   !> The status of a state that does not come to repeat.
   integer, parameter :: not_settled = -1000001
   !> Turns before Newton's method, and its steps.
   integer, parameter :: plain_turns = 4, newton_steps = 40
   !> Change over a turn, relative to the largest state, that is none; and the one that is taken
   !> where round-off lets it fall no further.
   real(wp), parameter :: repeated = 1.0e-12_wp, nearly_repeated = 1.0e-9_wp
   !> Singular values of I - M below it are those of states that stay as they are: of slopes that
   !> are given, and of differences, whose round-off adds up over a turn.
   real(wp), parameter :: singular = 1.0e-9_wp, nearly_singular = 1.0e-7_wp
   !> Step of differences that stand for slopes, over the size of the input.
   real(wp), parameter :: relative_step = 1.0e-5_wp

contains

   !> Room for each element and for the largest of them, and the base functions with their rates by
   !> tau: nothing is allocated while elements are stepped.
   type(path_room) function new_path(element, fourier) result(self)
      type(user_element), intent(in) :: element(:)
      type(fourier_type), intent(in) :: fourier
      integer :: h, i, k, m, n, n_slope

      self%n_time = fourier%n_time
      self%n_coefficients = fourier%n_coefficients
      self%wave = fourier%synthesis
      allocate (self%rate, mold=self%wave)
      self%rate = 0.0_wp
      do h = 1, fourier%n_retained
         if (fourier%harmonic(h) == 0) cycle
         k = fourier%column(h)
         self%rate(k, :) = -fourier%harmonic(h)*self%wave(k + 1, :)
         self%rate(k + 1, :) = fourier%harmonic(h)*self%wave(k, :)
      end do
      n_slope = 0
      do i = 1, size(element)
         n_slope = max(n_slope, (element(i)%n_state + 4*element(i)%n_in)* &
                       (element(i)%n_state + element(i)%n_in))
      end do
      n = maxval(element%n_state)
      m = maxval(element%n_in)
      allocate (self%state(n*(fourier%n_time + 1)), self%slope(n_slope*(fourier%n_time + 1)), &
                self%by_motion(n*m*fourier%n_coefficients), &
                self%carried(n*m*fourier%n_coefficients), &
                self%next(n*fourier%n_coefficients), source=0.0_wp)
      allocate (self%step(size(element)))
      do i = 1, size(element)
         self%step(i) = new_step_room(element(i)%n_state, element(i)%n_in)
      end do
   end function new_path

   !> Forces over the period that repeats.
   subroutine follow_element(element, motion, path)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      type(path_room), intent(inout) :: path

      call settle(element, motion, path, element%n_state, element%n_in, .false., path%state, &
                  path%slope, path%by_motion, path%carried, path%next, path%step(motion%element))
   end subroutine follow_element

   !> The same, and the derivative of the forces by the coefficients of the inputs, transposed.
   subroutine differentiate_element(element, fourier, motion, path, jacobian)
      type(user_element), intent(in) :: element
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(inout) :: motion
      type(path_room), intent(inout) :: path
      real(wp), intent(inout), contiguous :: jacobian(:, :)

      jacobian = 0.0_wp
      call settle(element, motion, path, element%n_state, element%n_in, .true., path%state, &
                  path%slope, path%by_motion, path%carried, path%next, path%step(motion%element))
      if (motion%status /= 0) return
      call collect(fourier, motion, path, element%n_state, element%n_in, path%slope, &
                   path%by_motion, path%next, jacobian)
   end subroutine differentiate_element

   !> States of the turn that repeats; of it slopes and derivatives of the state before it, where
   !> these are wanted.
   subroutine settle(element, motion, path, n, m, differentiates, state, slope, by_motion, &
                     carried, next, room)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      type(path_room), intent(in) :: path
      !> States and inputs.
      integer, intent(in) :: n, m
      logical, intent(in) :: differentiates
      real(wp), intent(inout) :: state(n, 0:motion%n_time)
      real(wp), intent(inout) :: slope(n + 4*m, n + m, 0:motion%n_time)
      real(wp), intent(inout), dimension(path%n_coefficients, n, m) :: by_motion, carried
      real(wp), intent(inout) :: next(path%n_coefficients, n)
      type(step_room), intent(inout) :: room
      real(wp) :: last, apart
      integer :: i, j, k, turn
      logical :: done, wants

      do j = 1, m
         room%sizes([j, 2*m + j]) = maxval(abs(motion%u(j, :)))
         room%sizes([m + j, 3*m + j]) = maxval(abs(motion%v(j, :)))
      end do
      call strain(element, motion, n, m, differentiates, room, state(:, 0), slope(:, :, 0))
      if (motion%status /= 0) return
      if (differentiates) then
         by_motion = 0.0_wp
         call carry(path, motion%omega, n, m, 0, slope(:, :, 0), by_motion, next)
      end if
      apart = huge(1.0_wp)
      do turn = 1, plain_turns + newton_steps
         wants = differentiates .or. turn > plain_turns
         call march(element, motion, n, m, wants, room, state, slope)
         if (motion%status /= 0) return
         ! A turn has repeated where all states have; where round-off of the function lets them fall
         ! no further, the last change counts, if it is small.
         room%change = state(:, motion%n_time) - state(:, 0)
         last = apart
         apart = share_of(room%change, state)
         done = apart <= repeated .or. (turn > plain_turns .and. apart <= nearly_repeated .and. &
                                        apart >= 0.5_wp*last)
         if (done .and. .not. differentiates) return
         if (wants) call invert(n, m, motion%n_time, state, slope, &
                                merge(singular, nearly_singular, element%has_derivative), room)
         if (differentiates) then
            carried = by_motion
            do k = 1, motion%n_time
               call carry(path, motion%omega, n, m, k, slope(:, :, k), carried, next)
            end do
            if (done .or. turn > plain_turns) then
               ! Of the turn that repeats: dz_0 = dN/(1 - M).
               carried = carried - by_motion
               do j = 1, m
                  do i = 1, n
                     do k = 1, n
                        by_motion(:, k, j) = by_motion(:, k, j) + &
                                             room%inverse(k, i)*carried(:, i, j)
                     end do
                  end do
               end do
            else
               by_motion = carried
            end if
         end if
         if (done) return
         ! A plain turn goes on where the last one ended; Newton's method goes where it will repeat.
         do i = 1, n
            if (turn > plain_turns) then
               state(:, 0) = state(:, 0) + room%inverse(:, i)*room%change(i)
            else
               state(i, 0) = state(i, 0) + room%change(i)
            end if
         end do
      end do
      motion%status = not_settled
      motion%instant = 1
   end subroutine settle

   !> Change of the states over a turn, each over the largest value that it takes.
   pure real(wp) function share_of(change, state) result(share)
      real(wp), intent(in) :: change(:), state(:, :)
      integer :: i

      share = 0.0_wp
      do i = 1, size(change)
         if (abs(change(i)) > 0.0_wp) share = max(share, abs(change(i))/maxval(abs(state(i, :))))
      end do
   end function share_of

   !> From the unstrained element to the motion where the first step begins.
   subroutine strain(element, motion, n, m, wants, room, state, slope)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer, intent(in) :: n, m
      logical, intent(in) :: wants
      type(step_room), intent(inout) :: room
      real(wp), intent(out) :: state(n)
      real(wp), intent(inout) :: slope(n + 4*m, n + m)
      integer :: last

      last = motion%n_time
      room%u(:, 1) = 0.0_wp
      room%v(:, 1) = 0.0_wp
      room%u(:, 2) = motion%u(:m, last)
      room%v(:, 2) = motion%v(:m, last)
      room%tau(2) = -2.0_wp*pi/last
      room%tau(1) = 2.0_wp*room%tau(2)
      call one_step(element, motion, last, n, m, wants, room, element%start, slope)
      state = room%after(:n)
   end subroutine strain

   !> One turn.
   subroutine march(element, motion, n, m, wants, room, state, slope)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer, intent(in) :: n, m
      logical, intent(in) :: wants
      type(step_room), intent(inout) :: room
      real(wp), intent(inout) :: state(n, 0:motion%n_time)
      real(wp), intent(inout) :: slope(n + 4*m, n + m, 0:motion%n_time)
      integer :: before, k

      motion%force = 0.0_wp
      do k = 1, motion%n_time
         before = merge(motion%n_time, k - 1, k == 1)
         room%u(:, 1) = motion%u(:m, before)
         room%u(:, 2) = motion%u(:m, k)
         room%v(:, 1) = motion%v(:m, before)
         room%v(:, 2) = motion%v(:m, k)
         room%tau(2) = motion%tau(k)
         room%tau(1) = room%tau(2) - 2.0_wp*pi/motion%n_time
         call one_step(element, motion, k, n, m, wants, room, state(:, k - 1), slope(:, :, k))
         if (motion%status /= 0) return
         state(:, k) = room%after(:n)
         motion%force(:m, k) = room%after(n + 1:)
      end do
   end subroutine march

   !> A step from the inputs of the room to what is after it, with slopes that are given or by
   !> differences.
   subroutine one_step(element, motion, k, n, m, wants, room, state, slope)
      type(user_element), intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer, intent(in) :: k, n, m
      logical, intent(in) :: wants
      type(step_room), intent(inout) :: room
      real(wp), intent(in) :: state(n)
      real(wp), intent(inout) :: slope(n + 4*m, n + m)

      motion%instant = k
      call element%ask_step(motion%omega, room%tau, room%u, room%v, &
                            wants .and. element%has_derivative, state, room%after, slope, &
                            motion%status, room%answer)
      if (motion%status /= 0 .or. .not. wants .or. element%has_derivative) return
      room%scale(:n) = max(maxval(abs(state)), maxval(abs(room%after(:n))))
      room%scale(n + 1:) = room%sizes
      ! Where there is none, nothing tells a size.
      where (.not. room%scale > 0.0_wp) room%scale = 1.0_wp
      call step_slopes(element, motion%omega, state, relative_step, room, slope, motion%status)
   end subroutine one_step

   !> Slopes by the displacements (force, displacement), where one step has brought the unstrained
   !> element to a position at rest.
   subroutine slopes_of_step(element, y, slope)
      type(user_element), intent(in) :: element
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: slope(:, :)
      type(step_room) :: room
      real(wp) :: by(element%n_state + 4*size(y), element%n_state + size(y))
      integer :: m, n, status

      n = element%n_state
      m = size(y)
      room = new_step_room(n, m)
      slope = 0.0_wp
      room%tau(2) = 2.0_wp*pi
      room%u(:, 2) = y
      by = 0.0_wp
      if (element%has_derivative) then
         call element%ask_step(1.0_wp, room%tau, room%u, room%v, .true., element%start, &
                               room%after, by, status, room%answer)
      else
         room%scale = maxval(abs(y))
         if (.not. maxval(room%scale) > 0.0_wp) room%scale = 1.0_wp
         call step_slopes(element, 1.0_wp, element%start, relative_step, room, by, status)
      end if
      if (status == 0) slope = transpose(by(n + 2*m + 1:n + 3*m, n + 1:))
   end subroutine slopes_of_step

   !> Central differences of a step from the inputs of the room.
   subroutine step_slopes(element, omega, state, relative, room, slope, status)
      type(user_element), intent(in) :: element
      real(wp), intent(in) :: omega
      real(wp), intent(in), contiguous :: state(:)
      !> Of the steps, over the scales of the room.
      real(wp), intent(in) :: relative
      type(step_room), intent(inout) :: room
      !> As of `ask_step`.
      real(wp), intent(inout), contiguous :: slope(:, :)
      integer, intent(out) :: status
      real(wp) :: shift, lower, upper
      integer :: j

      do j = 1, size(room%scale)
         shift = relative*room%scale(j)
         call at(shift, upper)
         call element%ask_step(omega, room%tau, room%u_at, room%v_at, .false., room%state_at, &
                               room%ahead, room%none, status, room%answer)
         if (status /= 0) return
         call at(-shift, lower)
         call element%ask_step(omega, room%tau, room%u_at, room%v_at, .false., room%state_at, &
                               room%behind, room%none, status, room%answer)
         if (status /= 0) return
         ! By what the number has moved in this precision: a state that stays has a slope of 1.
         slope(j, :) = (room%ahead - room%behind)/(upper - lower)
      end do

   contains

      subroutine at(by, value)
         real(wp), intent(in) :: by
         !> Of the number that is moved.
         real(wp), intent(out) :: value
         integer :: i, m

         m = size(room%u, 1)
         room%state_at = state
         room%u_at = room%u
         room%v_at = room%v
         i = j - size(state)
         if (i <= 0) then
            call move(room%state_at(j), by, value)
         else if (i <= m) then
            call move(room%u_at(i, 1), by, value)
         else if (i <= 2*m) then
            call move(room%v_at(i - m, 1), by, value)
         else if (i <= 3*m) then
            call move(room%u_at(i - 2*m, 2), by, value)
         else
            call move(room%v_at(i - 3*m, 2), by, value)
         end if
      end subroutine at

   end subroutine step_slopes

   pure subroutine move(number, by, value)
      real(wp), intent(inout) :: number
      real(wp), intent(in) :: by
      real(wp), intent(out) :: value

      number = number + by
      value = number
   end subroutine move

   !> Derivatives of the state by coefficients through step k (0: the strain).
   pure subroutine carry(path, omega, n, m, k, slope, by_motion, next)
      type(path_room), intent(in) :: path
      real(wp), intent(in) :: omega
      integer, intent(in) :: n, m, k
      real(wp), intent(in) :: slope(n + 4*m, n + m)
      real(wp), intent(inout) :: by_motion(path%n_coefficients, n, m)
      real(wp), intent(inout) :: next(path%n_coefficients, n)
      integer :: i, j

      do j = 1, m
         do i = 1, n
            call through(path, omega, n, m, k, j, slope(:, i), by_motion(:, :, j), next(:, i))
         end do
         by_motion(:, :, j) = next
      end do
   end subroutine carry

   !> What follows from a step by the coefficients of input j: through the state before it, and
   !> through the motion at both ends.
   pure subroutine through(path, omega, n, m, k, j, slope, by_motion, value)
      type(path_room), intent(in) :: path
      real(wp), intent(in) :: omega
      integer, intent(in) :: n, m, k, j
      !> Of one number after the step.
      real(wp), intent(in) :: slope(n + 4*m)
      real(wp), intent(in) :: by_motion(path%n_coefficients, n)
      real(wp), intent(out) :: value(path%n_coefficients)
      integer :: after, before, i

      after = merge(path%n_time, k, k == 0)
      value = slope(n + 2*m + j)*path%wave(:, after) + &
              omega*slope(n + 3*m + j)*path%rate(:, after)
      if (k > 0) then
         before = merge(path%n_time, k - 1, k == 1)
         value = value + slope(n + j)*path%wave(:, before) + &
                 omega*slope(n + m + j)*path%rate(:, before)
      end if
      do i = 1, n
         value = value + slope(i)*by_motion(:, i)
      end do
   end subroutine through

   !> Derivatives of the forces over the turn that repeats, and of their coefficients.
   subroutine collect(fourier, motion, path, n, m, slope, by_motion, next, jacobian)
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(in) :: motion
      type(path_room), intent(in) :: path
      integer, intent(in) :: n, m
      real(wp), intent(in) :: slope(n + 4*m, n + m, 0:motion%n_time)
      !> Before the first step; after the last one at the end.
      real(wp), intent(inout) :: by_motion(path%n_coefficients, n, m)
      real(wp), intent(inout) :: next(path%n_coefficients, n)
      real(wp), intent(inout), contiguous :: jacobian(:, :)
      integer :: c, i, j, k, nc

      nc = path%n_coefficients
      do k = 1, motion%n_time
         do i = 1, m
            do j = 1, m
               call through(path, motion%omega, n, m, k, j, slope(:, n + i, k), &
                            by_motion(:, :, j), next(:, 1))
               do c = 1, nc
                  jacobian((j - 1)*nc + 1:j*nc, (i - 1)*nc + c) = &
                     jacobian((j - 1)*nc + 1:j*nc, (i - 1)*nc + c) + &
                     fourier%analysis(c, k)*next(:, 1)
               end do
            end do
         end do
         call carry(path, motion%omega, n, m, k, slope(:, :, k), by_motion, next)
      end do
   end subroutine collect

   !> Inverse of I - M, of a turn, on what does not stay as it is: by its singular values, which
   !> rotations of its columns give (Hestenes).
   subroutine invert(n, m, n_time, state, slope, least, room)
      integer, intent(in) :: n, m, n_time
      real(wp), intent(in) :: state(n, 0:n_time)
      real(wp), intent(in) :: slope(n + 4*m, n + m, 0:n_time)
      !> Singular values that are none.
      real(wp), intent(in) :: least
      type(step_room), intent(inout) :: room
      real(wp) :: length
      integer :: i, j, k

      associate (turn => room%turn, left => room%left, right => room%right, scale => room%size)
         ! States may have different units.
         do i = 1, n
            scale(i) = maxval(abs(state(i, :)))
            if (.not. scale(i) > 0.0_wp) scale(i) = 1.0_wp
         end do
         turn = 0.0_wp
         do i = 1, n
            turn(i, i) = 1.0_wp
         end do
         right = turn
         do k = 1, n_time
            do j = 1, n
               do i = 1, n
                  left(i, j) = dot_product(slope(:n, i, k), turn(:, j))
               end do
            end do
            turn = left
         end do
         do i = 1, n
            left(:, i) = right(:, i) - turn(:, i)*scale(i)/scale
         end do
         call rotate(n, left, right, room%column)
         room%inverse = 0.0_wp
         do i = 1, n
            length = norm2(left(:, i))
            if (length <= least) cycle
            do k = 1, n
               room%inverse(:, k) = room%inverse(:, k) + &
                                    scale*right(:, i)*left(k, i)/(length**2*scale(k))
            end do
         end do
      end associate
   end subroutine invert

   !> Columns at right angles to each other, by rotations that are gathered.
   pure subroutine rotate(n, a, gathered, column)
      integer, intent(in) :: n
      real(wp), intent(inout), dimension(n, n) :: a, gathered
      !> Room.
      real(wp), intent(inout) :: column(n)
      integer, parameter :: most_sweeps = 40
      real(wp) :: along, c, s, t, x
      integer :: i, j, sweep
      logical :: turned

      do sweep = 1, most_sweeps
         turned = .false.
         do i = 1, n - 1
            do j = i + 1, n
               along = dot_product(a(:, i), a(:, j))
               if (abs(along) <= epsilon(1.0_wp)*norm2(a(:, i))*norm2(a(:, j))) cycle
               turned = .true.
               x = (dot_product(a(:, j), a(:, j)) - dot_product(a(:, i), a(:, i)))/(2.0_wp*along)
               t = sign(1.0_wp, x)/(abs(x) + sqrt(1.0_wp + x**2))
               c = 1.0_wp/sqrt(1.0_wp + t**2)
               s = c*t
               column = a(:, i)
               a(:, i) = c*column - s*a(:, j)
               a(:, j) = s*column + c*a(:, j)
               column = gathered(:, i)
               gathered(:, i) = c*column - s*gathered(:, j)
               gathered(:, j) = s*column + c*gathered(:, j)
            end do
         end do
         if (.not. turned) exit
      end do
   end subroutine rotate

end module fw_user_path
