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
!> Time steps follow Newmark's rule of constant mean acceleration (error h**2, no numerical damping),
!> with backward Euler for massless damped directions: there the mean rule would ring.
module fw_stability_march
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_failure
   use fw_error, only: status_input
   use fw_forces, only: forces_type
   use fw_hbm, only: hbm_system
   use fw_kinds, only: pi
   use fw_kinds, only: wp
   use fw_lapack, only: dgeev
   use fw_lapack, only: dgemm
   use fw_lapack, only: dgetrs
   use fw_linalg, only: lu_type
   use fw_stability_basis, only: perturbation_basis
   use fw_stability_tangent, only: history_type
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
      !> Force by predicted force, and by position, at the present instant (row, row).
      real(wp), allocatable :: by_y(:, :), by_x(:, :)
      !> The same at the instant before, to see whether the factors still hold.
      real(wp), allocatable :: factored(:, :)
      type(lu_type) :: lu
   end type march_type

contains

   !> The multipliers of largest modulus (2 n_massive + n_damped); the others, of positions that a
   !> slip wipes out, are zero.
   subroutine marched_multipliers(system, basis, history, multipliers, error)
      class(hbm_system), intent(in) :: system
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      complex(wp), allocatable, intent(out) :: multipliers(:)
      type(error_type), allocatable, intent(out) :: error
      type(march_type) :: march
      real(wp), allocatable :: monodromy(:, :)
      integer, allocatable :: memory(:)
      integer :: k

      memory = pack(history%memory_row, history%memory_row > 0)
      call start(system, basis, history, memory, march, error)
      if (allocated(error)) return
      do k = 1, history%n_time
         call set_laws(history, modulo(k, history%n_time) + 1, march)
         call advance(basis, march, error)
         if (allocated(error)) return
      end do
      associate (nd => basis%n_massive + basis%n_damped)
         allocate (monodromy(size(march%y, 2), size(march%y, 2)))
         monodromy(:nd, :) = march%y(:nd, :)
         monodromy(nd + 1:nd + basis%n_massive, :) = march%v
         monodromy(nd + basis%n_massive + 1:, :) = march%x(memory, :)
         call largest_eigenvalues(nd + basis%n_massive, monodromy, multipliers, error)
      end associate
   end subroutine marched_multipliers

   !> Unit perturbations of every coordinate with mass or damping, velocity and position.
   subroutine start(system, basis, history, memory, self, error)
      class(hbm_system), intent(in) :: system
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
      self%step = 2.0_wp*pi/(system%structure%omega*history%n_time)
      allocate (self%y(n, n_columns), self%v(nb, n_columns), self%a(nb, n_columns), source=0.0_wp)
      allocate (self%x(nr, n_columns), self%by_y(nr, nr), self%by_x(nr, nr), source=0.0_wp)
      do j = 1, nd
         self%y(j, j) = 1.0_wp
      end do
      do j = 1, nb
         self%v(j, nd + j) = 1.0_wp
      end do
      do j = 1, size(memory)
         self%x(memory(j), nd + nb + j) = 1.0_wp
      end do
      self%fixed = basis%stiffness
      do j = 1, nb
         self%fixed(:nb, j) = self%fixed(:nb, j) + 2.0_wp/self%step*basis%damping(:nb, j)
         self%fixed(j, j) = self%fixed(j, j) + 4.0_wp/self%step**2
      end do
      do j = nb + 1, nd
         self%fixed(j, j) = self%fixed(j, j) + 1.0_wp/self%step
      end do
      call set_laws(history, 1, self)
      call settle(basis, history, self, error)
   end subroutine start

   !> Static coordinates and accelerations at the first instant. Whatever the state of a pair, its
   !> force is y - x there.
   subroutine settle(basis, history, self, error)
      type(perturbation_basis), intent(in) :: basis
      type(history_type), intent(in) :: history
      type(march_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), force(:, :), by_y(:, :), static(:, :)
      integer :: nb, nd, n_static, info, i, row
      logical :: singular

      nb = basis%n_massive
      nd = nb + basis%n_damped
      n_static = basis%n - nd
      by_y = self%by_y
      do i = 1, size(history%memory_row)
         row = history%memory_row(i)
         if (row == 0) cycle
         by_y(row, :) = 0.0_wp
         by_y(row, row) = history%stiffness(row)
      end do
      stiffness = basis%stiffness + matmul(basis%direction, matmul(by_y, transpose(basis%direction)))
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
         deallocate (self%lu%matrix, self%lu%pivot)
      end if
      self%a = -force(:nb, :) - matmul(basis%damping(:nb, :nb), self%v)
   end subroutine settle

   subroutine refuse_loose(error)
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, '&sweep stability: a dof without mass and damping is held by '// &
                       'neither stiffness nor contact; hold it or give it mass', status_input)
   end subroutine refuse_loose

   !> Derivatives of all forces at an instant.
   pure subroutine set_laws(history, instant, self)
      type(history_type), intent(in) :: history
      integer, intent(in) :: instant
      type(march_type), intent(inout) :: self

      call history%derivatives(instant, self%by_y, self%by_x)
   end subroutine set_laws

   !> One step to the instant whose laws are set.
   subroutine advance(basis, self, error)
      type(perturbation_basis), intent(in) :: basis
      type(march_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: rhs(:, :), rows(:, :)
      integer :: nb, nd, info
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
         rhs(:nb, :) = rhs(:nb, :) + 4.0_wp/h**2*y + 4.0_wp/h*v + a + &
                       matmul(basis%damping(:nb, :nb), 2.0_wp/h*y + v)
         rhs(nb + 1:nd, :) = rhs(nb + 1:nd, :) + self%y(nb + 1:nd, :)/h
         call dgetrs('N', basis%n, size(rhs, 2), self%lu%matrix, basis%n, self%lu%pivot, rhs, &
                     basis%n, info)
         a = 4.0_wp/h**2*(rhs(:nb, :) - y) - 4.0_wp/h*v - a
         v = 2.0_wp/h*(rhs(:nb, :) - y) - v
      end associate
      self%y = rhs
      rows = matmul(transpose(basis%direction), self%y)
   end subroutine advance

end module fw_stability_march
