!> How the condensed part of a structure follows the frequency at held coordinates, and the work
!> that its load does in one harmonic:
!>
!>   x = D^-1 (F_i - Z_iq q),    x' = D^-1 (F_i' - Z_iq' q - D' x),
!>   F^H u = F_q^H q + F_i^H x,  of which the row by q is F_q^H - F_i^H D^-1 Z_iq.
module fw_field_slopes
   use fw_formed_stiffness, only: harmonic_load, load_slope
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_reduction, only: reduction_type
   implicit none (type, external)
   private

   public :: follow_frequency, work_of_load

contains

   !> x and dx/d omega (n_internal) of a harmonic above 0.
   subroutine follow_frequency(basis, harmonic, omega, load_factor, q, x, slope)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> [rad/s], and what the loads of the model are multiplied by.
      real(wp), intent(in) :: omega, load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: x(:), slope(:)
      type(internal_block) :: internal
      complex(wp) :: column(basis%n_internal, 1)
      real(wp) :: n, s
      logical :: unused

      if (basis%n_internal == 0) return
      n = real(harmonic, wp)
      s = n*omega
      ! The same factors were made when the structure went to its frequency: they do not fail.
      call internal%factor(basis, cmplx(s**2, kind=wp), s, unused)
      column(:, 1) = load_factor*harmonic_load(basis%load_i, basis%waves, harmonic, s) - &
                     matmul(coupling(basis, 1.0_wp, s**2, s), q)
      call internal%solve(1, column)
      x = column(:, 1)
      column(:, 1) = load_factor*load_slope(basis%load_i, basis%waves, harmonic, s, n) - &
                     matmul(coupling(basis, 0.0_wp, 2.0_wp*n*s, n), q) + &
                     2.0_wp*n*s*basis%m_i*x
      if (allocated(basis%c_ii)) then
         column(:, 1) = column(:, 1) - cmplx(0.0_wp, n, wp)*matmul(basis%c_ii, x)
      else
         column(:, 1) = column(:, 1) - cmplx(0.0_wp, n, wp)*basis%c_i*x
      end if
      call internal%solve(1, column)
      slope = column(:, 1)
   end subroutine follow_frequency

   !> k K - theta M + i s C, rows of the internal modes (n_internal, n_coordinates).
   pure function coupling(basis, k, theta, s)
      type(reduction_type), intent(in) :: basis
      real(wp), intent(in) :: k, theta, s
      complex(wp) :: coupling(basis%n_internal, basis%n_coordinates)

      associate (m => basis%n_coordinates)
         coupling = cmplx(k*basis%blocks(m + 1:, :, 1) - theta*basis%blocks(m + 1:, :, 2), kind=wp)
         if (basis%n_blocks == 3) then
            coupling = coupling + cmplx(0.0_wp, s, wp)*basis%blocks(m + 1:, :, 3)
         end if
         if (basis%loss_at(s) > 0.0_wp) then
            coupling = coupling + cmplx(0.0_wp, k*basis%loss, wp)*basis%blocks(m + 1:, :, 1)
         end if
      end associate
   end function coupling

   !> F^H u, its derivative by the frequency at held coordinates, and its row by them.
   subroutine work_of_load(basis, harmonic, omega, load_factor, q, work, slope, row)
      type(reduction_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      real(wp), intent(in) :: omega, load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: work
      complex(wp), intent(out), optional :: slope
      !> (n_coordinates)
      complex(wp), intent(out), optional :: row(:)
      type(internal_block) :: internal
      complex(wp) :: x(basis%n_internal), x_slope(basis%n_internal)
      complex(wp) :: f_i(basis%n_internal, 1), f_q(basis%n_coordinates)
      real(wp) :: n, s
      logical :: unused

      n = real(harmonic, wp)
      s = n*omega
      f_q = load_factor*conjg(harmonic_load(basis%load_q, basis%waves, harmonic, s))
      work = sum(f_q*q)
      if (present(slope)) slope = load_factor* &
         sum(conjg(load_slope(basis%load_q, basis%waves, harmonic, s, n))*q)
      if (present(row)) row = f_q
      if (basis%n_internal == 0) return
      call follow_frequency(basis, harmonic, omega, load_factor, q, x, x_slope)
      f_i(:, 1) = load_factor*conjg(harmonic_load(basis%load_i, basis%waves, harmonic, s))
      work = work + sum(f_i(:, 1)*x)
      if (present(slope)) slope = slope + sum(f_i(:, 1)*x_slope) + load_factor* &
         sum(conjg(load_slope(basis%load_i, basis%waves, harmonic, s, n))*x)
      if (.not. present(row)) return
      ! D is symmetric.
      call internal%factor(basis, cmplx(s**2, kind=wp), s, unused)
      call internal%solve(1, f_i)
      row = row - matmul(f_i(:, 1), coupling(basis, 1.0_wp, s**2, s))
   end subroutine work_of_load

end module fw_field_slopes
