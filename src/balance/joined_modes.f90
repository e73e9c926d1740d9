!> Modes without damping of a structure with its linear springs and with all closed pairs stuck, in
!> the dofs of the model. A motion that no force acts on but those in proportion to it, and that
!> moves no pair that slips, is one of them, whatever those pairs do.
module fw_joined_modes
   use fw_dof_rows, only: dof_row
   use fw_kinds, only: wp
   use fw_linalg, only: has_pivots, solve_symmetric_eigen
   use fw_model, only: model_type
   use fw_relative, only: new_relative, relative_type
   implicit none (type, external)
   private

   public :: joined_modes, find_joined_modes

   type :: joined_modes
      !> They were found, for these rows.
      logical :: are_known = .false.
      type(dof_row), allocatable :: rows(:)
      !> Stiffness with springs and pairs, and the absolute values of what it sums up
      !> (n_dof, n_dof).
      real(wp), allocatable :: stiffness(:, :), sizes(:, :)
      !> Displacements of the held rows among the coordinates that are left, see fw_relative.
      type(relative_type) :: held
      !> 1/(theta + shift), theta the square of the frequency, and the shapes in all dofs.
      real(wp) :: shift = 0.0_wp
      real(wp), allocatable :: values(:), shapes(:, :)
   contains
      procedure :: fit
      procedure :: are_near
      procedure :: clean
      procedure :: add_holds
   end type joined_modes

   !> Shifts of a stiffness that does not hold the structure, in parts of K over M.
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp]
   !> Accuracy of values, beside the largest.
   real(wp), parameter :: value_round_off = 1.0e-13_wp

contains

   !> Whether the rows are those that the modes were found for: slip is no matter.
   pure logical function fit(self, rows)
      class(joined_modes), intent(in) :: self
      type(dof_row), intent(in) :: rows(:)

      fit = self%are_known
      if (.not. fit) return
      fit = size(self%rows) == size(rows)
      if (fit) fit = all(self%rows%is_like(rows))
   end function fit

   !> Modes whose square of the frequency is theta but for a part of it.
   pure function are_near(self, theta, part) result(near)
      class(joined_modes), intent(in) :: self
      real(wp), intent(in) :: theta, part
      logical :: near(size(self%values))

      associate (inverse => theta + self%shift)
         near = abs(self%values*inverse - 1.0_wp) <= &
                part + value_round_off*inverse*maxval(self%values)
      end associate
   end function are_near

   !> Take out of the shapes near theta what round-off has left in them of all others: their error
   !> is that of the eigenproblem before, of the sums of S then.
   pure subroutine clean(self, mass, theta, part, shapes)
      class(joined_modes), intent(in) :: self
      real(wp), intent(in) :: mass(:, :), theta, part
      !> (n_dof, n)
      real(wp), intent(inout) :: shapes(:, :)
      real(wp), allocatable :: others(:, :), values(:), weights(:, :)
      integer, allocatable :: far(:)
      integer :: j, turn

      far = pack([(j, j=1, size(self%values))], .not. self%are_near(theta, part))
      others = self%shapes(:, far)
      values = 1.0_wp - self%values(far)*(theta + self%shift)
      do turn = 1, 2
         weights = matmul(transpose(others), matmul(self%stiffness - theta*mass, shapes))
         weights = weights/spread(values, 2, size(shapes, 2))
         shapes = shapes - matmul(others, weights)
      end do
   end subroutine clean

   !> The modes, found anew.
   subroutine find_joined_modes(model, rows, self)
      type(model_type), intent(in) :: model
      type(dof_row), intent(in) :: rows(:)
      type(joined_modes), intent(out) :: self
      real(wp), allocatable :: t(:, :), k(:, :), m(:, :), vectors(:, :)
      logical :: done
      integer :: i, trial

      self%rows = rows
      self%are_known = .true.
      self%stiffness = model%stiffness
      self%sizes = abs(model%stiffness)
      do i = 1, size(rows)
         if (.not. rows(i)%is_held) call rows(i)%add_to(self%stiffness, self%sizes)
      end do
      call self%add_holds(model%rows, t)
      k = matmul(transpose(t), matmul(self%stiffness, t))
      m = matmul(transpose(t), matmul(model%mass, t))
      done = .false.
      do trial = merge(1, 2, has_pivots(k)), size(shift_trials)
         self%shift = shift_trials(trial)*norm2(k)/max(norm2(m), tiny(1.0_wp))
         call solve_symmetric_eigen(m, k + self%shift*m, self%values, vectors, done)
         if (done) exit
      end do
      if (done) then
         self%shapes = matmul(t, vectors)
      else
         ! A part that neither stiffness nor mass holds: no modes.
         self%values = [real(wp) ::]
         allocate (self%shapes(model%n_dof, 0))
      end if
   end subroutine find_joined_modes

   !> u = t eta of all motions that the held rows leave.
   subroutine add_holds(self, of_model, t)
      class(joined_modes), intent(inout) :: self
      !> Rows of the model.
      real(wp), allocatable, intent(in) :: of_model(:, :)
      real(wp), allocatable, intent(out) :: t(:, :)
      integer, allocatable :: held(:)
      integer :: i, j

      held = pack([(i, i=1, size(self%rows))], self%rows%is_held)
      call new_relative(size(self%stiffness, 1), [(self%rows(held(i))%side(1), i=1, size(held))], &
                        [(self%rows(held(i))%side(2), i=1, size(held))], self%held, of_model)
      allocate (t(size(self%stiffness, 1), size(self%held%free)), source=0.0_wp)
      t(self%held%pivot, :) = -self%held%r
      do j = 1, size(self%held%free)
         t(self%held%free(j), j) = 1.0_wp
      end do
   end subroutine add_holds

end module fw_joined_modes
