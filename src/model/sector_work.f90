!> Work of the hysteretic damping of a sector.
module fw_sector_work
   use fw_kinds, only: pi, wp
   use fw_sector_reduction, only: sector_reduction
   use fw_sector_stiffness, only: harmonic_point, recover_sector
   use fw_sector_uncondensed, only: add_speed_loss
   implicit none (type, external)
   private

   public :: structural_work_of

contains

   !> In one cycle, n pi U^H D U.
   real(wp) function structural_work_of(basis, point, omega, load_factor, q) result(work)
      type(sector_reduction), intent(in) :: basis
      type(harmonic_point), intent(in) :: point
      !> [rad/s], and the factor of the loads of the basis.
      real(wp), intent(in) :: omega, load_factor
      complex(wp), intent(in) :: q(:)
      type(sector_reduction) :: whole
      complex(wp) :: u(basis%n_coordinates + basis%n_internal)
      complex(wp), allocatable :: d(:, :)
      integer :: j

      work = 0.0_wp
      if (point%harmonic == 0) return
      if (.not. (allocated(basis%structural) .or. allocated(basis%speed))) return
      u(:size(q)) = q
      if (basis%n_internal > 0) then
         ! Every coordinate and internal mode is observed.
         whole = basis
         if (allocated(whole%observe_q)) deallocate (whole%observe_q, whole%observe_i)
         allocate (whole%observe_q(size(u), size(q)), whole%observe_i(size(u), basis%n_internal), &
                   source=(0.0_wp, 0.0_wp))
         do j = 1, size(u)
            if (j <= size(q)) then
               whole%observe_q(j, j) = (1.0_wp, 0.0_wp)
            else
               whole%observe_i(j, j - size(q)) = (1.0_wp, 0.0_wp)
            end if
         end do
         call recover_sector(whole, point, load_factor, q, u)
      end if
      allocate (d(size(u), size(u)), source=(0.0_wp, 0.0_wp))
      if (allocated(basis%structural)) d = basis%structural
      if (point%conjugated) d = conjg(d)
      if (allocated(basis%speed)) call add_speed_loss(basis%speed, point%conjugated, omega, d)
      work = point%harmonic*pi*real(dot_product(u, matmul(d, u)), wp)
   end function structural_work_of

end module fw_sector_work
