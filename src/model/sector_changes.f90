!> What the mass of bodies changes of a sector that is tied in a nodal diameter,
!>
!>   T^H dM T,   T^H dC T,   T^H df,
!>
!> with T of fw_sector. Damping of modes follows the mass: each nodal diameter has its own modes.
module fw_sector_changes
   use fw_cyclic_data, only: nodal_matrices
   use fw_damping, only: difference_place, difference_step, difference_weight
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_sector, only: damp_modes, sector_rows
   implicit none (type, external)
   private

   public :: nodal_change, changes_at

   !> Derivatives by one of the `changes` of a model.
   type :: nodal_change
      !> Of mass and damping (n, n), and of the static load (n).
      complex(wp), allocatable :: mass(:, :), damping(:, :), load(:)
   end type nodal_change

contains

   !> All changes in nodal diameter k = 0 .. N/2.
   subroutine changes_at(model, k, nodal, changes, error)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      type(nodal_matrices), intent(in) :: nodal
      type(nodal_change), allocatable, intent(out) :: changes(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: identity(model%n_dof, model%n_dof)
      complex(wp), allocatable :: t(:, :)
      integer :: c, i

      allocate (changes(size(model%changes)))
      identity = 0.0_wp
      do i = 1, model%n_dof
         identity(i, i) = 1.0_wp
      end do
      ! Rows of the dofs one by one are T itself.
      call sector_rows(model, k, [integer ::], [integer ::], [integer ::], t, identity)
      do c = 1, size(changes)
         associate (change => changes(c), of => model%changes(c), m => size(t, 2), &
                    n => size(nodal%mass, 1))
            ! Modal coordinates may stand behind the displacements, which bodies are among.
            allocate (change%mass(n, n), change%damping(n, n), change%load(n), &
                      source=(0.0_wp, 0.0_wp))
            change%mass(:m, :m) = matmul(conjg(transpose(t)), matmul(of%mass, t))
            change%damping(:m, :m) = matmul(conjg(transpose(t)), matmul(of%damping, t))
            change%load(:m) = matmul(conjg(transpose(t)), of%load_static)
            if (model%cyclic%modal_damping <= 0.0_wp) cycle
            call follow_modes(model, k, of%value, nodal, change, error)
            if (allocated(error)) return
         end associate
      end do
   end subroutine changes_at

   !> Modes turn with the mass: a difference of the square root that modal damping is.
   subroutine follow_modes(model, k, mass, nodal, change, error)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      real(wp), intent(in) :: mass
      type(nodal_matrices), intent(in) :: nodal
      type(nodal_change), intent(inout) :: change
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: moved
      real(wp) :: h
      integer :: i

      h = difference_step*mass
      do i = 1, size(difference_place)
         moved%mass = nodal%mass + difference_place(i)*h*change%mass
         moved%stiffness = nodal%stiffness
         if (allocated(moved%damping)) deallocate (moved%damping)
         call damp_modes(model, k, model%cyclic%modal_damping, moved, error)
         if (allocated(error)) return
         change%damping = change%damping + difference_weight(i)/h*moved%damping
      end do
   end subroutine follow_modes

end module fw_sector_changes
