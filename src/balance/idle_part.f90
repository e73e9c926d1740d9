!> Motions of one harmonic in the dofs of the model, from and to the unknowns of a balance.
module fw_idle_part
   use fw_balance_state, only: balance_state
   use fw_complex_form, only: amplitudes_of
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type, lu_type
   use fw_plain_structure, only: plain_structure
   implicit none (type, external)
   private

   public :: find_motion, part_in, add_motion

contains

   !> The motion of all dofs in the h-th harmonic.
   subroutine find_motion(system, x, h, motion)
      type(balance_state), intent(inout) :: system
      !> Coefficients of the coordinates.
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: h
      complex(wp), allocatable, intent(out) :: motion(:)
      complex(wp), allocatable :: q(:, :), field(:, :)
      integer :: m, n

      associate (structure => system%problem%structure)
         m = structure%n_coordinates
         n = structure%whole_size()
         allocate (q(m, size(structure%harmonic)), field(n, size(structure%harmonic)))
         call amplitudes_of(structure%harmonic, structure%column, m, x, m, q)
         call structure%complete_field(system%structure_state, q, field=field)
         select type (structure)
         type is (plain_structure)
            motion = matmul(structure%basis%basis, field(:, h))
         end select
      end associate
   end subroutine find_motion

   !> What a motion has of shapes, which it is orthogonal to without that, with the mass.
   function part_in(mass, shapes, motion) result(part)
      real(wp), intent(in) :: mass(:, :)
      complex(wp), intent(in) :: shapes(:, :), motion(:)
      complex(wp) :: part(size(motion))
      complex(wp) :: weights(size(shapes, 2), 1), inertia(size(mass, 1), size(shapes, 2))
      type(complex_lu_type) :: lu
      logical :: singular
      integer :: n

      part = (0.0_wp, 0.0_wp)
      n = size(shapes, 2)
      if (n == 0) return
      inertia = matmul(mass, shapes)
      call lu%reserve(n)
      lu%matrix(:n, :n) = matmul(conjg(transpose(shapes)), inertia)
      call lu%factor(singular)
      if (singular) return
      weights(:, 1) = matmul(motion, conjg(inertia))
      call lu%solve(1, weights)
      part = matmul(shapes, weights(:, 1))
   end function part_in

   !> Add a motion of all dofs to the coefficients of the coordinates.
   subroutine add_motion(system, h, motion, x)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      complex(wp), intent(in) :: motion(:)
      real(wp), intent(inout), contiguous :: x(:)
      type(lu_type) :: lu
      real(wp) :: columns(size(motion), 2)
      logical :: singular
      integer :: k, m

      select type (structure => system%problem%structure)
      type is (plain_structure)
         m = structure%n_coordinates
         call lu%reserve(size(motion))
         lu%matrix(:size(motion), :size(motion)) = structure%basis%basis
         call lu%factor(singular)
         if (singular) return
         columns(:, 1) = real(motion, wp)
         columns(:, 2) = -aimag(motion)
         call lu%solve(columns(:, 1))
         call lu%solve(columns(:, 2))
         k = (structure%column(h) - 1)*m
         x(k + 1:k + 2*m) = x(k + 1:k + 2*m) + [columns(:m, 1), columns(:m, 2)]
      end select
   end subroutine add_motion

end module fw_idle_part
