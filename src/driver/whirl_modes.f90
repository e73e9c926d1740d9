!> Modes of a tied sector whose blocks are not Hermitian: Coriolis forces and forces of the air.
!>
!>   (lambda**2 M + lambda (C + G) + K + A) x = 0,   lambda = -width/2 + i omega,
!>
!> of which those with omega > 0 are waves the way of the nodal diameter. As a linear problem of
!> twice the order by QZ, so that a mass may be singular.
module fw_whirl_modes
   use fw_cyclic_data, only: nodal_matrices
   use fw_kinds, only: wp
   use fw_lapack, only: zggev
   implicit none (type, external)
   private

   public :: wave_matrices, wave_of, find_whirl

   !> Orders up to which peaks of sweeps are looked for by modes: QZ takes 60 n**3 operations, n
   !> being twice the order.
   integer, parameter, public :: most_whirling = 400
   !> Roots beyond this many of the largest stiffness over mass, or without direction, are those of
   !> massless motions.
   real(wp), parameter :: infinite = 1.0e-12_wp
   !> Below this part of itself the frequency of a root is round-off: what is overdamped, or has no
   !> mass, creeps.
   real(wp), parameter :: least_turn = 1.0e-6_wp

   !> Of a signed nodal diameter.
   type :: wave_matrices
      complex(wp), allocatable :: mass(:, :), damping(:, :), stiffness(:, :)
   end type wave_matrices

contains

   !> The matrices of a wave from those of 0 to N/2; `stiffness` as contact and springs hold it.
   pure subroutine wave_of(nodal, stiffness, conjugated, wave)
      type(nodal_matrices), intent(in) :: nodal
      complex(wp), intent(in) :: stiffness(:, :)
      !> Whether it runs the other way.
      logical, intent(in) :: conjugated
      type(wave_matrices), intent(out) :: wave

      wave%mass = nodal%mass
      wave%stiffness = stiffness
      allocate (wave%damping(size(stiffness, 1), size(stiffness, 2)), source=(0.0_wp, 0.0_wp))
      if (allocated(nodal%damping)) wave%damping = nodal%damping
      if (allocated(nodal%coriolis)) wave%damping = wave%damping + nodal%coriolis
      if (conjugated) then
         wave%mass = conjg(wave%mass)
         wave%damping = conjg(wave%damping)
         wave%stiffness = conjg(wave%stiffness)
      end if
      ! In the coordinates of its own way already.
      if (allocated(nodal%aero)) wave%stiffness = wave%stiffness + &
         nodal%aero(:, :, merge(2, 1, conjugated))
   end subroutine wave_of

   !> Roots with omega > 0 in ascending order of omega; none where QZ fails. Vectors on request:
   !> right ones, and left ones y with y^H (..) = 0.
   subroutine find_whirl(wave, root, right, left)
      type(wave_matrices), intent(in) :: wave
      complex(wp), allocatable, intent(out) :: root(:)
      !> (n, n_roots).
      complex(wp), allocatable, intent(out), optional :: right(:, :), left(:, :)
      complex(wp), allocatable :: a(:, :), b(:, :), alpha(:), beta(:), vl(:, :), vr(:, :), work(:)
      complex(wp) :: room(1)
      real(wp), allocatable :: rwork(:)
      integer, allocatable :: chosen(:)
      real(wp) :: scale
      integer :: i, info, n
      character :: wants

      n = size(wave%mass, 1)
      ! Velocities in units of the frequency sqrt(K/M), so that both halves are of one size.
      scale = sqrt(norm2(abs(wave%stiffness))/max(norm2(abs(wave%mass)), tiny(1.0_wp)))
      allocate (a(2*n, 2*n), b(2*n, 2*n), source=(0.0_wp, 0.0_wp))
      do i = 1, n
         a(i, n + i) = (1.0_wp, 0.0_wp)
         b(i, i) = (1.0_wp, 0.0_wp)
      end do
      a(n + 1:, :n) = -wave%stiffness/scale**2
      a(n + 1:, n + 1:) = -wave%damping/scale
      b(n + 1:, n + 1:) = wave%mass
      allocate (alpha(2*n), beta(2*n), rwork(16*n), vl(2*n, 2*n), vr(2*n, 2*n))
      wants = merge('V', 'N', present(right))
      call zggev(wants, wants, 2*n, a, 2*n, b, 2*n, alpha, beta, vl, 2*n, vr, 2*n, room, -1, &
                 rwork, info)
      allocate (work(max(1, int(real(room(1), wp)))))
      call zggev(wants, wants, 2*n, a, 2*n, b, 2*n, alpha, beta, vl, 2*n, vr, 2*n, work, &
                 size(work), rwork, info)
      allocate (chosen(0))
      if (info == 0) then
         do i = 1, 2*n
            if (abs(beta(i)) <= infinite*abs(alpha(i))) cycle
            if (aimag(alpha(i)/beta(i)) > least_turn*abs(alpha(i)/beta(i))) chosen = [chosen, i]
         end do
      end if
      root = scale*alpha(chosen)/beta(chosen)
      call sort(root, chosen)
      if (.not. present(right)) return
      right = vr(:n, chosen)
      if (present(left)) left = vl(n + 1:, chosen)
   end subroutine find_whirl

   !> By frequency.
   pure subroutine sort(root, place)
      complex(wp), intent(inout) :: root(:)
      integer, intent(inout) :: place(:)
      integer :: i, j

      do i = 2, size(root)
         do j = i, 2, -1
            if (aimag(root(j)) >= aimag(root(j - 1))) exit
            root([j - 1, j]) = root([j, j - 1])
            place([j - 1, j]) = place([j, j - 1])
         end do
      end do
   end subroutine sort

end module fw_whirl_modes
