!> One harmonic of the whole field of a condensed structure, from and to its coordinates: rarely
!> asked for, so that the factors of the internal block are made anew each time.
module fw_whole_field
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: condense_harmonic, complete_harmonic

contains

   !> load = F_q - Z_qi D^-1 F_i.
   subroutine condense_harmonic(basis, theta, s, field, load)
      type(reduction_type), intent(in) :: basis
      !> Factors of the mass (negative) and of the damping (times i), see plain_structure.
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      !> Loads of the coordinates, then of the internal modes.
      complex(wp), intent(in) :: field(:)
      complex(wp), intent(out) :: load(:)
      complex(wp) :: x(basis%n_internal, 1)

      load = field(:basis%n_coordinates)
      if (basis%n_internal == 0) return
      x(:, 1) = field(basis%n_coordinates + 1:)
      call solve_internal(basis, theta, s, x)
      load = load - matmul(x(:, 1), coupling(basis, theta, s))
   end subroutine condense_harmonic

   !> x = D^-1 (F_i - Z_iq q).
   subroutine complete_harmonic(basis, theta, s, q, load, amplitude)
      type(reduction_type), intent(in) :: basis
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp), intent(in) :: q(:)
      !> F_i (n_internal).
      complex(wp), intent(in) :: load(:)
      complex(wp), intent(out) :: amplitude(:)
      complex(wp) :: x(basis%n_internal, 1)

      if (basis%n_internal == 0) return
      x(:, 1) = load - matmul(coupling(basis, theta, s), q)
      call solve_internal(basis, theta, s, x)
      amplitude = x(:, 1)
   end subroutine complete_harmonic

   subroutine solve_internal(basis, theta, s, x)
      type(reduction_type), intent(in) :: basis
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp), intent(inout) :: x(:, :)
      type(internal_block) :: internal
      logical :: unused

      ! The same factors were made when the structure went to its frequency: they do not fail.
      call internal%factor(basis, theta, s, unused)
      call internal%solve(1, x)
   end subroutine solve_internal

   !> Z_iq = K_iq - theta M_iq + i s C_iq (n_internal, n_coordinates).
   pure function coupling(basis, theta, s)
      type(reduction_type), intent(in) :: basis
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      complex(wp) :: coupling(basis%n_internal, basis%n_coordinates)

      associate (m => basis%n_coordinates)
         coupling = basis%blocks(m + 1:, :, 1) - theta*basis%blocks(m + 1:, :, 2)
         if (basis%n_blocks == 3) then
            coupling = coupling + cmplx(0.0_wp, s, wp)*basis%blocks(m + 1:, :, 3)
         end if
         if (basis%loss_at(s) > 0.0_wp) then
            coupling = coupling + cmplx(0.0_wp, basis%loss, wp)*basis%blocks(m + 1:, :, 1)
         end if
      end associate
   end function coupling

end module fw_whole_field
