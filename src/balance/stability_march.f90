!> Floquet multipliers from the monodromy matrix: the perturbations of all coordinates, velocities
!> and positions of the slipping pairs, marched through one period of the solution.
!>
!> Friction is taken as it is, with its memory. With dy the perturbation of the predicted force, dx
!> that of the corrected position, p the pressure, d = y - x and e = d/|d|, at every instant
!>
!>   stick  df = dy - dx,                                    dx unchanged
!>   slip   df = mu p/|d| (I - e e^T)(dy - dx) - mu e dy_n,  dx = dy - df
!>   open   df = 0,                                          dx = dy.
!>
!> Laws that act at once and other elements have no positions: df = df/du du + df/dv dv.
!>
!> Time steps follow Newmark's rule of constant mean acceleration (error h**2, no numerical
!> damping), with backward Euler for massless damped directions: there the mean rule would ring.
module fw_stability_march
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_balance_state, only: balance_state
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dgeev, dgetrs
   use fw_linalg, only: lu_type
   use fw_stability_basis, only: perturbation_basis
   use fw_stability_history, only: history_type
   implicit none (type, external)
   private

   public :: marched_multipliers

   !> Perturbations under way, one a column.
   type :: march_type
      real(wp) :: step = 0.0_wp
      !> Coordinates (n, n_columns); velocities and accelerations (n_massive, n_columns).
      real(wp), allocatable :: y(:, :), v(:, :), a(:, :)
      !> Corrected positions [force] (row of the joint, n_columns).
      real(wp), allocatable :: x(:, :)
      !> Constant part of the matrix of a step (n, n).
      real(wp), allocatable :: fixed(:, :)
      !> Derivatives of the forces at the present instant, see history_type.
      real(wp), allocatable :: by_u(:, :), by_v(:, :), by_x(:, :)
      logical, allocatable :: keeps(:)
      !> by_u and by_v of the factors in lu.
      real(wp), allocatable :: factored(:, :), factored_v(:, :)
      !> Rates of the coordinates at the end of a step over their change in it (n).
      real(wp), allocatable :: per_step(:)
      type(lu_type) :: lu
   end type march_type

contains

   !> The multipliers of largest modulus (2 n_massive + n_damped); the others, of positions that a
   !> slip wipes out, are zero.
   subroutine marched_multipliers(system, basis, history, multipliers, error)
      class(balance_state), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      complex(wp), allocatable, intent(out) :: multipliers(:)
      type(error_type), allocatable, intent(out) :: error
      type(march_type) :: march
      real(wp), allocatable :: monodromy(:, :)
      integer, allocatable :: memory(:)
      integer :: k

      memory = pack([(k, k=1, size(history%remembers))], history%remembers)
      call start(system, basis, history, memory, march, error)
      if (allocated(error)) return
      ! From instant 1 through the others, and back to it: derivatives are those at the end of a
      ! step.
      do k = 1, history%n_time
         call history%derivatives(modulo(k, history%n_time) + 1, march%by_u, march%by_v, &
                                  march%by_x, march%keeps)
         call advance(basis, history, march, error)
         if (allocated(error)) return
      end do
      associate (nd => basis%n_massive + basis%n_damped)
         allocate (monodromy(size(march%y, 2), size(march%y, 2)))
         ! Column j is where the j-th unit perturbation is after a period. Static coordinates
         ! follow the others, and positions without memory are no states: neither has a row.
         monodromy(:nd, :) = march%y(:nd, :)
         monodromy(nd + 1:nd + basis%n_massive, :) = march%v
         monodromy(nd + basis%n_massive + 1:, :) = march%x(memory, :)
         call largest_eigenvalues(nd + basis%n_massive, monodromy, multipliers, error)
      end associate
   end subroutine marched_multipliers

   !> Unit perturbations of every coordinate with mass or damping, velocity and position.
   subroutine start(system, basis, history, memory, self, error)
      class(balance_state), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      integer, intent(in) :: memory(:)
      type(march_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: n, nb, nd, nr, n_columns, j

      n = basis%n
      nb = basis%n_massive
      nd = nb + basis%n_damped
      nr = size(basis%direction, 2)
      n_columns = nd + nb + size(memory)
      self%step = 2.0_wp*pi/(system%frequency()*history%n_time)
      allocate (self%y(n, n_columns), self%v(nb, n_columns), self%a(nb, n_columns), source=0.0_wp)
      allocate (self%x(nr, n_columns), self%by_u(nr, nr), self%by_v(nr, nr), &
                self%by_x(nr, nr), source=0.0_wp)
      self%per_step = [(merge(2.0_wp, 1.0_wp, j <= nb)/self%step, j=1, n)]
      allocate (self%keeps(nr))
      do j = 1, nd
         self%y(j, j) = 1.0_wp
      end do
      do j = 1, nb
         self%v(j, nd + j) = 1.0_wp
      end do
      do j = 1, size(memory)
         self%x(memory(j), nd + nb + j) = 1.0_wp
      end do
      ! Of the massive ones K + 2/h C + 4/h^2, of the damped ones K + 1/h: their masses and
      ! dampings are 1 (fw_stability_basis).
      self%fixed = basis%stiffness
      do j = 1, nb
         self%fixed(:nb, j) = self%fixed(:nb, j) + 2.0_wp/self%step*basis%damping(:nb, j)
         self%fixed(j, j) = self%fixed(j, j) + 4.0_wp/self%step**2
      end do
      do j = nb + 1, nd
         self%fixed(j, j) = self%fixed(j, j) + 1.0_wp/self%step
      end do
      call history%derivatives(1, self%by_u, self%by_v, self%by_x, self%keeps)
      call settle(basis, history, self, error)
   end subroutine start

   !> Static coordinates and accelerations at the first instant. Whatever the state of a pair, its
   !> force is y - x there.
   subroutine settle(basis, history, self, error)
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      type(march_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), force(:, :), by_u(:, :), static(:, :)
      integer :: nb, nd, n_static, info, row
      logical :: singular

      nb = basis%n_massive
      nd = nb + basis%n_damped
      n_static = basis%n - nd
      ! Positions at the start are perturbed by themselves, not through the law: whatever state the
      ! pair is in, df = k du - dx.
      by_u = self%by_u
      do row = 1, size(history%remembers)
         if (.not. history%remembers(row)) cycle
         by_u(row, :) = 0.0_wp
         by_u(row, row) = history%stiffness(row)
      end do
      stiffness = basis%stiffness + &
                  matmul(basis%direction, matmul(by_u, transpose(basis%direction)))
      force = matmul(stiffness(:, :nd), self%y(:nd, :)) - matmul(basis%direction, self%x)
      if (n_static > 0) then
         call self%lu%reserve(n_static)
         self%lu%matrix = stiffness(nd + 1:, nd + 1:)
         call self%lu%factor(singular)
         if (singular) then
            call refuse_loose(error)
            return
         end if
         static = -force(nd + 1:, :)
         call dgetrs('N', n_static, size(static, 2), self%lu%matrix, n_static, self%lu%pivot, &
                     static, n_static, info)
         self%y(nd + 1:, :) = static
         force = force + matmul(stiffness(:, nd + 1:), static)
         ! The storage never shrinks, and its leading dimension must be that of the steps.
         deallocate (self%lu%matrix, self%lu%pivot)
      end if
      self%a = -force(:nb, :) - matmul(basis%damping(:nb, :nb), self%v)
      if (history%has_rates) self%a = self%a - &
         matmul(basis%direction(:nb, :), matmul(self%by_v, matmul( &
                transpose(basis%direction(:nb, :)), self%v)))
   end subroutine settle

   !> A static direction without stiffness: its position is anything.
   subroutine refuse_loose(error)
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, '&sweep stability: a dof without mass and damping is held by '// &
                       'neither stiffness nor contact; hold it or give it mass', status_input)
   end subroutine refuse_loose

   !> One step to the instant whose derivatives are at hand.
   subroutine advance(basis, history, self, error)
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      type(march_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: rhs(:, :), rows(:, :), force(:, :)
      integer :: nb, nd, info, row
      logical :: singular

      nb = basis%n_massive
      nd = nb + basis%n_damped
      call factor(basis, self, singular)
      if (singular) then
         call refuse_loose(error)
         return
      end if
      rhs = -matmul(basis%direction, matmul(self%by_x, self%x))
      associate (h => self%step, y => self%y(:nb, :), v => self%v, a => self%a)
         ! Newmark: y1 = y + h/2 (v + v1), v1 = v + h/2 (a + a1), solved for a1 and v1 in y1 and
         ! put into a1 + C v1 + K y1 + f1 = 0.
         rhs(:nb, :) = rhs(:nb, :) + 4.0_wp/h**2*y + 4.0_wp/h*v + a + &
                       matmul(basis%damping(:nb, :nb), 2.0_wp/h*y + v)
         ! Backward Euler: (y1 - y)/h + K y1 + f1 = 0.
         rhs(nb + 1:nd, :) = rhs(nb + 1:nd, :) + self%y(nb + 1:nd, :)/h
         if (history%has_rates) call add_rates(basis, self, rhs)
         call dgetrs('N', basis%n, size(rhs, 2), self%lu%matrix, basis%n, self%lu%pivot, rhs, &
                     basis%n, info)
         ! a before v: it needs the velocity at the begin of the step.
         a = 4.0_wp/h**2*(rhs(:nb, :) - y) - 4.0_wp/h*v - a
         v = 2.0_wp/h*(rhs(:nb, :) - y) - v
      end associate
      self%y = rhs
      rows = matmul(transpose(basis%direction), self%y)
      force = matmul(self%by_u, rows) + matmul(self%by_x, self%x)
      do row = 1, size(rows, 1)
         ! A pair that slips or is open drags its position along: dx = dy - df.
         if (.not. history%remembers(row) .or. self%keeps(row)) cycle
         self%x(row, :) = history%stiffness(row)*rows(row, :) - force(row, :)
      end do
   end subroutine advance

   !> Forces of the velocities at the end of a step, of the part that its start decides.
   subroutine add_rates(basis, self, rhs)
      type(perturbation_basis), intent(in) :: basis
      type(march_type), intent(in) :: self
      real(wp), intent(inout) :: rhs(:, :)
      real(wp) :: rates(size(rhs, 1), size(rhs, 2))
      integer :: j

      do j = 1, size(rhs, 1)
         rates(j, :) = self%per_step(j)*self%y(j, :)
         if (j <= basis%n_massive) rates(j, :) = rates(j, :) + self%v(j, :)
      end do
      rhs = rhs + matmul(basis%direction, matmul(self%by_v, &
                                                 matmul(transpose(basis%direction), rates)))
   end subroutine add_rates

   !> Factor the matrix of a step where the laws differ from those of the factors at hand.
   subroutine factor(basis, self, singular)
      type(perturbation_basis), intent(in) :: basis
      type(march_type), intent(inout) :: self
      logical, intent(out) :: singular

      singular = .false.
      if (allocated(self%factored)) then
         ! Long stretches of stick have the same derivative at every instant: one factorization
         ! serves.
         if (all(abs(self%by_u - self%factored) <= 0.0_wp) .and. &
             all(abs(self%by_v - self%factored_v) <= 0.0_wp)) return
      end if
      self%factored = self%by_u
      self%factored_v = self%by_v
      call self%lu%reserve(basis%n)
      self%lu%matrix = self%fixed + matmul(basis%direction, &
                                           matmul(self%by_u, transpose(basis%direction)))
      if (any(abs(self%by_v) > 0.0_wp)) then
         self%lu%matrix = self%lu%matrix + &
            matmul(basis%direction, matmul(self%by_v, transpose(basis%direction)))* &
            spread(self%per_step, 1, basis%n)
      end if
      call self%lu%factor(singular)
   end subroutine factor

   !> The n_wanted eigenvalues of largest modulus.
   !> Not in order of size beyond that: n_wanted are picked one by one.
   subroutine largest_eigenvalues(n_wanted, matrix, values, error)
      integer, intent(in) :: n_wanted
      real(wp), contiguous, intent(inout) :: matrix(:, :)
      complex(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: re(:), im(:), work(:)
      complex(wp), allocatable :: all_values(:)
      logical, allocatable :: left(:)
      real(wp) :: unused(1, 1)
      integer :: n, info, j, best

      n = size(matrix, 1)
      allocate (re(n), im(n), work(max(1, 8*n)), values(n_wanted))
      call dgeev('N', 'N', n, matrix, max(1, n), re, im, unused, 1, unused, 1, work, size(work), &
                 info)
      if (info /= 0) then
         call fatal_error(error, '&sweep stability: the eigenvalues of the monodromy matrix '// &
                          'did not converge', status_failure)
         return
      end if
      all_values = cmplx(re, im, wp)
      allocate (left(n), source=.true.)
      do j = 1, n_wanted
         best = maxloc(abs(all_values), dim=1, mask=left)
         values(j) = all_values(best)
         left(best) = .false.
      end do
   end subroutine largest_eigenvalues

end module fw_stability_march
