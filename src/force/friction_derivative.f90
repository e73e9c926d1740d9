!> The derivative of friction that is decided at instants: rows of the march, projected on the
!> harmonics pair by pair.
submodule(fw_friction) fw_friction_derivative
   use fw_correction_derivative, only: add_start
   use fw_correction_derivative, only: limit_derivative
   use fw_correction_derivative, only: march_derivative
   use fw_lapack, only: dgemm
   use fw_one_direction, only: condition
   use fw_one_direction, only: follow_one_direction
   use fw_one_direction, only: project_one_direction
   use fw_sampled_turn, only: limit_is_unique
   use fw_slip, only: slip_gradient
   implicit none (type, external)

   !> Distance from the friction cone, as a part of the largest predicted force, that round-off
   !> leaves of a pair that has settled on it.
   real(wp), parameter :: touch = 1.0e-10_wp

   !> Room for the derivative of one pair.
   type :: derivative_room
      !> Of a limit that is the only one: derivative of the position at the instants by that at the
      !> start (2, 2, n_time), and (1 - that of a turn)^-1.
      real(wp), allocatable :: by_start(:, :, :)
      real(wp) :: inverse(2, 2) = 0.0_wp
      !> d lambda_t by inputs (coefficient, component), for each tangential component and instant.
      real(wp), allocatable :: rows(:, :, :, :)
      !> d x at the end by inputs (coefficient, component, tangential component).
      real(wp), allocatable :: dx(:, :, :)
      real(wp), allocatable :: weight(:, :, :)
      !> Predicted forces (3, n_time).
      real(wp), allocatable :: y(:, :)
      !> Of a pair with one tangential direction: predicted forces, and what follows (n_time).
      real(wp), allocatable :: y_t(:), y_n(:)
      type(condition), allocatable :: at(:)
   end type derivative_room

contains

   ! The state that the derivative belongs to stays beside it: rows of stuck pairs leave the
   ! problem.
   module procedure linearize
      integer :: nc

      work%linear_state = work%state
      work%linear_rests = work%rests
      if (.not. any(work%state == pair_mixed)) return
      nc = fourier%n_coefficients
      if (.not. allocated(work%jacobian)) allocate (work%jacobian(3*nc, 3*nc, self%n_elements))
      select type (room => work%room)
      type is (friction_room)
         call differentiate_pairs(self, fourier, room, work)
      end select
   end procedure linearize

   subroutine differentiate_pairs(self, fourier, room, work)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      type(force_workspace), intent(inout) :: work
      type(derivative_room) :: of_pairs
      type(derivative_room), allocatable :: of_pair
      integer :: i

      if (self%n_elements < pairs_for_threads) then
         do i = 1, self%n_elements
            if (work%state(i) == pair_mixed) call differentiate_pair(self, fourier, room, i, work, &
                                                                     of_pairs)
         end do
         return
      end if
      !$omp parallel default(none) shared(self, fourier, room, work) private(i, of_pair)
      ! Of one pair at a time, for each thread: of all pairs it would be the largest array of the
      ! program.
      allocate (of_pair)
      !$omp do schedule(dynamic)
      do i = 1, self%n_elements
         if (work%state(i) == pair_mixed) call differentiate_pair(self, fourier, room, i, work, &
                                                                  of_pair)
      end do
      !$omp end do
      !$omp end parallel
   end subroutine differentiate_pairs

   subroutine differentiate_pair(self, fourier, room, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(friction_room), intent(in) :: room
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair

      if (.not. work%measures_slip .and. count(self%present(1:2, i)) == 1) then
         call differentiate_one_direction(self, fourier, room%settled(i), i, work, of_pair)
      else
         call differentiate_rows(self, fourier, room%settled(i), i, work, of_pair)
      end if
   end subroutine differentiate_pair

   !> Of a pair with one tangential direction whose path of slip nobody asks for.
   subroutine differentiate_one_direction(self, fourier, settled, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      logical, intent(in) :: settled
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair
      real(wp) :: x(2)
      integer :: nc, t, place
      logical :: unique

      nc = fourier%n_coefficients
      if (.not. allocated(of_pair%at)) then
         allocate (of_pair%at(fourier%n_time), of_pair%y_t(fourier%n_time))
         allocate (of_pair%y_n(fourier%n_time))
      end if
      t = merge(1, 2, self%present(1, i))
      of_pair%y_t = work%prediction_time(i, t, :)
      ! A pair at rest is as of a law with memory, of the prediction with its mean.
      if (work%rests(i)) of_pair%y_t = of_pair%y_t + work%mean(i, t)
      of_pair%y_n = work%prediction_time(i, 3, :)
      call find_start(self, fourier, settled, work, i, of_pair, x, unique)
      place = (t - 1)*nc + 1
      work%jacobian(:, :, i) = 0.0_wp
      call follow_one_direction(fourier%n_time, merge(1, work%turns(i), unique), of_pair%y_t, &
                                of_pair%y_n, self%mu(i), &
                                merge(touch*work%scale(i), 0.0_wp, unique), &
                                self%facts%remembers .or. work%rests(i), unique, x(t), of_pair%at)
      call project_one_direction(fourier%n_time, nc, fourier%synthesis, fourier%analysis, &
                                 of_pair%at, self%present(3, i), 3*nc, &
                                 work%jacobian(place, place, i), &
                                 work%jacobian(2*nc + 1, place, i))
      call project_normal(work%jacobian(:, :, i), fourier, of_pair%y_n, self%present(3, i))
   end subroutine differentiate_one_direction

   !> Where the march that is differentiated starts: at its limit, where that is the only one.
   subroutine find_start(self, fourier, settled, work, pair, of_pair, x, unique)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Whether the march ends at its limit.
      logical, intent(in) :: settled
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      type(derivative_room), intent(inout) :: of_pair
      !> Corrected position.
      real(wp), intent(out) :: x(2)
      logical, intent(out) :: unique
      real(wp) :: z(2)

      unique = .false.
      if (settled) then
         if (.not. allocated(of_pair%by_start)) allocate (of_pair%by_start(2, 2, fourier%n_time))
         ! The prediction in `work` is without its mean: the position goes back by it.
         x = work%x(pair, :)
         z = x
         if (work%rests(pair)) z = x - work%mean(pair, :)
         call limit_is_unique(self%n_elements, fourier%n_time, pair, work%prediction_time, &
                              self%mu(pair), touch*work%scale(pair), z, unique, of_pair%inverse, &
                              of_pair%by_start)
      end if
      if (.not. unique) x = work%x_start(pair, :)
   end subroutine find_start

   !> Of any pair, by the rows of the march.
   subroutine differentiate_rows(self, fourier, settled, i, work, of_pair)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      logical, intent(in) :: settled
      integer, intent(in) :: i
      type(force_workspace), intent(inout) :: work
      type(derivative_room), intent(inout) :: of_pair
      real(wp) :: x(2)
      integer :: c, nc
      logical :: unique

      nc = fourier%n_coefficients
      ! 6 n_coefficients n_time numbers.
      if (.not. allocated(of_pair%rows)) then
         allocate (of_pair%rows(nc, 3, 2, fourier%n_time), of_pair%dx(nc, 3, 2))
         allocate (of_pair%weight(2, 2, nc), of_pair%y(3, fourier%n_time))
      end if
      of_pair%y = work%prediction_time(i, :, :)
      if (work%rests(i)) then
         do c = 1, 2
            of_pair%y(c, :) = of_pair%y(c, :) + work%mean(i, c)
         end do
      end if
      call derive(self, fourier, settled, work, i, of_pair, x, unique)
      call project(work%jacobian(:, :, i), fourier, of_pair%rows)
      call project_normal(work%jacobian(:, :, i), fourier, of_pair%y(3, :), self%present(3, i))
      if (unique) call project_start(work%jacobian(:, :, i), fourier, of_pair%dx, &
                                     of_pair%by_start, of_pair%weight)
      if (.not. work%measures_slip) return
      if (work%rests(i)) then
         work%slip_derivative(:, i) = 0.0_wp
         return
      end if
      ! The path of slip needs the rows themselves, not only their projections.
      if (unique) call add_start(3*nc, fourier%n_time, of_pair%by_start, of_pair%dx, of_pair%rows)
      call slip_gradient(fourier%n_time, nc, fourier%synthesis, of_pair%y, self%mu(i), &
                         self%present(:, i), self%facts%remembers, x, of_pair%rows, &
                         work%slip_derivative(:, i))
   end subroutine differentiate_rows

   !> Derivative of the friction of a pair at the instants. A limit that is the only one (unique)
   !> has a derivative of its own, dx, whose part in the rows is left to `project_start`; any other
   !> carries that of the way to it.
   subroutine derive(self, fourier, settled, work, pair, of_pair, x, unique)
      class(friction_law), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      !> Whether the march ends at its limit.
      logical, intent(in) :: settled
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: pair
      !> Its rows and dx are set, and by_start of a unique limit, from y.
      type(derivative_room), intent(inout) :: of_pair
      !> Corrected position at the end of the period.
      real(wp), intent(out) :: x(2)
      logical, intent(out) :: unique

      call find_start(self, fourier, settled, work, pair, of_pair, x, unique)
      if (unique) then
         call limit_derivative(fourier%n_time, fourier%n_coefficients, fourier%synthesis, &
                               of_pair%y, self%mu(pair), touch*work%scale(pair), &
                               self%present(:, pair), of_pair%inverse, x, of_pair%rows, of_pair%dx)
      else
         ! From the start once more, with derivatives, as many turns as the march took.
         of_pair%dx = 0.0_wp
         call march_derivative(fourier%n_time, fourier%n_coefficients, work%turns(pair), &
                               fourier%synthesis, of_pair%y, self%mu(pair), 0.0_wp, &
                               self%present(:, pair), &
                               self%facts%remembers .or. work%rests(pair), x, of_pair%rows, &
                               of_pair%dx)
      end if
   end subroutine derive

   !> From rows at the instants to the transposed derivative between coefficients.
   subroutine project(jacobian, fourier, rows)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: rows(3*fourier%n_coefficients, 2, fourier%n_time)
      integer :: nc, c

      nc = fourier%n_coefficients
      do c = 1, 2
         ! (G^T)(:, j) = sum over the instants of rows(:, c, k) analysis(j, k). Rows of one
         ! direction are every second block of 3 nc: hence the leading dimension.
         call dgemm('N', 'T', 3*nc, nc, fourier%n_time, 1.0_wp, rows(1, c, 1), 6*nc, &
                    fourier%analysis, nc, 0.0_wp, jacobian(1, (c - 1)*nc + 1), 3*nc)
      end do
   end subroutine project

   !> The blocks whose output is normal.
   subroutine project_normal(jacobian, fourier, y_n, has_normal)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: y_n(:)
      logical, intent(in) :: has_normal
      integer :: nc, k, j
      real(wp) :: factor
      logical :: closes

      nc = fourier%n_coefficients
      jacobian(:, 2*nc + 1:) = 0.0_wp
      if (.not. has_normal) return
      ! A pair that bears throughout keeps its coefficients; of any other, the instants of the
      ! rarer state are added up.
      ! G over all instants is the identity where the transform is exact, so that the fewer of both
      ! kinds can be summed.
      closes = 2*count(y_n < 0.0_wp) > fourier%n_time .and. fourier%projects .and. &
               fourier%n_time > 2*maxval(fourier%harmonic)
      factor = merge(-1.0_wp, 1.0_wp, closes)
      do k = 1, fourier%n_time
         ! lambda_n = min(y_n, 0): G is the sum over closed instants of analysis synthesis, or 1
         ! less that over the open ones.
         if ((y_n(k) < 0.0_wp) .eqv. closes) cycle
         do j = 1, nc
            jacobian(2*nc + 1:, 2*nc + j) = jacobian(2*nc + 1:, 2*nc + j) + &
                                            factor*fourier%analysis(j, k)*fourier%synthesis(:, k)
         end do
      end do
      if (.not. closes) return
      do j = 1, nc
         jacobian(2*nc + j, 2*nc + j) = jacobian(2*nc + j, 2*nc + j) + 1.0_wp
      end do
   end subroutine project_normal

   !> What the start of a turn adds to the projected rows: of rank two.
   subroutine project_start(jacobian, fourier, dx, by_start, weight)
      type(fourier_type), intent(in) :: fourier
      real(wp), intent(inout) :: jacobian(3*fourier%n_coefficients, 3*fourier%n_coefficients)
      real(wp), intent(in) :: dx(3*fourier%n_coefficients, 2), by_start(2, 2, fourier%n_time)
      !> Room.
      real(wp), intent(inout) :: weight(2, 2, fourier%n_coefficients)
      integer :: c, j, column, nc

      nc = fourier%n_coefficients
      ! lambda = y - x: a later position by dx/dx_0 takes from the force. Coefficients of this
      ! product first, then the outer product with dx_0 by inputs.
      call dgemm('N', 'T', 4, nc, fourier%n_time, -1.0_wp, by_start, 4, fourier%analysis, nc, &
                 0.0_wp, weight, 4)
      do c = 1, 2
         do j = 1, nc
            column = (c - 1)*nc + j
            jacobian(:, column) = jacobian(:, column) + weight(c, 1, j)*dx(:, 1) &
                                  + weight(c, 2, j)*dx(:, 2)
         end do
      end do
   end subroutine project_start

end submodule fw_friction_derivative
