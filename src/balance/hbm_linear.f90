!> The linear problem of a Newton step of harmonic balance. With A the derivative of the smooth
!> part (Z_r and springs) and G that of the contact forces by their prediction, per pair,
!>
!>   J v = A v + B^T G (eps B v - B A v)  (dlft),   J v = A v + B^T G k B v  (penalty).
!>
!> Rows of components that stick (or stay closed) through the period read eps v = -r: their
!> coordinates are solved at once. The others are `active`; behind them in `used` stand the
!> coordinates whose rows of A the active pairs need still (normal forces of slipping pairs).
submodule(fw_hbm) fw_hbm_linear
   use fw_forces, only: pair_mixed
   use fw_forces, only: pair_open
   use fw_forces, only: pair_stuck
   use fw_lapack, only: dgemv
   use fw_threads, only: pairs_for_threads
   implicit none (type, external)

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> Part of a residual whose effect on a step is far below the tolerance of linear solutions.
   real(wp), parameter :: negligible = 1.0e-9_wp

contains

   module procedure linearize
      if (self%contact%n_pairs > 0) call self%contact%linearize(self%fourier)
      if (self%springs%n_springs > 0) call self%springs%linearize(self%fourier)
      call choose_active(self)
      call gather_stiffness(self)
      n_linear = self%n_active*self%fourier%n_coefficients
      self%n_linear = n_linear
   end procedure linearize

   !> Sort the coordinates into active, used and solved at once.
   subroutine choose_active(self)
      type(hbm_system), intent(inout) :: self
      logical :: held(self%structure%n_coordinates), wanted(self%structure%n_coordinates)
      integer :: i, c, j, k

      held = .false.
      wanted = .false.
      if (self%rigid .and. self%reduced) then
         do i = 1, self%contact%n_pairs
            do c = 1, 3
               if (self%joint%row(c, i) == 0 .or. self%contact%linear_state(i) == pair_open) cycle
               j = self%coordinate_of(c, i)
               ! At velocity level a row that sticks reads eps dv/dtau = -r: not solved at once.
               if (c < 3 .and. self%velocity_level) cycle
               held(j) = self%contact%linear_state(i) == pair_stuck .or. &
                           (c == 3 .and. self%pins_normals .and. self%contact%always_closed(i))
               wanted(j) = self%contact%linear_state(i) == pair_mixed
            end do
         end do
      end if
      self%place = 0
      k = 0
      do j = 1, self%structure%n_coordinates
         if (held(j)) cycle
         k = k + 1
         self%used(k) = j
         self%place(j) = k
      end do
      self%n_active = k
      do j = 1, self%structure%n_coordinates
         if (.not. (held(j) .and. wanted(j))) cycle
         k = k + 1
         self%used(k) = j
         self%place(j) = k
      end do
      self%n_used = k
      call place_kept(self)
   end subroutine choose_active

   !> Copy the rows and columns in use, so that products run over contiguous memory.
   subroutine gather_stiffness(self)
      type(hbm_system), intent(inout) :: self
      integer :: h, j, m

      m = self%structure%n_coordinates
      if (.not. allocated(self%active_stiffness)) then
         allocate (self%active_stiffness(m, m, self%fourier%n_retained))
      end if
      if (is_gathered(self)) return
      !$omp parallel do default(none) shared(self) private(h, j) &
      !$omp if(m >= coordinates_for_threads)
      do h = 1, self%fourier%n_retained
         do j = 1, self%n_active
            self%active_stiffness(:self%n_used, j, h) = &
               self%structure%stiffness(self%used(:self%n_used), self%used(j), h)
         end do
      end do
      !$omp end parallel do
      self%gathered_omega = self%structure%omega
      self%n_gathered_active = self%n_active
      self%n_gathered = self%n_used
      self%gathered(:self%n_used) = self%used(:self%n_used)
   end subroutine gather_stiffness

   !> Whether the copies of this frequency and these coordinates are there from the last step.
   pure logical function is_gathered(self)
      type(hbm_system), intent(in) :: self

      is_gathered = self%n_gathered == self%n_used .and. self%n_gathered_active == self%n_active &
                    .and. abs(self%gathered_omega - self%structure%omega) <= 0.0_wp
      if (is_gathered) is_gathered = all(self%gathered(:self%n_used) == self%used(:self%n_used))
   end function is_gathered

   module procedure reduce
      integer :: m, nc

      m = self%structure%n_coordinates
      nc = self%fourier%n_coefficients
      call pinned_step(self, m, nc, r, self%balance)
      call reduce_shaped(self, m, nc, r, rhs)
   end procedure reduce

   !> Steps of the coordinates that are solved at once; zero for the active ones.
   subroutine pinned_step(self, m, nc, r, step)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp), intent(inout) :: step(m, nc)
      integer :: i, c, j, place

      step = 0.0_wp
      if (self%n_active == m) return
      do i = 1, self%contact%n_pairs
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            j = self%coordinate_of(c, i)
            place = self%place(j)
            if (place > 0 .and. place <= self%n_active) cycle
            step(j, :) = -r(j, :)/self%stiffness(i, c)
         end do
      end do
   end subroutine pinned_step

   !> rhs = -r of the active rows, less the product of the pinned steps (in self%balance).
   subroutine reduce_shaped(self, m, nc, r, rhs)
      type(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp), intent(out) :: rhs(self%n_active, nc)
      integer :: h, k

      do k = 1, nc
         rhs(:, k) = -r(self%used(:self%n_active), k)
      end do
      if (self%n_active == m .or. self%n_active == 0) return
      if (pinned_are_solved(self, m, nc, r)) return
      call to_complex(self%fourier, m, self%balance, self%complex_in)
      do h = 1, self%fourier%n_retained
         call zgemv('N', m, m, one, self%structure%stiffness(1, 1, h), m, self%complex_in(1, h), &
            1, &
                    zero, self%complex_out(1, h), 1)
         self%complex_out(:self%n_used, h) = self%complex_out(self%used(:self%n_used), h)
      end do
      call outputs_to_real(self)
      associate (all => self%incidence%identity)
         if (self%springs%n_springs > 0) call spring_product(self, all, m, self%balance)
         call contact_product(self, all, m, self%balance)
      end associate
      rhs = rhs - self%active_out(:self%n_active, :)
   end subroutine reduce_shaped

   !> Whether what is left of the pinned rows is nothing to the others: so it is from the second
   !> step on.
   pure logical function pinned_are_solved(self, m, nc, r)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp) :: largest_pinned, largest
      integer :: j, k

      largest_pinned = 0.0_wp
      largest = 0.0_wp
      do k = 1, nc
         do j = 1, m
            if (self%place(j) > 0 .and. self%place(j) <= self%n_active) then
               largest = max(largest, abs(r(j, k)))
            else
               largest_pinned = max(largest_pinned, abs(r(j, k)))
            end if
         end do
      end do
      pinned_are_solved = largest_pinned <= negligible*largest
   end function pinned_are_solved

   module procedure expand
      integer :: m, nc

      m = self%structure%n_coordinates
      nc = self%fourier%n_coefficients
      call pinned_step(self, m, nc, r, step)
      call scatter(self, m, nc, solution, step)
   end procedure expand

   subroutine scatter(self, m, nc, solution, step)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: solution(self%n_active, nc)
      real(wp), intent(inout) :: step(m, nc)

      step(self%used(:self%n_active), :) = solution
   end subroutine scatter

   !> dR/d omega = (I - B^T G B)(Z' q - F') for rigid laws, Z' q - F' for penalty.
   module procedure parameter_derivative
      integer :: m

      m = self%structure%n_coordinates
      call to_complex(self%fourier, m, x, self%complex_in)
      call self%structure%frequency_derivative(self%complex_in, self%complex_out)
      call derivative_with_contact(self, m, self%fourier%n_coefficients, dr)
   end procedure parameter_derivative

   !> dr from the slopes of all coordinates in complex_out.
   subroutine derivative_with_contact(self, m, nc, dr)
      type(hbm_system), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(out) :: dr(m, nc)
      integer :: i, c, j

      call to_real(self%fourier, m, self%complex_out, dr)
      if (.not. self%rigid) return
      do i = 1, self%contact%n_pairs
         if (self%contact%linear_state(i) == pair_open) cycle
         self%pair_in(:, i) = 0.0_wp
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            self%pair_in((c - 1)*nc + 1:c*nc, i) = -dr(self%coordinate_of(c, i), :)
         end do
         self%pair_out(:, i) = self%pair_in(:, i)
         if (self%contact%linear_state(i) == pair_mixed) then
            call dgemv('T', 3*nc, 3*nc, 1.0_wp, self%contact%jacobian(1, 1, i), 3*nc, &
                       self%pair_in(1, i), 1, 0.0_wp, self%pair_out(1, i), 1)
         end if
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            j = self%coordinate_of(c, i)
            dr(j, :) = dr(j, :) + self%pair_out((c - 1)*nc + 1:c*nc, i)
         end do
      end do
   end subroutine derivative_with_contact

   module procedure apply
      integer :: h, k, na, nu, ld

      na = self%n_active
      nu = self%n_used
      ld = self%structure%n_coordinates
      call active_to_complex(self, na, vector)
      !$omp parallel do default(none) shared(self, na, nu, ld) private(h) &
      !$omp if(ld >= coordinates_for_threads)
      do h = 1, self%fourier%n_retained
         call zgemv('N', nu, na, one, self%active_stiffness(1, 1, h), ld, &
                    self%complex_in(1, h), 1, zero, self%complex_out(1, h), 1)
      end do
      !$omp end parallel do
      call outputs_to_real(self)
      if (self%springs%n_springs > 0) call spring_product(self, self%place, na, vector)
      if (self%contact%n_pairs > 0) call contact_product(self, self%place, na, vector)
      if (allocated(self%shift)) call add_shift(self)
      do k = 1, self%fourier%n_coefficients
         product((k - 1)*na + 1:k*na) = self%active_out(:na, k)
      end do
   end procedure apply

   !> active_out = active_out + P/h v, all coordinates being active and v in complex_in.
   subroutine add_shift(self)
      class(hbm_system), intent(inout) :: self
      integer :: h, k, m

      m = self%n_active
      do h = 1, self%fourier%n_retained
         call zgemv('N', m, m, one, self%shift(1, 1, h), m, self%complex_in(1, h), 1, zero, &
                    self%complex_out(1, h), 1)
         k = self%fourier%column(h)
         self%active_out(:m, k) = self%active_out(:m, k) + real(self%complex_out(:m, h), wp)
         if (self%fourier%harmonic(h) == 0) cycle
         self%active_out(:m, k + 1) = self%active_out(:m, k + 1) - aimag(self%complex_out(:m, h))
      end do
   end subroutine add_shift

   module procedure active_to_complex
      integer :: h, k

      do h = 1, self%fourier%n_retained
         k = self%fourier%column(h)
         if (self%fourier%harmonic(h) == 0) then
            self%complex_in(:na, h) = cmplx(vector(:, k), kind=wp)
         else
            self%complex_in(:na, h) = cmplx(vector(:, k), -vector(:, k + 1), wp)
         end if
      end do
   end procedure active_to_complex

   !> active_out = real form of complex_out, rows in use.
   subroutine outputs_to_real(self)
      type(hbm_system), intent(inout) :: self
      integer :: h, k, nu

      nu = self%n_used
      do h = 1, self%fourier%n_retained
         k = self%fourier%column(h)
         self%active_out(:nu, k) = real(self%complex_out(:nu, h), wp)
         if (self%fourier%harmonic(h) > 0) self%active_out(:nu, k + 1) &
            = -aimag(self%complex_out(:nu, h))
      end do
   end subroutine outputs_to_real

   !> active_out = active_out + derivative of the springs times vector.
   subroutine spring_product(self, map, n_mapped, vector)
      type(hbm_system), intent(inout) :: self
      !> Places of the coordinates in the vector, and its rows.
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      integer :: i, k

      associate (s => self%springs, rows => self%joint%spring_row)
         do i = 1, s%n_springs
            ! The spring's own workspaces are free between evaluations.
            call self%incidence%gather_row(rows(i), map, n_mapped, 1.0_wp, vector, &
                                           s%elongation(i, :))
            do k = 1, self%fourier%n_coefficients
               s%force(i, k) = dot_product(s%jacobian(:, k, i), s%elongation(i, :))
            end do
            call self%incidence%scatter_row(rows(i), self%place, self%n_used, &
                                            size(self%active_out, 1), 1.0_wp, s%force(i, :), &
                                            self%active_out)
         end do
      end associate
   end subroutine spring_product

   !> active_out = active_out + B^T G (eps B v - B A v), A v being in active_out.
   subroutine contact_product(self, map, n_mapped, vector)
      type(hbm_system), intent(inout) :: self
      !> Places of the coordinates in the vector, and its rows.
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      integer :: i, n

      n = 3*self%fourier%n_coefficients
      !$omp parallel do default(none) shared(self, map, n_mapped, vector, n) private(i) &
      !$omp schedule(static) if(self%contact%n_pairs >= pairs_for_threads)
      do i = 1, self%contact%n_pairs
         if (self%contact%linear_state(i) == pair_open) cycle
         call gather_inputs(self, i, map, n_mapped, vector, self%pair_in(:, i))
         if (self%contact%linear_state(i) == pair_mixed) then
            call dgemv('T', n, n, 1.0_wp, self%contact%jacobian(1, 1, i), n, self%pair_in(1, i), &
               1, &
                       0.0_wp, self%pair_out(1, i), 1)
         else
            self%pair_out(:, i) = self%pair_in(:, i)
         end if
      end do
      !$omp end parallel do
      call add_outputs(self)
   end subroutine contact_product

   !> Derivative of the prediction of a pair: eps B v - B A v, or k B v.
   subroutine gather_inputs(self, pair, map, n_mapped, vector, inputs)
      type(hbm_system), intent(in) :: self
      integer, intent(in) :: pair
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      real(wp), intent(out) :: inputs(self%fourier%n_coefficients, 3)
      integer :: c, row, place

      do c = 1, 3
         row = self%joint%row(c, pair)
         if (row == 0) then
            inputs(:, c) = 0.0_wp
            cycle
         end if
         call self%incidence%gather_row(row, map, n_mapped, self%stiffness(pair, c), vector, &
                                        inputs(:, c))
         if (.not. self%rigid) cycle
         if (c < 3 .and. self%velocity_level) then
            call differentiate_inputs(self, self%contact%linear_state(pair) == pair_stuck, &
                                      inputs(:, c))
         end if
         place = self%place(self%incidence%coordinate_of(row))
         if (place > 0) inputs(:, c) = inputs(:, c) - self%active_out(place, :)
      end do
   end subroutine gather_inputs

   !> Derivative by tau in place; the mean of a stuck pair stays, see hold_stuck_means.
   subroutine differentiate_inputs(self, keep_mean, inputs)
      type(hbm_system), intent(in) :: self
      logical, intent(in) :: keep_mean
      real(wp), intent(inout) :: inputs(:)
      real(wp) :: cosine, n
      integer :: h, k

      do h = 1, self%fourier%n_retained
         k = self%fourier%column(h)
         n = real(self%fourier%harmonic(h), wp)
         if (self%fourier%harmonic(h) == 0) then
            if (.not. keep_mean) inputs(k) = 0.0_wp
            cycle
         end if
         cosine = inputs(k)
         inputs(k) = n*inputs(k + 1)
         inputs(k + 1) = -n*cosine
      end do
   end subroutine differentiate_inputs

   !> Pairs may share coordinates (penalty), so that this stays in one thread.
   subroutine add_outputs(self)
      type(hbm_system), intent(inout) :: self
      integer :: i, c, nc

      nc = self%fourier%n_coefficients
      do i = 1, self%contact%n_pairs
         if (self%contact%linear_state(i) == pair_open) cycle
         do c = 1, 3
            if (self%joint%row(c, i) == 0) cycle
            call self%incidence%scatter_row(self%joint%row(c, i), self%place, self%n_active, &
                                            size(self%active_out, 1), 1.0_wp, &
                                            self%pair_out((c - 1)*nc + 1:c*nc, i), &
                                            self%active_out)
         end do
      end do
   end subroutine add_outputs

   !> Column by column: few unknowns, or springs, or a check of the product.
   module procedure assemble
      real(wp) :: unit(size(matrix, 2))
      integer :: j, n

      n = self%n_linear
      do j = 1, n
         unit(:n) = 0.0_wp
         unit(j) = 1.0_wp
         call self%apply(unit(:n), matrix(:n, j))
      end do
   end procedure assemble

end submodule fw_hbm_linear
