!> The linear problem of a Newton step of harmonic balance. With G the derivative of the forces of
!> a law by its inputs, element by element, and d the derivative of its order,
!>
!>   A v = Z_r v + B^T G k B d v                of the laws that are functions of displacements,
!>   J v = A v + B^T G (eps B d v - B A v)      with those that take the balance.
!>
!> Rows of components that stick (or stay closed) through the period read eps v = -r: their
!> coordinates are solved at once. The others are `active`; behind them in `used` stand the
!> coordinates whose rows of A the active pairs need still (normal forces of slipping pairs).
submodule(fw_balance_state) fw_balance_linear
   use fw_complex_form, only: amplitudes_of
   use fw_force_law, only: pair_mixed, pair_open, pair_stuck
   use fw_input_rates, only: take_rate, turn_row
   use fw_lapack, only: dgemv, zgemv
   use fw_march_derivative, only: elements_of_group
   use fw_threads, only: pairs_for_threads, watch_team
   implicit none (type, external)

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> Part of a residual whose effect on a step is far below the tolerance of linear solutions.
   real(wp), parameter :: negligible = 1.0e-9_wp
   !> Coefficients that a thread adds at a time, and numbers from which threads pay for that.
   integer, parameter :: few_coefficients = 8, entries_for_threads = 4000
   !> Relative residual of a linear solution from which products that are nearly right serve.
   real(wp), parameter :: near_enough = 5.0e-5_wp
   !> Of a product in single precision, relative to its largest entry.
   real(wp), parameter :: single_round_off = 1.0e-6_wp

contains

   ! Laws first: which coordinates are solved at once follows from the states of their elements.
   module procedure linearize
      integer :: k

      if (abs(self%alteration) > 0.0_wp) then
         ! Laws write what their forces depend on, and leave the zeros of all else as they are.
         associate (work => self%work(self%problem%forces%pairs))
            if (allocated(work%jacobian)) work%jacobian = 0.0_wp
         end associate
      end if
      self%alteration = 0.0_wp
      do k = 1, self%problem%forces%n_laws
         if (size(self%work(k)%state) == 0) cycle
         ! Steps that only have to be near mostly do without blocks of marched derivatives.
         self%work(k)%may_wait = self%nearly .and. self%has_large_blocks
         associate (entry => self%problem%forces%entry(k))
            call entry%law%linearize(self%problem%fourier, self%work(k))
            if (self%work(k)%failed > 0) call self%heed(k)
         end associate
         call self%take_near(k)
      end do
      call choose_active(self)
      call self%problem%structure%restrict(self%structure_state, self%active%n_active, &
                                           self%active%n_used, self%active%used)
      n_linear = self%active%n_active*self%problem%fourier%n_coefficients
      self%active%n_linear = n_linear
   end procedure linearize

   module procedure take_near

      if (present(alteration)) self%alteration = alteration
      if (.not. (self%nearly .and. self%has_large_blocks)) return
      associate (entry => self%problem%forces%entry(law))
         ! Who keeps normal components that always bear in the problem may have changed their rows.
         call self%near(law)%take(entry%row, pins_last(entry) .and. self%pins_normals, &
                                  present(alteration), self%work(law))
      end associate
   end procedure take_near

   !> Sort the coordinates into active, used and solved at once.
   !> `used` lists the active ones, then those that are held but whose rows of A are needed; `place`
   !> is the inverse of the list, with 0 for coordinates that it has not.
   subroutine choose_active(self)
      type(balance_state), intent(inout) :: self
      logical :: held(size(self%active%place)), wanted(size(self%active%place))
      integer :: j, k

      held = .false.
      wanted = .false.
      if (self%reduced) then
         do k = 1, self%problem%forces%n_laws
            if (.not. self%problem%forces%entry(k)%law%prediction%takes_balance) cycle
            call find_held(self, self%problem%forces%entry(k), self%work(k), held, wanted)
         end do
      end if
      self%active%place = 0
      k = 0
      ! In the order of the structure, so that a problem in which nothing sticks is numbered as it
      ! is.
      do j = 1, self%problem%structure%n_coordinates
         if (held(j)) cycle
         k = k + 1
         self%active%used(k) = j
         self%active%place(j) = k
      end do
      self%active%n_active = k
      do j = 1, self%problem%structure%n_coordinates
         if (.not. (held(j) .and. wanted(j))) cycle
         k = k + 1
         self%active%used(k) = j
         self%active%place(j) = k
      end do
      self%active%n_used = k
      do k = 1, self%problem%forces%n_laws
         call list_acting(self, self%problem%forces%entry(k), self%work(k), self%acting(k))
      end do
      call place_kept(self)
   end subroutine choose_active

   !> The elements of a law whose forces reach the linear problem: of those that are held throughout
   !> nothing does. Inputs and outputs of the others are not set by products; wear reads those of
   !> mixed pairs, which are always among these.
   subroutine list_acting(self, entry, work, acting)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      type(element_list), intent(inout) :: acting

      if (.not. allocated(acting%number)) allocate (acting%number(size(work%state)))
      acting%n = 0
      ! Forces that do not take the balance count in rows that the others take as well.
      if (entry%law%prediction%some_are_free()) call append(.false., self%active%n_used)
      acting%n_free = acting%n
      if (entry%law%prediction%takes_balance) call append(.true., self%active%n_active)

   contains

      subroutine append(takes, n_rows)
         logical, intent(in) :: takes
         integer, intent(in) :: n_rows
         integer :: c, i
         logical :: reaches

         do i = 1, size(work%state)
            if (work%linear_state(i) == pair_open) cycle
            if (entry%law%prediction%takes(i) .neqv. takes) cycle
            reaches = .false.
            do c = 1, size(entry%row, 1)
               if (entry%row(c, i) == 0 .or. reaches) cycle
               reaches = self%problem%incidence%reaches(entry%row(c, i), self%active%place, n_rows)
            end do
            if (.not. reaches) cycle
            acting%n = acting%n + 1
            acting%number(acting%n) = i
         end do
      end subroutine append

   end subroutine list_acting

   !> Coordinates whose rows elements hold, and those of them whose rows of A are needed still.
   subroutine find_held(self, entry, work, held, wanted)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      logical, intent(inout) :: held(:), wanted(:)
      integer :: i, c, j, last

      last = size(entry%row, 1)
      do i = 1, size(entry%row, 2)
         if (work%linear_state(i) == pair_open .or. .not. entry%law%prediction%takes(i)) cycle
         do c = 1, last
            if (entry%row(c, i) == 0) cycle
            ! At velocity level a row that sticks reads eps dv/dtau = -r: not solved at once.
            if (entry%law%prediction%order_of(i, c) > 0) cycle
            j = self%problem%incidence%coordinate_of(entry%row(c, i))
            ! A pair that bears throughout has G = 1 in the normal direction even while it slips,
            ! and its row reads eps v = -r. Its friction depends on the pressure all the same, of
            ! which A v is a part.
            held(j) = work%linear_state(i) == pair_stuck .or. &
                      (c == last .and. self%pins_normals .and. work%always_closed(i))
            wanted(j) = work%linear_state(i) == pair_mixed
         end do
      end do
   end subroutine find_held

   ! self%balance is free between residuals: it takes the steps of the pinned coordinates.
   module procedure reduce
      integer :: m, nc

      m = self%problem%structure%n_coordinates
      nc = self%problem%fourier%n_coefficients
      call pinned_step(self, m, nc, r, self%balance)
      call reduce_shaped(self, m, nc, r, rhs)
   end procedure reduce

   !> Steps of the coordinates that are solved at once; zero for the active ones.
   subroutine pinned_step(self, m, nc, r, step)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp), intent(inout) :: step(m, nc)
      integer :: i, c, j, k, place

      ! G = 1 in these rows: J v = A v + eps v - A v = eps v = -r, whatever the other coordinates
      ! do.
      step = 0.0_wp
      if (self%active%n_active == m) return
      do k = 1, self%problem%forces%n_laws
         associate (p => self%problem%forces%entry(k)%law%prediction, &
                    row => self%problem%forces%entry(k)%row)
            if (.not. p%takes_balance) cycle
            do i = 1, size(row, 2)
               if (.not. p%takes(i)) cycle
               do c = 1, size(row, 1)
                  if (row(c, i) == 0) cycle
                  j = self%problem%incidence%coordinate_of(row(c, i))
                  place = self%active%place(j)
                  ! Active: its step comes of the linear problem.
                  if (place > 0 .and. place <= self%active%n_active) cycle
                  step(j, :) = -r(j, :)/p%stiffness(i, c)
                  ! eps is an impedance there, another one in each harmonic.
                  if (p%has_inertia) call turn_row(self%problem%fourier, self%frequency(), &
                                                   p, i, c, .true., step(j, :))
               end do
            end do
         end associate
      end do
   end subroutine pinned_step

   !> rhs = -r of the active rows, less the product of the pinned steps (in self%balance).
   subroutine reduce_shaped(self, m, nc, r, rhs)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp), intent(out) :: rhs(self%active%n_active, nc)
      logical :: nearly

      call negate_active(self, m, nc, r, rhs)
      if (self%active%n_active == m .or. self%active%n_active == 0) return
      if (pinned_are_solved(self, m, nc, r)) return
      nearly = self%nearly .and. self%asked >= near_enough
      call subtract_pinned(self, m, nc, nearly, rhs)
      if (.not. nearly) return
      ! What single precision leaves is to be far below what is asked for: not where static loads
      ! make pinned coordinates take steps beside which the rest is small.
      associate (product => self%scratch%active_out(:self%active%n_active, :))
         if (single_round_off*maxval(abs(product)) <= 0.1_wp*self%asked*maxval(abs(rhs))) return
      end associate
      call negate_active(self, m, nc, r, rhs)
      call subtract_pinned(self, m, nc, .false., rhs)
   end subroutine reduce_shaped

   !> rhs = -r of the active rows.
   pure subroutine negate_active(self, m, nc, r, rhs)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp), intent(out) :: rhs(self%active%n_active, nc)
      integer :: k

      do k = 1, nc
         ! J_aa v_a = -r_a - J_ap v_p, with a the active and p the pinned coordinates.
         rhs(:, k) = -r(self%active%used(:self%active%n_active), k)
      end do
   end subroutine negate_active

   !> rhs = rhs - J_ap v_p, with the pinned steps in self%balance.
   subroutine subtract_pinned(self, m, nc, nearly, rhs)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: m, nc
      !> With the derivatives of the laws in single precision.
      logical, intent(in) :: nearly
      real(wp), intent(inout) :: rhs(self%active%n_active, nc)
      integer :: k

      ! As `apply` forms it: Z_r v of the rows in use first, then what the forces add.
      call self%problem%structure%multiply(self%structure_state, self%balance, self%scratch%product)
      do k = 1, nc
         self%scratch%active_out(:self%active%n_used, k) = &
            self%scratch%product(self%active%used(:self%active%n_used), k)
      end do
      call add_forces(self, self%problem%incidence%identity, m, self%balance, nearly)
      rhs = rhs - self%scratch%active_out(:self%active%n_active, :)
   end subroutine subtract_pinned

   !> Whether what is left of the pinned rows is nothing to the others: so it is from the second
   !> step on.
   pure logical function pinned_are_solved(self, m, nc, r)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: r(m, nc)
      real(wp) :: largest_pinned, largest
      integer :: j, k

      largest_pinned = 0.0_wp
      largest = 0.0_wp
      do k = 1, nc
         do j = 1, m
            if (self%active%place(j) > 0 .and. self%active%place(j) <= self%active%n_active) then
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

      m = self%problem%structure%n_coordinates
      nc = self%problem%fourier%n_coefficients
      call pinned_step(self, m, nc, r, step)
      call scatter(self, m, nc, solution, step)
   end procedure expand

   !> Shapes for what came as vectors: a step of the active coordinates into that of all.
   subroutine scatter(self, m, nc, solution, step)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: solution(self%active%n_active, nc)
      real(wp), intent(inout) :: step(m, nc)

      step(self%active%used(:self%active%n_active), :) = solution
   end subroutine scatter

   ! Products of all harmonics at once; the coefficients lie one behind the other in `product`, with
   ! na entries each, but are n_coordinates apart in the scratch.
   module procedure apply
      integer :: k, na
      logical :: roughly

      na = self%active%n_active
      roughly = self%nearly .and. self%asked >= near_enough
      call watch_team(self%problem%structure%n_coordinates)
      if (roughly .and. (self%splits() .or. self%problem%structure%has_near_product())) then
         call self%problem%structure%multiply_nearly(self%structure_state, vector, &
                                                     self%scratch%active_out)
      else
         call self%problem%structure%multiply_active(self%structure_state, vector, &
                                                     self%scratch%active_out)
      end if
      call add_forces(self, self%active%place, na, vector, roughly)
      if (allocated(self%shift)) call add_shift(self, na, vector)
      do k = 1, self%problem%fourier%n_coefficients
         product((k - 1)*na + 1:k*na) = self%scratch%active_out(:na, k)
      end do
   end procedure apply

   !> active_out = active_out + P/h v, all coordinates being active.
   subroutine add_shift(self, m, vector)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: m
      real(wp), intent(in) :: vector(m, *)
      integer :: h, k

      call active_to_complex(self, m, vector)
      do h = 1, self%problem%fourier%n_retained
         call zgemv('N', m, m, one, self%shift(1, 1, h), m, self%scratch%complex_in(1, h), 1, &
                    zero, self%scratch%complex_out(1, h), 1)
         k = self%problem%fourier%column(h)
         self%scratch%active_out(:m, k) = self%scratch%active_out(:m, k) + &
                                          real(self%scratch%complex_out(:m, h), wp)
         if (self%problem%fourier%harmonic(h) == 0) cycle
         self%scratch%active_out(:m, k + 1) = self%scratch%active_out(:m, k + 1) - &
            aimag(self%scratch%complex_out(:m, h))
      end do
   end subroutine add_shift

   module procedure active_to_complex

      call amplitudes_of(self%problem%fourier%harmonic, self%problem%fourier%column, na, vector, &
                         size(self%scratch%complex_in, 1), self%scratch%complex_in)
   end procedure active_to_complex

   !> active_out = active_out + what the forces add to the product, Z_r v being in active_out. Laws
   !> that take the balance take that of the others, but not of one another.
   subroutine add_forces(self, map, n_mapped, vector, roughly)
      type(balance_state), intent(inout) :: self
      !> Places of the coordinates in the vector, and its rows.
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      !> With the derivatives of the laws in single precision.
      logical, intent(in) :: roughly
      integer :: k

      if (.not. roughly) call self%form_jacobians()
      ! Outputs of elements without the balance are in active_out before the others take their
      ! inputs from it.
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k), work => self%work(k), &
                    free => self%acting(k)%number(:self%acting(k)%n_free))
            if (.not. entry%law%prediction%some_are_free()) cycle
            call multiply_elements(self, k, free, map, n_mapped, vector, roughly, work)
            call add_outputs(self, entry, work, free, self%active%place, self%active%n_used, &
                             self%scratch%active_out)
         end associate
      end do
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k), work => self%work(k), &
                    rigid => self%acting(k)%number(self%acting(k)%n_free + 1:self%acting(k)%n))
            if (.not. entry%law%prediction%takes_balance) cycle
            call multiply_elements(self, k, rigid, map, n_mapped, vector, roughly, work)
            call add_outputs(self, entry, work, rigid, self%active%place, self%active%n_active, &
                             self%scratch%active_out)
         end associate
      end do
   end subroutine add_forces

   !> Outputs of the derivative of a law for a vector.
   subroutine multiply_elements(self, law, acting, map, n_mapped, vector, roughly, work)
      type(balance_state), intent(in) :: self
      !> Its number, and the elements that count.
      integer, intent(in) :: law
      integer, intent(in) :: acting(:)
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      logical, intent(in) :: roughly
      type(force_workspace), intent(inout) :: work
      logical :: nearly
      integer :: i, n_groups

      nearly = roughly .and. self%has_large_blocks
      n_groups = 0
      if (nearly) n_groups = self%near(law)%n_groups(work)
      if (size(work%state) < pairs_for_threads) then
         do i = 1, n_groups
            call multiply_marched(i)
         end do
         do i = 1, size(acting)
            call multiply_one(acting(i))
         end do
         return
      end if
      !$omp parallel default(none) shared(acting, n_groups) private(i)
      !$omp do schedule(dynamic)
      do i = 1, n_groups
         call multiply_marched(i)
      end do
      !$omp end do nowait
      ! Mixed pairs, which take longest, stand side by side.
      !$omp do schedule(dynamic, 4)
      do i = 1, size(acting)
         call multiply_one(acting(i))
      end do
      !$omp end do
      !$omp end parallel

   contains

      subroutine multiply_marched(group)
         integer, intent(in) :: group
         integer :: element, j

         do j = 1, elements_of_group
            element = self%near(law)%element_of(group, j, work)
            if (element > 0) call gather(element)
         end do
         call self%near(law)%multiply_group(group, work)
      end subroutine multiply_marched

      subroutine multiply_one(i)
         integer, intent(in) :: i

         if (n_groups > 0) then
            if (self%near(law)%is_marched(i, work)) return
         end if
         call gather(i)
         associate (entry => self%problem%forces%entry(law))
            if (nearly .and. work%linear_state(i) == pair_mixed) then
               call self%near(law)%multiply(entry%row(:, i), i, work)
            else
               call multiply_derivative_of(entry%row(:, i), work, i)
            end if
         end associate
      end subroutine multiply_one

      subroutine gather(i)
         integer, intent(in) :: i

         call gather_inputs(self, self%problem%forces%entry(law), i, map, n_mapped, vector, &
                            work%linear_rests(i), self%scratch%active_out, work%input(:, i))
      end subroutine gather

   end subroutine multiply_elements

   !> Whether normal components that bear throughout have the derivative 1 and nothing else.
   pure logical function pins_last(entry)
      type(force_entry), intent(in) :: entry

      pins_last = .false.
      if (.not. entry%law%prediction%takes_balance) return
      pins_last = entry%law%prediction%order(size(entry%row, 1)) == 0 .and. &
                  .not. entry%law%prediction%some_are_free()
   end function pins_last

   !> Outputs of all elements of a law from their inputs.
   subroutine multiply_derivative(row, work)
      !> Row of each component of each element, 0 where there is none.
      integer, intent(in) :: row(:, :)
      type(force_workspace), intent(inout) :: work
      integer :: i

      do i = 1, size(work%state)
         if (work%linear_state(i) /= pair_open) call multiply_derivative_of(row(:, i), work, i)
      end do
   end subroutine multiply_derivative

   !> output = G input of one element, between the components that exist.
   subroutine multiply_derivative_of(row, work, element)
      integer, intent(in) :: row(:)
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: element
      integer :: c, first, last, n, nc

      if (work%linear_state(element) /= pair_mixed) then
         ! Stuck throughout: G = 1.
         work%output(:, element) = work%input(:, element)
         return
      end if
      ! From the first to the last component that exists: those outside have no forces.
      first = 1
      last = 0
      do c = size(row), 1, -1
         if (row(c) == 0) cycle
         first = c
         last = max(last, c)
      end do
      n = size(work%input, 1)
      nc = n/size(row)
      first = (first - 1)*nc
      last = last*nc
      work%output(:first, element) = 0.0_wp
      work%output(last + 1:, element) = 0.0_wp
      if (last == 0) return
      ! Stored transposed, (input, output): the laws fill it output by output.
      first = first + 1
      call dgemv('T', last - first + 1, last - first + 1, 1.0_wp, &
                 work%jacobian(first, first, element), n, work%input(first, element), 1, 0.0_wp, &
                 work%output(first, element), 1)
   end subroutine multiply_derivative_of

   !> Derivative of the prediction of an element: k B d v, and - B A v where it takes the balance.
   subroutine gather_inputs(self, entry, element, map, n_mapped, vector, rests, balance, inputs)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: element
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: vector(n_mapped, *)
      logical, intent(in) :: rests
      !> A v, rows in use.
      real(wp), intent(in) :: balance(:, :)
      real(wp), intent(out) :: inputs(self%problem%fourier%n_coefficients, size(entry%row, 1))
      logical :: takes
      integer :: c, row, place

      associate (p => entry%law%prediction)
         takes = p%takes(element)
         do c = 1, size(entry%row, 1)
            row = entry%row(c, element)
            if (row == 0) then
               inputs(:, c) = 0.0_wp
               cycle
            end if
            call self%problem%incidence%gather_row(row, map, n_mapped, p%stiffness(element, c), &
                                                   vector, &
                                           inputs(:, c))
            if (p%order_of(element, c) > 0) call take_rate(self%problem%fourier, rests, &
                                                           self%rate_unit(p, element), &
                                                           inputs(:, c))
            if (p%has_inertia) call turn_row(self%problem%fourier, self%frequency(), p, element, &
                                             c, .false., inputs(:, c))
            if (.not. takes) cycle
            place = self%active%place(self%problem%incidence%coordinate_of(row))
            if (place > 0) inputs(:, c) = inputs(:, c) - balance(place, :)
         end do
      end associate
   end subroutine gather_inputs

   !> rows = rows + B^T outputs of elements of a law. They may share coordinates: threads share the
   !> coefficients.
   subroutine add_outputs(self, entry, work, elements, map, n_mapped, rows)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      !> Those that count.
      integer, intent(in) :: elements(:)
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(inout) :: rows(:, :)
      integer :: first, nc

      nc = self%problem%fourier%n_coefficients
      ! Weights that turn take the coefficients of a harmonic together.
      if (size(entry%row, 1)*size(elements)*nc < entries_for_threads .or. &
          self%problem%incidence%turns()) then
         call add_some(1, nc)
         return
      end if
      !$omp parallel do default(none) private(first) shared(nc) schedule(static)
      do first = 1, nc, few_coefficients
         call add_some(first, min(first + few_coefficients - 1, nc))
      end do
      !$omp end parallel do

   contains

      subroutine add_some(first, last)
         integer, intent(in) :: first, last
         integer :: c, i, k

         do k = 1, size(elements)
            i = elements(k)
            do c = 1, size(entry%row, 1)
               if (entry%row(c, i) == 0) cycle
               call self%problem%incidence%scatter_row( &
                  entry%row(c, i), map, n_mapped, size(rows, 1), 1.0_wp, &
                  work%output((c - 1)*nc + first:(c - 1)*nc + last, i), rows(:, first:last))
            end do
         end do
      end subroutine add_some

   end subroutine add_outputs

end submodule fw_balance_linear
