!> A sector tied to its neighbours in a nodal diameter k: u(right) = z u(left), z = exp(-2 pi i
!> k/N),
!>
!>   K_k = T^H K T,   F = T^H f,   rows of relative displacements (S_1 - z**sector_2 S_2) T,
!>
!> T being the identity but for the right interface, which is no coordinate any more. Where the
!> model holds matrices of nodal diameters, T is the identity of the physical coordinates.
module fw_sector
   use fw_closed_joint, only: closed_joint
   use fw_cyclic_data, only: nodal_matrices, nodal_speed
   use fw_error, only: error_type
   use fw_held_damping, only: add_held_damping
   use fw_hermitian, only: complex_part, real_form
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_sector_relative, only: held_basis, new_sector_relative, sector_relative
   use fw_side, only: terms_of
   implicit none (type, external)
   private

   public :: sector_at, speed_at, sector_rows, damp_modes, add_sector_spring, close_sector
   public :: damp_structure

contains

   !> The matrices of nodal diameter k = 0 .. N/2, with damping of modes.
   subroutine sector_at(model, k, nodal, error)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      type(nodal_matrices), intent(out) :: nodal
      type(error_type), allocatable, intent(out) :: error
      complex(wp) :: turn(model%n_dof)
      integer :: place(model%n_dof), n

      if (model%cyclic%has_nodal()) then
         nodal = model%cyclic%nodal(k + 1)
         if (allocated(model%cyclic%air)) call add_air(model, k, nodal)
         if (model%cyclic%loss_factor > 0.0_wp) then
            call nodal%add_structural(model%cyclic%loss_factor*nodal%stiffness)
         end if
         return
      end if
      call tie_sector(model, k, place, turn, n)
      nodal%mass = tied(model%mass, place, turn, n)
      nodal%stiffness = tied(model%stiffness, place, turn, n)
      if (any(abs(model%damping) > 0.0_wp)) nodal%damping = tied(model%damping, place, turn, n)
      call tie_vectors(model, place, turn, n, nodal)
      if (allocated(model%cyclic%coriolis)) nodal%coriolis = tied(model%cyclic%coriolis, place, &
                                                                  turn, n)
      if (allocated(model%cyclic%air)) call add_air(model, k, nodal)
      if (allocated(model%cyclic%circulatory)) then
         call nodal%add_circulatory(tied(model%cyclic%circulatory, place, turn, n))
      end if
      if (allocated(model%cyclic%structural)) then
         call nodal%add_structural(tied(model%cyclic%structural, place, turn, n))
      end if
      if (model%cyclic%modal_damping > 0.0_wp) then
         call damp_modes(model, k, model%cyclic%modal_damping, nodal, error)
      end if
   end subroutine sector_at

   !> What follows the speed, in nodal diameter k = 0 .. N/2.
   subroutine speed_at(model, k, nodal)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      type(nodal_speed), intent(out) :: nodal
      complex(wp) :: turn(model%n_dof)
      integer :: i, place(model%n_dof), n, p

      call tie_sector(model, k, place, turn, n)
      associate (speed => model%cyclic%speed)
         nodal%order = speed%order
         nodal%rayleigh = speed%rayleigh
         nodal%loss = speed%loss
         if (allocated(speed%coriolis)) nodal%coriolis = tied(speed%coriolis, place, turn, n)
         if (allocated(speed%circulatory)) nodal%circulatory = tied(speed%circulatory, place, &
                                                                    turn, n)
         if (allocated(speed%growth%stiffness)) then
            allocate (nodal%stiffness(n, n, size(speed%growth%stiffness, 3)))
            do p = 1, size(nodal%stiffness, 3)
               nodal%stiffness(:, :, p) = tied(speed%growth%stiffness(:, :, p), place, turn, n)
            end do
         end if
         if (.not. allocated(speed%growth%load)) return
         allocate (nodal%load(n, size(speed%growth%load, 2)), source=(0.0_wp, 0.0_wp))
         do i = 1, model%n_dof
            nodal%load(place(i), :) = nodal%load(place(i), :) + conjg(turn(i))* &
                                      speed%growth%load(i, :)
         end do
      end associate
   end subroutine speed_at

   !> The stiffness of the air for the waves in both directions; their matrices are not alike, but
   !> T of -k is the conjugate of T of k. Zero where the model does not say it.
   pure subroutine add_air(model, k, nodal)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      type(nodal_matrices), intent(inout) :: nodal
      complex(wp), allocatable :: q(:, :), w(:, :)
      complex(wp) :: turn(model%n_dof)
      integer :: place(model%n_dof), i, n, way

      if (model%cyclic%has_nodal()) then
         ! Displacements stand in front of the coordinates.
         turn = (1.0_wp, 0.0_wp)
         place = [(i, i=1, model%n_dof)]
      else
         call tie_sector(model, k, place, turn, n)
      end if
      n = size(nodal%mass, 1)
      allocate (nodal%aero(n, n, 2), source=(0.0_wp, 0.0_wp))
      allocate (w(size(model%cyclic%air%modes, 1), n), source=(0.0_wp, 0.0_wp))
      do i = 1, model%n_dof
         w(:, place(i)) = w(:, place(i)) + turn(i)*model%cyclic%air%modes(:, i)
      end do
      do way = 1, 2
         call model%cyclic%air_stiffness(merge(k, -k, way == 1), q)
         if (allocated(q)) nodal%aero(:, :, way) = matmul(conjg(transpose(w)), matmul(q, w))
         w = conjg(w)
      end do
   end subroutine add_air

   !> Where the dofs of a sector stand in the tied one, and the factor of each: T.
   pure subroutine tie_sector(model, k, place, turn, n)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      !> (n_dof).
      integer, intent(out) :: place(:)
      complex(wp), intent(out) :: turn(:)
      !> Coordinates of the tied sector, those of all nodal diameters alike.
      integer, intent(out) :: n
      integer :: i

      turn = (1.0_wp, 0.0_wp)
      place = 0
      associate (cyclic => model%cyclic)
         if (allocated(cyclic%right)) then
            do i = 1, size(cyclic%right)
               turn(abs(cyclic%right(i))) = sign(1, cyclic%right(i))*cyclic%factor(k, 1)
               place(abs(cyclic%right(i))) = -cyclic%left(i)
            end do
         end if
         n = 0
         do i = 1, model%n_dof
            if (place(i) < 0) cycle
            n = n + 1
            place(i) = n
         end do
         do i = 1, model%n_dof
            if (place(i) < 0) place(i) = place(-place(i))
         end do
      end associate
   end subroutine tie_sector

   !> T^H A T.
   pure function tied(matrix, place, turn, n) result(reduced)
      real(wp), intent(in) :: matrix(:, :)
      integer, intent(in) :: place(:)
      complex(wp), intent(in) :: turn(:)
      integer, intent(in) :: n
      complex(wp), allocatable :: reduced(:, :)
      integer :: i, j

      allocate (reduced(n, n), source=(0.0_wp, 0.0_wp))
      do j = 1, size(place)
         do i = 1, size(place)
            reduced(place(i), place(j)) = reduced(place(i), place(j)) + &
                                          conjg(turn(i))*matrix(i, j)*turn(j)
         end do
      end do
   end function tied

   !> Loads T^H f and observed rows times T.
   pure subroutine tie_vectors(model, place, turn, n, nodal)
      type(model_type), intent(in) :: model
      integer, intent(in) :: place(:)
      complex(wp), intent(in) :: turn(:)
      integer, intent(in) :: n
      type(nodal_matrices), intent(inout) :: nodal
      real(wp), allocatable :: loads(:, :)
      integer :: i

      loads = model%load_columns()
      nodal%waves = model%waves
      allocate (nodal%load(n, size(loads, 2)), nodal%observe(size(model%observe_matrix, 1), n), &
                source=(0.0_wp, 0.0_wp))
      do i = 1, model%n_dof
         associate (f => nodal%load(place(i), :), row => nodal%observe(:, place(i)))
            f = f + conjg(turn(i))*loads(i, :)
            row = row + turn(i)*model%observe_matrix(:, i)
         end associate
      end do
   end subroutine tie_vectors

   !> Modal damping of a structure that is no sector, added to a matrix.
   subroutine damp_structure(model, stiffness, ratio, damping, error, up_to)
      !> With its mass, and the joint that its modes are those of.
      type(model_type), intent(in) :: model
      !> Symmetric (n_dof, n_dof).
      real(wp), contiguous, intent(in) :: stiffness(:, :)
      real(wp), intent(in) :: ratio
      real(wp), intent(inout) :: damping(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> Circular frequency above which no mode is damped [rad/s]; 0: all are.
      real(wp), intent(in) :: up_to
      complex(wp), allocatable :: closed(:, :), basis(:, :)
      real(wp), allocatable :: free(:, :)

      if (.not. allocated(model%damped_joint)) then
         call add_held_damping(model%mass, stiffness, ratio, damping, error, up_to)
         return
      end if
      closed = cmplx(stiffness, 0.0_wp, wp)
      call close_sector(model, model%damped_joint, 0, closed, basis)
      ! Not allocated: all rows are springs.
      if (allocated(basis)) free = real(basis, wp)
      call add_held_damping(model%mass, real(closed, wp), ratio, damping, error, up_to, free)
   end subroutine damp_structure

   !> Modal damping of Hermitian modes: those of the real form, in which each stands twice.
   subroutine damp_modes(model, k, ratio, nodal, error)
      !> Whose nodal diameter this is, with the joint that the modes are those of.
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      real(wp), intent(in) :: ratio
      type(nodal_matrices), intent(inout) :: nodal
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: stiffness(:, :), basis(:, :)
      real(wp), allocatable :: damping(:, :), free(:, :)
      integer :: n

      n = size(nodal%mass, 1)
      allocate (damping(2*n, 2*n), source=0.0_wp)
      stiffness = nodal%stiffness
      if (allocated(model%damped_joint)) then
         call close_sector(model, model%damped_joint, k, stiffness, basis)
         if (allocated(basis)) free = real_form(basis)
      end if
      call add_held_damping(real_form(nodal%mass), real_form(stiffness), ratio, damping, error, &
                            basis=free)
      if (allocated(error)) return
      if (allocated(nodal%damping)) then
         nodal%damping = nodal%damping + complex_part(damping)
      else
         nodal%damping = complex_part(damping)
      end if
   end subroutine damp_modes

   !> Rows (S_1 - z**sector_2 S_2) T of pairs and springs (n_rows, n).
   pure subroutine sector_rows(model, k, side_1, side_2, sector_2, rows, others)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      !> Signed dofs and rows of the model, 0 for the ground, and the sector of the second (n_rows).
      integer, intent(in) :: side_1(:), side_2(:), sector_2(:)
      complex(wp), intent(out), allocatable :: rows(:, :)
      !> Rows of all dofs behind them (n_others, n_dof).
      real(wp), intent(in), optional :: others(:, :)
      complex(wp) :: turn(model%n_dof), z
      integer :: i, n, n_rows, place(model%n_dof), r

      call tie_sector(model, k, place, turn, n)
      n_rows = size(side_1)
      if (present(others)) n_rows = n_rows + size(others, 1)
      allocate (rows(n_rows, n), source=(0.0_wp, 0.0_wp))
      do r = 1, size(side_1)
         z = model%cyclic%factor(k, sector_2(r))
         associate (row => rows(r, :))
            call add_side(model, place, turn, side_1(r), (1.0_wp, 0.0_wp), row)
            call add_side(model, place, turn, side_2(r), -z, row)
         end associate
      end do
      if (.not. present(others)) return
      do i = 1, model%n_dof
         associate (column => rows(size(side_1) + 1:, place(i)))
            column = column + turn(i)*others(:, i)
         end associate
      end do
   end subroutine sector_rows

   pure subroutine add_side(model, place, turn, side, factor, row)
      type(model_type), intent(in) :: model
      integer, intent(in) :: place(:)
      complex(wp), intent(in) :: turn(:)
      integer, intent(in) :: side
      complex(wp), intent(in) :: factor
      complex(wp), intent(inout) :: row(:)
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)
      integer :: j

      call terms_of(side, dof, weight, model%rows)
      do j = 1, size(dof)
         associate (i => place(dof(j)))
            row(i) = row(i) + weight(j)*factor*turn(dof(j))
         end associate
      end do
   end subroutine add_side

   !> A joint closed in nodal diameter k: its springs join the stiffness; where rows are held, there
   !> is a basis of the motions that leave them alone.
   subroutine close_sector(model, joint, k, stiffness, basis)
      type(model_type), intent(in) :: model
      type(closed_joint), intent(in) :: joint
      integer, intent(in) :: k
      !> Hermitian (n, n).
      complex(wp), intent(inout) :: stiffness(:, :)
      !> (n, n - n_held), not allocated where nothing is held.
      complex(wp), allocatable, intent(out) :: basis(:, :)
      type(sector_relative) :: relative
      complex(wp), allocatable :: rows(:, :)
      integer :: i

      if (joint%n_rows() == 0) return
      call sector_rows(model, k, joint%side_1, joint%side_2, joint%sector_2, rows)
      do i = 1, joint%n_rows()
         if (.not. joint%is_held(i)) call add_sector_spring(rows(i, :), joint%stiffness(i), &
                                                            stiffness)
      end do
      if (.not. any(joint%is_held)) return
      rows = rows(pack([(i, i=1, joint%n_rows())], joint%is_held), :)
      call new_sector_relative(rows, relative)
      call held_basis(relative, size(stiffness, 1), basis)
   end subroutine close_sector

   !> stiffness + row^H coefficient row; the row holds the first coordinates.
   pure subroutine add_sector_spring(row, coefficient, stiffness)
      complex(wp), intent(in) :: row(:)
      real(wp), intent(in) :: coefficient
      complex(wp), intent(inout) :: stiffness(:, :)
      integer :: i, j

      do j = 1, size(row)
         if (abs(row(j)) <= 0.0_wp) cycle
         do i = 1, size(row)
            stiffness(i, j) = stiffness(i, j) + conjg(row(i))*coefficient*row(j)
         end do
      end do
   end subroutine add_sector_spring

end module fw_sector
