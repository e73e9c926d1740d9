!> One harmonic of a sector with what is condensed of it, from and to its coordinates, as
!> fw_whole_field has it for symmetric matrices. Rarely asked for: the factors of the internal block
!> are made anew each time.
module fw_sector_field
   use fw_internal_block, only: internal_block
   use fw_kinds, only: wp
   use fw_sector_reduction, only: sector_reduction
   use fw_sector_stiffness, only: add_whirl, combine_rows, factor_internal, harmonic_point, &
      load_of, turned
   implicit none (type, external)
   private

   public :: change_sector, complete_sector, condense_sector, observe_sector, work_on_sector

contains

   !> load = F_q - Z_qi D^-1 F_i.
   subroutine condense_sector(basis, point, field, load)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> Loads of the coordinates, of the internal modes, and what other nodal diameters have more
      !> of these.
      complex(wp), intent(in) :: field(:)
      complex(wp), intent(out) :: load(:)
      type(internal_block) :: internal
      complex(wp) :: x(basis%n_internal, 1), z_qi(basis%n_internal, basis%n_coordinates)
      logical :: unused

      associate (m => basis%n_coordinates, n => basis%n_internal)
         load = field(:m)
         if (n == 0) return
         x(:, 1) = field(m + 1:m + n)
         ! The same factors were made when the structure went to its frequency: they do not fail.
         call factor_internal(basis, point, internal, unused)
         call internal%solve(1, x)
         ! The transpose of Z_qi.
         call combine_rows(basis, point, m + 1, m + n, .true., z_qi)
         call add_whirl(basis, point, m, 0, z_qi, adjoint=.true.)
         load = load - matmul(x(:, 1), z_qi)
      end associate
   end subroutine condense_sector

   !> Behind the coordinates x = D^-1 (F_i - Z_iq q).
   subroutine complete_sector(basis, point, load_factor, q, field, load)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> Of the loads of the basis.
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: q(:)
      complex(wp), intent(out) :: field(:)
      !> In place of these, as `field` of condense_sector.
      complex(wp), intent(in), optional :: load(:)
      type(internal_block) :: internal
      complex(wp) :: x(basis%n_internal, 1), z_iq(basis%n_internal, basis%n_coordinates)
      logical :: unused

      field = (0.0_wp, 0.0_wp)
      associate (m => basis%n_coordinates, n => basis%n_internal)
         field(:m) = q
         if (n == 0) return
         if (present(load)) then
            x(:, 1) = load(m + 1:m + n)
         else
            x(:, 1) = load_factor*load_of(basis, basis%load_i, point)
         end if
         call combine_rows(basis, point, m + 1, m + n, .false., z_iq)
         call add_whirl(basis, point, m, 0, z_iq)
         x(:, 1) = x(:, 1) - matmul(z_iq, q)
         call factor_internal(basis, point, internal, unused)
         call internal%solve(1, x)
         field(m + 1:m + n) = x(:, 1)
      end associate
   end subroutine complete_sector

   !> Observed quantities of a motion.
   pure subroutine observe_sector(basis, point, field, observed)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      complex(wp), intent(in) :: field(:)
      complex(wp), intent(out) :: observed(:)

      associate (m => basis%n_coordinates, n => basis%n_internal)
         observed = matmul(turned(basis%observe_q, point), field(:m)) + &
                    matmul(turned(basis%observe_i, point), field(m + 1:m + n))
      end associate
   end subroutine observe_sector

   !> Forces on all degrees of freedom when a parameter changes: (i s dC - theta dM) u - df.
   pure subroutine change_sector(basis, point, load_factor, number, field, slope)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      real(wp), intent(in) :: load_factor
      !> Which of the changes.
      integer, intent(in) :: number
      complex(wp), intent(in) :: field(:)
      complex(wp), intent(out) :: slope(:)

      slope = (0.0_wp, 0.0_wp)
      associate (n => basis%n_coordinates + basis%n_internal)
         if (point%harmonic == 0) then
            slope(:n) = cmplx(-load_factor*real(basis%change_load(:, number), wp), kind=wp)
         else
            slope(:n) = matmul(cmplx(0.0_wp, point%s, wp)* &
                               turned(basis%change_c(:, :, number), point) - &
                               point%theta*turned(basis%change_m(:, :, number), point), field(:n))
         end if
      end associate
   end subroutine change_sector

   !> Work of the loads of the basis on a motion.
   pure complex(wp) function work_on_sector(basis, point, load_factor, field) result(work)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      real(wp), intent(in) :: load_factor
      complex(wp), intent(in) :: field(:)

      associate (m => basis%n_coordinates, n => basis%n_internal)
         work = load_factor*(dot_product(load_of(basis, basis%load_q, point), field(:m)) + &
                             dot_product(load_of(basis, basis%load_i, point), field(m + 1:m + n)))
      end associate
   end function work_on_sector

end module fw_sector_field
