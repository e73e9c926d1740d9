!> Hill's method: Floquet exponents from the harmonic balance of the perturbation
!> u(t) = p(t) exp(lambda t), p periodic (Von Groll and Ewins 2001, J. Sound Vib. 241(2); Detroux et
!> al. 2015, Comput. Methods Appl. Mech. Eng. 296). With D = d/dt on the coefficients of p,
!>
!>   [ K + S + C D + M D^2 + lambda (C + 2 M D) + lambda^2 M ] p = 0,
!>
!> linear in (p, lambda p). Each exponent comes with its copies lambda + i k omega, whose p is the
!> same shifted by k harmonics (Moore 2005, SIAM J. Numer. Anal. 42). Truncation spoils those far
!> from the centre: of each family the one is taken whose p has its mean harmonic next to zero
!> (in the spirit of Guillot et al. 2020, J. Comput. Phys. 416, who take the most symmetric p).
module fw_hill
   use fw_error, only: error_type, fatal_error, status_failure, status_input
   use fw_kinds, only: wp
   use fw_lapack, only: dgeev, dgetrs
   use fw_linalg, only: lu_type
   use fw_stability_basis, only: perturbation_basis
   use fw_stability_tangent, only: tangent_type
   implicit none (type, external)
   private

   public :: hill_exponents

   !> Mean harmonics are compared to this one instead of zero. A negative multiplier has two copies
   !> with means of exactly +-1/2; off centre, one of them is nearer. No symmetry makes another
   !> value a tie.
   real(wp), parameter :: centre = 0.05_wp

contains

   !> The Floquet exponents of a periodic solution, one copy each, in no order.
   subroutine hill_exponents(basis, tangent, omega, exponents, error)
      type(perturbation_basis), intent(in) :: basis
      type(tangent_type), intent(in) :: tangent
      !> Frequency of the solution [rad/s].
      real(wp), intent(in) :: omega
      !> (2 n_massive + n_damped) [1/s].
      complex(wp), allocatable, intent(out) :: exponents(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), state(:, :), mean(:)
      complex(wp), allocatable :: values(:)
      integer :: n_dynamic

      n_dynamic = basis%n_massive + basis%n_damped
      ! Static directions go first: the linear pencil in lambda needs a regular leading matrix.
      call assemble_stiffness(basis, tangent, omega, stiffness)
      call eliminate_static(tangent%n_coefficients*n_dynamic, stiffness, error)
      if (allocated(error)) return
      call assemble_state(basis, tangent%n_harmonics, omega, stiffness, state)
      call solve_eigen(tangent%n_coefficients, n_dynamic, state, values, mean, error)
      if (allocated(error)) return
      allocate (exponents(2*basis%n_massive + basis%n_damped))
      call choose_copies(values, mean, exponents)
   end subroutine hill_exponents

   !> One copy of each family: its mean harmonic lies within 1/2 of the centre. Families too damped
   !> for these harmonics (a relaxation much faster than they are) may appear there several times:
   !> the least damped ones count. Should some be missing, the next to the centre serve.
   pure subroutine choose_copies(values, mean, exponents)
      complex(wp), intent(in) :: values(:)
      real(wp), intent(in) :: mean(:)
      complex(wp), intent(out) :: exponents(:)
      logical :: left(size(values)), central(size(values))
      integer :: j, best

      left = .true.
      ! Copies of a family are one harmonic apart: of one that the harmonics resolve, exactly one
      ! lies within this band.
      central = abs(mean - centre) < 0.5_wp
      do j = 1, size(exponents)
         if (any(left .and. central)) then
            best = maxloc(real(values, wp), dim=1, mask=left .and. central)
         else
            best = minloc(abs(mean - centre), dim=1, mask=left)
         end if
         exponents(j) = values(best)
         left(best) = .false.
      end do
   end subroutine choose_copies

   !> K + S + C D + M D^2, coefficients innermost (n_coefficients*n, n_coefficients*n).
   pure subroutine assemble_stiffness(basis, tangent, omega, matrix)
      type(perturbation_basis), intent(in) :: basis
      type(tangent_type), intent(in) :: tangent
      real(wp), intent(in) :: omega
      real(wp), allocatable, intent(out) :: matrix(:, :)
      real(wp) :: weight
      integer :: i, j, k, nc, row, column, term

      nc = tangent%n_coefficients
      allocate (matrix(nc*basis%n, nc*basis%n), source=0.0_wp)
      do j = 1, basis%n
         column = (j - 1)*nc
         do i = 1, basis%n
            row = (i - 1)*nc
            do k = 1, nc
               ! Constant coefficients couple each coefficient with itself only.
               matrix(row + k, column + k) = basis%stiffness(i, j)
            end do
            call add_derivative(basis%damping(i, j)*omega, row, column, tangent%n_harmonics, matrix)
            ! S = sum over the terms of direction block direction^T.
            do term = 1, tangent%n_terms
               weight = basis%direction(i, tangent%row(term))* &
                        basis%direction(j, tangent%row(term))
               if (abs(weight) <= 0.0_wp) cycle
               do k = 1, nc
                  matrix(row + 1:row + nc, column + k) = matrix(row + 1:row + nc, column + k) + &
                                                         weight*tangent%block(:, k, term)
               end do
            end do
         end do
         if (j > basis%n_massive) cycle
         do k = 2, nc
            ! Columns 2n and 2n+1 belong to harmonic n.
            matrix(column + k, column + k) = matrix(column + k, column + k) - (k/2*omega)**2
         end do
      end do
   end subroutine assemble_stiffness

   !> Add factor * d/dtau to the block behind (row, column).
   !> (a, b) of a cos n tau + b sin n tau becomes (n b, -n a).
   pure subroutine add_derivative(factor, row, column, n_harmonics, matrix)
      real(wp), intent(in) :: factor
      integer, intent(in) :: row, column, n_harmonics
      real(wp), intent(inout) :: matrix(:, :)
      integer :: n

      do n = 1, n_harmonics
         matrix(row + 2*n, column + 2*n + 1) = matrix(row + 2*n, column + 2*n + 1) + n*factor
         matrix(row + 2*n + 1, column + 2*n) = matrix(row + 2*n + 1, column + 2*n) - n*factor
      end do
   end subroutine add_derivative

   !> Let the static directions, behind the first n_kept unknowns, follow the others.
   subroutine eliminate_static(n_kept, matrix, error)
      integer, intent(in) :: n_kept
      real(wp), allocatable, intent(inout) :: matrix(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(lu_type) :: lu
      real(wp), allocatable :: followed(:, :)
      logical :: singular
      integer :: n_static, info

      ! The equations of the static part, A_sk p_k + A_ss p_s = 0, give p_s = -A_ss^-1 A_sk p_k,
      ! and the rest becomes A_kk - A_ks A_ss^-1 A_sk. Exact, since these directions bring no
      ! lambda.
      n_static = size(matrix, 1) - n_kept
      if (n_static == 0) return
      call lu%reserve(n_static)
      lu%matrix = matrix(n_kept + 1:, n_kept + 1:)
      call lu%factor(singular)
      if (singular) then
         call fatal_error(error, '&sweep stability: a dof without mass and damping is held by '// &
                          'neither stiffness nor contact; hold it or give it mass', status_input)
         return
      end if
      followed = matrix(n_kept + 1:, :n_kept)
      call dgetrs('N', n_static, n_kept, lu%matrix, n_static, lu%pivot, followed, n_static, info)
      matrix = matrix(:n_kept, :n_kept) - matmul(matrix(:n_kept, n_kept + 1:), followed)
   end subroutine eliminate_static

   !> The matrix of (p massive, p damped, lambda p massive).
   !> With masses and damped dampings of 1 (fw_stability_basis), A the matrix of assemble_stiffness,
   !> and v = lambda p of the massive ones:
   !>
   !>   lambda p_m = v,   lambda p_d = -A_d p,   lambda v = -A_m p - (C + 2 D) v.
   pure subroutine assemble_state(basis, n_harmonics, omega, stiffness, state)
      type(perturbation_basis), intent(in) :: basis
      integer, intent(in) :: n_harmonics
      real(wp), intent(in) :: omega, stiffness(:, :)
      real(wp), allocatable, intent(out) :: state(:, :)
      integer :: i, j, k, nc, n_kept, massive, offset

      nc = 2*n_harmonics + 1
      n_kept = size(stiffness, 1)
      massive = nc*basis%n_massive
      allocate (state(n_kept + massive, n_kept + massive), source=0.0_wp)
      ! lambda p_m = v.
      do k = 1, massive
         state(k, n_kept + k) = 1.0_wp
      end do
      state(massive + 1:n_kept, :n_kept) = -stiffness(massive + 1:, :)
      state(n_kept + 1:, :n_kept) = -stiffness(:massive, :)
      do j = 1, basis%n_massive
         offset = n_kept + (j - 1)*nc
         do i = 1, basis%n_massive
            do k = 1, nc
               state(n_kept + (i - 1)*nc + k, offset + k) = -basis%damping(i, j)
            end do
         end do
         call add_derivative(-2.0_wp*omega, offset, offset, n_harmonics, state)
      end do
   end subroutine assemble_state

   !> All eigenvalues, and the mean harmonic of the first n_rows rows of their vectors.
   subroutine solve_eigen(nc, n_rows, state, values, mean, error)
      integer, intent(in) :: nc, n_rows
      real(wp), contiguous, intent(inout) :: state(:, :)
      complex(wp), allocatable, intent(out) :: values(:)
      real(wp), allocatable, intent(out) :: mean(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: re(:), im(:), vectors(:, :), work(:)
      real(wp) :: room(1), unused(1, 1)
      integer :: n, info, j

      n = size(state, 1)
      allocate (re(n), im(n), vectors(n, n), mean(n))
      ! The first call only asks for the size of the workspace.
      call dgeev('N', 'V', n, state, n, re, im, unused, 1, vectors, n, room, -1, info)
      allocate (work(int(room(1))))
      call dgeev('N', 'V', n, state, n, re, im, unused, 1, vectors, n, work, size(work), info)
      if (info /= 0) then
         call fatal_error(error, '&sweep stability: the eigenvalues of Hill''s matrix did not '// &
                          'converge', status_failure)
         return
      end if
      values = cmplx(re, im, wp)
      do j = 1, n
         ! A complex pair has real parts of its vector in one column and imaginary parts in the
         ! next.
         if (im(j) > 0.0_wp) then
            mean(j) = mean_harmonic(nc, n_rows, vectors(:, j), vectors(:, j + 1))
            ! The conjugate vector is the mirror image.
            mean(j + 1) = -mean(j)
         else if (.not. im(j) < 0.0_wp) then
            mean(j) = 0.0_wp
         end if
      end do
   end subroutine solve_eigen

   !> sum n |p_n|^2 / sum |p_n|^2 over the complex harmonics n = -H'..H'.
   pure real(wp) function mean_harmonic(nc, n_rows, re, im) result(mean)
      integer, intent(in) :: nc, n_rows
      !> Real and imaginary parts of the coefficients.
      real(wp), intent(in) :: re(nc, *), im(nc, *)
      real(wp) :: total, forward, backward
      integer :: i, n

      mean = 0.0_wp
      total = 0.0_wp
      do i = 1, n_rows
         total = total + re(1, i)**2 + im(1, i)**2
         do n = 1, nc/2
            ! p_n = (cosine - i sine)/2, p_-n = (cosine + i sine)/2.
            forward = ((re(2*n, i) + im(2*n + 1, i))**2 + (im(2*n, i) - re(2*n + 1, i))**2)/4.0_wp
            backward = ((re(2*n, i) - im(2*n + 1, i))**2 + (im(2*n, i) + re(2*n + 1, i))**2)/4.0_wp
            total = total + forward + backward
            mean = mean + n*(forward - backward)
         end do
      end do
      mean = mean/total
   end function mean_harmonic

end module fw_hill
