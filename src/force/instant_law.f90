!> Laws whose forces at an instant follow from the displacements of an element, and their rates, at
!> the same instant: by alternating frequency/time,
!>
!>   f_i = T f_i(u(tau), v(tau)),   G_ij = T (df_i/du_j E + omega df_i/dv_j E'),   v = omega u'.
!>
!> A law that extends this one gives forces and slopes of one element at all instants, `act`; the
!> rest is here. Components are the displacements; their rates are made of them here, so that the
!> forces depend on the frequency by themselves (`by_frequency`).
module fw_instant_law
   use fw_force_law, only: force_law, force_workspace, law_room, pair_mixed
   use fw_fourier, only: fourier_type
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dgemm
   use fw_step_room, only: step_room
   use fw_wave_sums, only: wave_sums, wave_table
   implicit none (type, external)
   private

   public :: as_instant_law, instant_law, element_motion, path_room, reserve_motion

   !> Instants of one product: enough for the speed of dgemm, few enough for the cache.
   integer, parameter :: block = 64

   !> Room for the same numbers one behind the other, where a law asks for it.
   type :: motion_scratch
      real(wp), allocatable :: u(:), v(:), force(:), other_force(:), by_u(:), by_v(:)
   end type motion_scratch

   !> Room of a law whose elements remember (see `differentiate_path` and fw_user_path).
   type :: path_room
      integer :: n_time = 0, n_coefficients = 0
      !> Base functions at the instants, and their rates by tau (n_coefficients, n_time).
      real(wp), allocatable :: wave(:, :), rate(:, :)
      !> For the largest element: states (0 to n_time), slopes of steps, derivatives of states by
      !> coefficients of the inputs, before and after a turn and a step.
      real(wp), allocatable :: state(:), slope(:), by_motion(:), carried(:), next(:)
      !> For each element (n_elements).
      type(step_room), allocatable :: step(:)
   end type path_room

   !> One element over the period: what it is asked, and what it answers. Inputs stand innermost.
   type :: element_motion
      integer :: element = 0, n_time = 0
      !> omega t at the instants.
      real(wp), allocatable :: tau(:)
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      !> Displacements and rates by time (n_in, n_time).
      real(wp), allocatable :: u(:, :), v(:, :)
      !> Forces on the left-hand side of the equation of motion (n_in, n_time).
      real(wp), allocatable :: force(:, :)
      !> Whether the slopes are wanted: of force i by displacement j and by rate j
      !> (j, i, instant). What is not set is zero.
      logical :: wants_slopes = .false.
      real(wp), allocatable :: by_u(:, :, :), by_v(:, :, :)
      !> Other than 0 where there is no force, and the instant where that shows: above 0 the run is
      !> to end.
      integer :: status = 0, instant = 1
      type(motion_scratch), allocatable :: scratch
      type(path_room), allocatable :: path
   end type element_motion

   type, extends(law_room) :: instant_room
      type(element_motion) :: motion
      !> Rates: coefficients and values at the instants, as predictions of the workspace.
      real(wp), allocatable :: rate(:, :, :), rate_time(:, :, :)
      type(wave_sums), allocatable :: sums
      type(wave_table), allocatable :: waves
      !> Slopes at the instants (n_time); where sums of waves do not serve, slopes of a block times
      !> the base functions there (n_coefficients, block).
      real(wp), allocatable :: slope(:), sloped(:, :)
      !> G of a rate (n_coefficients, n_coefficients), input first.
      real(wp), allocatable :: gain(:, :)
   end type instant_room

   type, abstract, extends(force_law) :: instant_law
      integer :: n_in = 0
      logical :: takes_rates = .false.
      !> Slopes by displacements are those of a potential: df_i/du_j = df_j/du_i.
      logical :: has_potential = .false.
      logical :: needs_scratch = .false.
      !> Forces may follow from the frequency by more than the rates.
      logical :: takes_frequency = .false.
      !> Elements whose forces follow from the whole motion (n_elements); unallocated: none.
      logical, allocatable :: remembers(:)
   contains
      procedure :: take_inputs
      procedure :: reserve
      procedure :: evaluate
      procedure :: linearize
      procedure :: slopes_about
      procedure :: by_frequency
      procedure :: take_motion
      procedure :: reserve_path
      procedure :: differentiate_path
      procedure(act_interface), deferred :: act
   end type instant_law

   abstract interface
      !> Forces of one element at all instants, and the slopes where they are wanted. Allocates
      !> nothing.
      subroutine act_interface(self, motion)
         import :: instant_law, element_motion
         implicit none (type, external)
         class(instant_law), intent(in) :: self
         type(element_motion), intent(inout) :: motion
      end subroutine act_interface
   end interface

contains

   !> A law that is one of these, as such; not allocated otherwise.
   subroutine as_instant_law(law, self)
      class(force_law), intent(in) :: law
      class(instant_law), allocatable, intent(out) :: self

      select type (law)
      class is (instant_law)
         allocate (self, source=law)
      end select
   end subroutine as_instant_law

   !> Elements of so many inputs each.
   pure subroutine take_inputs(self, n_in, n_elements, takes_rates)
      class(instant_law), intent(inout) :: self
      integer, intent(in) :: n_in, n_elements
      logical, intent(in) :: takes_rates
      logical :: present(n_in, n_elements)

      present = .true.
      call self%take_elements(present)
      self%n_in = n_in
      self%takes_rates = takes_rates
      self%prediction%stiffness = 1.0_wp
      self%prediction%has_frequency = takes_rates
   end subroutine take_inputs

   subroutine reserve(self, fourier, work)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(out) :: work
      type(instant_room), allocatable :: room
      integer :: n

      call work%reserve(self%n_elements, self%n_components, fourier)
      allocate (room)
      n = self%n_components*fourier%n_coefficients
      allocate (work%jacobian(n, n, self%n_elements), source=0.0_wp)
      call reserve_motion(self%n_in, fourier%n_time, self%needs_scratch, room%motion)
      call self%reserve_path(fourier, room%motion)
      allocate (room%slope(fourier%n_time))
      if (self%takes_rates) then
         allocate (room%rate, source=work%prediction)
         allocate (room%rate_time, source=work%prediction_time)
         allocate (room%gain(fourier%n_coefficients, fourier%n_coefficients))
      end if
      if (fourier%projects) then
         allocate (room%waves, room%sums)
         call room%waves%build(fourier)
         call room%sums%reserve(room%waves)
      else
         allocate (room%sloped(fourier%n_coefficients, block))
      end if
      call move_alloc(room, work%room)
   end subroutine reserve

   !> Room for elements that remember: no law has such by itself.
   subroutine reserve_path(self, fourier, motion)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(inout) :: motion

      associate (unused => self, neither => fourier, nor => motion)
      end associate
   end subroutine reserve_path

   !> The derivative of an element that remembers, transposed: coefficients of input j, then of
   !> force i.
   subroutine differentiate_path(self, fourier, motion, jacobian)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(element_motion), intent(inout) :: motion
      real(wp), intent(inout), contiguous :: jacobian(:, :)

      associate (unused => self, neither => fourier, nor => motion, none => jacobian)
      end associate
   end subroutine differentiate_path

   !> Room for one element over the period, and for the numbers one behind the other where they are
   !> wanted.
   pure subroutine reserve_motion(n_in, n_time, with_scratch, motion)
      integer, intent(in) :: n_in, n_time
      logical, intent(in) :: with_scratch
      type(element_motion), intent(out) :: motion
      integer :: k, n

      motion%tau = [(2.0_wp*pi*real(k, wp)/real(n_time, wp), k=0, n_time - 1)]
      if (with_scratch) then
         n = n_in*n_time
         allocate (motion%scratch)
         associate (s => motion%scratch)
            allocate (s%u(n), s%v(n), s%force(n), s%other_force(n), source=0.0_wp)
            allocate (s%by_u(n_in*n), s%by_v(n_in*n), source=0.0_wp)
         end associate
      end if
      motion%n_time = n_time
      allocate (motion%u(n_in, n_time), motion%v(n_in, n_time), motion%force(n_in, n_time), &
                source=0.0_wp)
      allocate (motion%by_u(n_in, n_in, n_time), motion%by_v(n_in, n_in, n_time), source=0.0_wp)
   end subroutine reserve_motion

   !> Forces of all elements: to the instants, element by element, and back. A refusal is noted with
   !> its place, and the others are gone through all the same, since a later one may end the run.
   subroutine evaluate(self, fourier, work)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: c, i, k

      if (self%n_elements == 0) return
      work%failed = 0
      call fourier%to_time(self%n_elements*self%n_components, work%prediction, &
                           work%prediction_time, work%fft)
      select type (room => work%room)
      type is (instant_room)
         if (self%takes_rates) then
            call fourier%differentiate(self%n_elements*self%n_components, work%prediction, &
                                       room%rate)
            room%rate = work%rate*room%rate
            call fourier%to_time(self%n_elements*self%n_components, room%rate, room%rate_time, &
                                 work%fft)
         end if
         room%motion%wants_slopes = .false.
         do i = 1, self%n_elements
            call self%take_motion(work, i, room%motion)
            call self%act(room%motion)
            if (room%motion%status /= 0) call note_refusal(self%n_in, room%motion, work)
            do k = 1, fourier%n_time
               do c = 1, self%n_in
                  work%force_time(i, c, k) = room%motion%force(c, k)
               end do
            end do
         end do
      end select
      call fourier%to_coefficients(self%n_elements*self%n_components, work%force_time, &
                                   work%force, work%fft)
      ! Every element has a block in the derivative.
      work%state = pair_mixed
   end subroutine evaluate

   !> The motion that an element has no force for.
   pure subroutine note_refusal(n_in, motion, work)
      integer, intent(in) :: n_in
      type(element_motion), intent(inout) :: motion
      type(force_workspace), intent(inout) :: work
      integer :: n

      ! What ends the run is kept: it comes before what takes a step back.
      if (work%failed > 0) return
      work%failed = motion%status
      associate (r => work%refusal)
         n = min(n_in, size(r%u))
         r%element = motion%element
         r%instant = motion%instant
         r%status = motion%status
         r%omega = motion%omega
         r%u(:n) = motion%u(:n, motion%instant)
         r%v(:n) = motion%v(:n, motion%instant)
      end associate
      motion%status = 0
   end subroutine note_refusal

   !> Inputs of an element at the instants of the last evaluation.
   subroutine take_motion(self, work, element, motion)
      class(instant_law), intent(in) :: self
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: element
      type(element_motion), intent(inout) :: motion
      integer :: c, k

      motion%element = element
      motion%omega = work%rate
      do k = 1, motion%n_time
         do c = 1, self%n_in
            motion%u(c, k) = work%prediction_time(element, c, k)
         end do
      end do
      if (.not. self%takes_rates) return
      select type (room => work%room)
      type is (instant_room)
         do k = 1, motion%n_time
            do c = 1, self%n_in
               motion%v(c, k) = room%rate_time(element, c, k)
            end do
         end do
      end select
   end subroutine take_motion

   !> Derivatives at the inputs of the last evaluation; of each pair of an input and a force one
   !> block.
   subroutine linearize(self, fourier, work)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      integer :: i, in, nc, out

      nc = fourier%n_coefficients
      work%linear_state = work%state
      select type (room => work%room)
      type is (instant_room)
         room%motion%wants_slopes = .true.
         do i = 1, self%n_elements
            call self%take_motion(work, i, room%motion)
            if (allocated(self%remembers)) then
               if (self%remembers(i)) then
                  call self%differentiate_path(fourier, room%motion, work%jacobian(:, :, i))
                  if (room%motion%status /= 0) call note_refusal(self%n_in, room%motion, work)
                  cycle
               end if
            end if
            room%motion%by_u = 0.0_wp
            room%motion%by_v = 0.0_wp
            call self%act(room%motion)
            if (room%motion%status /= 0) call note_refusal(self%n_in, room%motion, work)
            do out = 1, self%n_in
               do in = 1, self%n_in
                  if (self%has_potential .and. .not. self%takes_rates .and. in < out) then
                     call mirror(nc, (in - 1)*nc, (out - 1)*nc, work%jacobian(:, :, i))
                  else
                     room%slope = room%motion%by_u(in, out, :)
                     call differentiate(fourier, room, size(work%jacobian, 1), &
                                        work%jacobian(1, (out - 1)*nc + 1, i), (in - 1)*nc)
                  end if
                  if (.not. self%takes_rates) cycle
                  room%slope = room%motion%by_v(in, out, :)
                  call differentiate(fourier, room, nc, room%gain, 0)
                  call add_rates(fourier, work%rate, room%gain, (in - 1)*nc, (out - 1)*nc, &
                                 work%jacobian(:, :, i))
               end do
            end do
         end do
      end select
   end subroutine linearize

   !> Add what rates give: of u = a cos n tau + b sin n tau they are n omega (b, -a).
   pure subroutine add_rates(fourier, omega, gain, row, column, jacobian)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(in) :: omega
      !> By the rate.
      real(wp), intent(in) :: gain(:, :)
      !> Before the block.
      integer, intent(in) :: row, column
      real(wp), intent(inout) :: jacobian(:, :)
      real(wp) :: n
      integer :: h, j, k

      do j = 1, size(gain, 2)
         do h = 1, fourier%n_retained
            if (fourier%harmonic(h) == 0) cycle
            k = fourier%column(h)
            n = omega*real(fourier%harmonic(h), wp)
            jacobian(row + k, column + j) = jacobian(row + k, column + j) - n*gain(k + 1, j)
            jacobian(row + k + 1, column + j) = jacobian(row + k + 1, column + j) + n*gain(k, j)
         end do
      end do
   end subroutine add_rates

   !> Forces by the frequency, at held displacements: df/dv v/omega, or differences.
   subroutine by_frequency(self, fourier, work)
      class(instant_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), intent(inout) :: work
      real(wp) :: force(self%n_in, fourier%n_time)
      integer :: i, k

      work%output = 0.0_wp
      if (.not. self%takes_rates) return
      select type (room => work%room)
      type is (instant_room)
         room%motion%wants_slopes = .not. self%takes_frequency
         do i = 1, self%n_elements
            call self%take_motion(work, i, room%motion)
            if (self%takes_frequency) then
               call differ_by_frequency(self, room%motion, force)
            else
               room%motion%by_u = 0.0_wp
               room%motion%by_v = 0.0_wp
               call self%act(room%motion)
               do k = 1, fourier%n_time
                  force(:, k) = matmul(room%motion%v(:, k), room%motion%by_v(:, :, k))/work%rate
               end do
            end if
            room%motion%status = 0
            call dgemm('N', 'T', fourier%n_coefficients, self%n_in, fourier%n_time, 1.0_wp, &
                       fourier%analysis, fourier%n_coefficients, force, self%n_in, 0.0_wp, &
                       work%output(1, i), fourier%n_coefficients)
         end do
      end select
   end subroutine by_frequency

   !> Forces at frequencies a little higher and lower, at held displacements.
   subroutine differ_by_frequency(self, motion, force)
      class(instant_law), intent(in) :: self
      type(element_motion), intent(inout) :: motion
      real(wp), intent(out) :: force(:, :)
      !> Where round-off and the square of the step meet.
      real(wp), parameter :: step = 1.0e-5_wp
      real(wp) :: omega

      omega = motion%omega
      motion%v = (1.0_wp + step)*motion%v
      motion%omega = (1.0_wp + step)*omega
      call self%act(motion)
      force = motion%force
      motion%v = (1.0_wp - step)/(1.0_wp + step)*motion%v
      motion%omega = (1.0_wp - step)*omega
      call self%act(motion)
      force = (force - motion%force)/(2.0_wp*step*omega)
      motion%v = motion%v/(1.0_wp - step)
      motion%omega = omega
   end subroutine differ_by_frequency

   !> The block of an input and an output is that of these two turned.
   pure subroutine mirror(nc, row, column, gain)
      integer, intent(in) :: nc
      !> Before the block.
      integer, intent(in) :: row, column
      real(wp), intent(inout) :: gain(:, :)
      integer :: i, j

      do j = 1, nc
         do i = 1, nc
            gain(row + i, column + j) = gain(column + i, row + j)
         end do
      end do
   end subroutine mirror

   !> G = analysis diag(slope) synthesis of an input and an output, transposed: the first index is
   !> the input.
   subroutine differentiate(fourier, room, n, gain, row)
      type(fourier_type), intent(in) :: fourier
      type(instant_room), intent(inout) :: room
      !> Leading dimension, and the rows before the block.
      integer, intent(in) :: n, row
      !> Columns of the output.
      real(wp), intent(inout) :: gain(n, *)
      integer :: first, k, last, nc

      nc = fourier%n_coefficients
      gain(row + 1:row + nc, :nc) = 0.0_wp
      if (all(abs(room%slope) <= 0.0_wp)) return
      if (fourier%projects) then
         call room%sums%of_values(room%waves, room%slope)
         call room%sums%add_products(room%waves, n, gain(row + 1, 1))
         return
      end if
      do first = 1, fourier%n_time, block
         last = min(first + block - 1, fourier%n_time)
         do k = first, last
            room%sloped(:, k - first + 1) = room%slope(k)*fourier%synthesis(:, k)
         end do
         call dgemm('N', 'T', nc, nc, last - first + 1, 1.0_wp, room%sloped, nc, &
                    fourier%analysis(:, first:last), nc, 1.0_wp, gain(row + 1, 1), n)
      end do
   end subroutine differentiate

   !> Slopes by displacements at one of them, at rest.
   subroutine slopes_about(self, element, y, slope)
      class(instant_law), intent(in) :: self
      integer, intent(in) :: element
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: slope(:, :)
      type(element_motion) :: motion

      slope = 0.0_wp
      call reserve_motion(self%n_in, 1, self%needs_scratch, motion)
      motion%element = element
      motion%wants_slopes = .true.
      motion%u(:, 1) = y(:self%n_in)
      call self%act(motion)
      slope(:self%n_in, :self%n_in) = transpose(motion%by_u(:, :, 1))
   end subroutine slopes_about

end module fw_instant_law
