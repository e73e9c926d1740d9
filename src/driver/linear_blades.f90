!> Disks without joints that differ in their blades: one solution of the tuned disk serves them all.
!>
!> With W the rows of a sector in which blades differ, A_j what sector j has on them, Z the tuned
!> disk, all of the first harmonic:
!>
!>   x = W u,   (I + Gamma A) x = W Z^-1 F,   Gamma = W Z^-1 W^T,   observed = O Z^-1 (F - W^T A x).
!>
!> Gamma and O Z^-1 W^T are block circulant and of no pattern. A pattern costs a system of the order
!> of the rows of all sectors. Where nothing but K, M and C acts, W is a part of what is observed of
!> the modes of the nodal diameters; else its rows are coordinates.
module fw_linear_blades
   use fw_all_sectors, only: all_sectors
   use fw_balance_problem, only: balance_problem
   use fw_balance_state, only: balance_state
   use fw_blade_patterns, only: blade_patterns
   use fw_blade_peaks, only: blade_response
   use fw_deviation, only: damping_part, deviation_type, mass_part, stiffness_part
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_lapack, only: zgetrf, zgetrs
   implicit none (type, external)
   private

   public :: linear_response

   !> The tuned disk at a frequency.
   type :: tuned_type
      !> [rad/s]; below 0 before the first.
      real(wp) :: omega = -1.0_wp
      logical :: is_solved = .false.
      !> By a force on a row of sector 0: rows of sector j (n_rows, n_rows, n_sectors), and what is
      !> observed there (n_observed, n_rows, n_sectors).
      complex(wp), allocatable :: gamma(:, :, :), shown(:, :, :)
      !> By the load: rows, and what is observed (n_rows, n_sectors), (n_observed, n_sectors).
      complex(wp), allocatable :: rows(:, :), observed(:, :)
   end type tuned_type

   !> Disks without joints: all share the solution of the tuned one.
   type, extends(blade_response) :: linear_response
      !> The tuned disk by its modes, the rows the last of what is observed of it.
      type(all_sectors), allocatable :: modal
      !> In place of it the tuned disk, its rows among its coordinates.
      type(balance_problem) :: problem
      type(balance_state) :: system
      !> What sectors have beside each other without a pattern, and the patterns.
      type(deviation_type) :: base
      type(blade_patterns) :: patterns
      !> With the pattern.
      type(deviation_type), private :: deviation
      logical, private :: is_tuned = .true.
      !> Frequencies that disks share are kept; the last place is for others.
      type(tuned_type), allocatable, private :: known(:)
      integer, private :: n_known = 0
      !> Scratch: I + Gamma A, and its solution.
      complex(wp), allocatable, private :: matrix(:, :), block(:, :, :), x(:)
      integer, allocatable, private :: pivot(:)
   contains
      procedure :: reserve
      procedure :: begin
      procedure :: at
   end type linear_response

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

contains

   !> Room for so many frequencies that are asked for again and again.
   subroutine reserve(self, n_shared)
      class(linear_response), intent(inout) :: self
      integer, intent(in) :: n_shared
      integer :: n, r

      r = size(self%base%rows, 1)
      n = self%n_sectors
      allocate (self%known(n_shared + 1))
      allocate (self%matrix(n*r, n*r), self%block(r, r, n), self%x(n*r), self%pivot(n*r))
   end subroutine reserve

   !> Take the deviations of the next disk.
   subroutine begin(self, pattern, error)
      class(linear_response), intent(inout), target :: self
      integer, intent(in) :: pattern
      type(error_type), allocatable, intent(out) :: error

      self%is_tuned = pattern == 0
      self%deviation = self%base
      if (pattern > 0) call self%patterns%add_pattern(pattern, self%deviation)
   end subroutine begin

   !> The tuned disk first, then what the blades make of it.
   subroutine at(self, omega, amplitude, converged, error)
      class(linear_response), intent(inout), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(out) :: amplitude(:, :)
      logical, intent(out) :: converged
      type(error_type), allocatable, intent(out) :: error
      complex(wp) :: force(size(self%block, 1), self%n_sectors)
      complex(wp) :: observed(self%n_observed, self%n_sectors)
      integer :: a, b, i, j, place

      amplitude = 0.0_wp
      converged = .false.
      call find_tuned(self, omega, place, error)
      if (allocated(error)) return
      associate (tuned => self%known(place), n => self%n_sectors)
         if (.not. tuned%is_solved) return
         observed = tuned%observed
         if (.not. self%is_tuned) then
            call solve_rows(self, tuned, converged)
            if (.not. converged) return
            do j = 1, n
               force(:, j) = matmul(self%block(:, :, j), &
                                    self%x((j - 1)*size(force, 1) + 1:j*size(force, 1)))
            end do
            do i = 1, n
               do j = 1, n
                  associate (shown => tuned%shown(:, :, modulo(i - j, n) + 1))
                     do a = 1, size(shown, 2)
                        do b = 1, size(shown, 1)
                           observed(b, i) = observed(b, i) - shown(b, a)*force(a, j)
                        end do
                     end do
                  end associate
               end do
            end do
         end if
         amplitude = abs(observed)
         converged = .true.
      end associate
   end subroutine at

   !> Rows of all sectors, in x, with A_j in `block`.
   subroutine solve_rows(self, tuned, solved)
      class(linear_response), intent(inout) :: self
      !> At the frequency.
      type(tuned_type), intent(in) :: tuned
      logical, intent(out) :: solved
      integer :: a, b, c, i, info, j, m, n, r

      n = self%n_sectors
      r = size(self%block, 1)
      m = n*r
      self%block = self%deviation%part(:, :, :, stiffness_part) - &
                   tuned%omega**2*self%deviation%part(:, :, :, mass_part) + &
                   cmplx(0.0_wp, tuned%omega, wp)*self%deviation%part(:, :, :, damping_part)
      ! Rows of all sectors by a force on those of one, a few at a time: too small for BLAS.
      self%matrix = zero
      do j = 0, n - 1
         do b = 1, r
            do i = 0, n - 1
               associate (gamma => tuned%gamma(:, :, modulo(i - j, n) + 1))
                  do c = 1, r
                     do a = 1, r
                        self%matrix(i*r + a, j*r + b) = self%matrix(i*r + a, j*r + b) + &
                                                        gamma(a, c)*self%block(c, b, j + 1)
                     end do
                  end do
               end associate
            end do
         end do
      end do
      do i = 1, m
         self%matrix(i, i) = self%matrix(i, i) + one
      end do
      self%x = reshape(tuned%rows, [m])
      call zgetrf(m, m, self%matrix, m, self%pivot, info)
      solved = info == 0
      if (solved) call zgetrs('N', m, 1, self%matrix, m, self%pivot, self%x, m, info)
   end subroutine solve_rows

   !> Where the tuned disk at a frequency stands among those that are known; it is solved for where
   !> it is not.
   subroutine find_tuned(self, omega, place, error)
      class(linear_response), intent(inout) :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      integer, intent(out) :: place
      type(error_type), allocatable, intent(out) :: error

      associate (n => self%n_known)
         place = findloc(abs(self%known(:n)%omega - omega) <= 0.0_wp, .true., dim=1)
         if (place > 0) return
         place = n + 1
         if (self%is_shared .and. n < size(self%known) - 1) then
            self%n_known = n + 1
         else
            place = size(self%known)
            if (abs(self%known(place)%omega - omega) <= 0.0_wp) return
         end if
      end associate
      if (allocated(self%modal)) then
         call solve_modal(self, omega, self%known(place))
      else
         call solve_tuned(self, omega, self%known(place), error)
      end if
   end subroutine find_tuned

   !> The same by the modes of the tuned disk.
   subroutine solve_modal(self, omega, tuned)
      class(linear_response), intent(in) :: self
      real(wp), intent(in) :: omega
      type(tuned_type), intent(inout) :: tuned
      complex(wp), allocatable :: by_load(:, :), by_force(:, :, :)
      integer :: n, r
      logical :: failed

      r = size(self%base%rows, 1)
      n = self%n_observed
      allocate (by_force(n + r, r, self%n_sectors), by_load(n + r, self%n_sectors))
      call self%modal%answer_by_modes(omega, by_force, by_load, failed)
      tuned%omega = omega
      tuned%is_solved = .not. failed
      if (failed) return
      tuned%gamma = by_force(n + 1:, :, :)
      tuned%shown = by_force(:n, :, :)
      tuned%rows = by_load(n + 1:, :)
      tuned%observed = by_load(:n, :)
   end subroutine solve_modal

   !> Answers of the tuned disk to its load, and to a force on each row of sector 0.
   subroutine solve_tuned(self, omega, tuned, error)
      class(linear_response), intent(inout) :: self
      real(wp), intent(in) :: omega
      type(tuned_type), intent(inout) :: tuned
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: answer(:, :, :), factors(:, :), load(:, :), rows(:, :), &
         sectors(:, :), waves(:, :)
      complex(wp), allocatable :: direct(:, :), found(:, :), shown(:, :)
      integer, allocatable :: pivot(:)
      integer :: a, h, info, j, k, m, n, r
      real(wp) :: scale

      tuned%omega = omega
      tuned%is_solved = .false.
      call self%system%set_frequency(omega, error)
      if (allocated(error)) return
      associate (structure => self%problem%structure, state => self%system%structure_state)
         h = findloc(structure%harmonic, 1, dim=1)
         m = structure%n_slots
         n = self%n_sectors
         r = structure%n_own()
         allocate (factors(m, m), pivot(m), rows(r, m), answer(m, n, r + 1), load(m, n))
         allocate (sectors(m, n), waves(m, n))
         if (.not. allocated(tuned%gamma)) allocate ( &
            tuned%gamma(r, r, n), tuned%shown(self%n_observed, r, n), tuned%rows(r, n), &
            tuned%observed(self%n_observed, n))
         do j = 1, n
            sectors(:, j) = state%load(structure%coordinate(:, j), h)
         end do
         call structure%find_waves(sectors, load)
         do k = 0, n - 1
            call structure%wave_block(state, h, k, factors)
            call structure%own_rows(k, rows)
            do a = 1, r
               ! A force on one sector is all waves in equal shares.
               answer(:, k + 1, a) = conjg(rows(a, :))/n
            end do
            answer(:, k + 1, r + 1) = load(:, k + 1)
            call zgetrf(m, m, factors, m, pivot, info)
            if (info /= 0) return
            do a = 1, r + 1
               call zgetrs('N', m, 1, factors, m, pivot, answer(1, k + 1, a), m, info)
            end do
         end do
         allocate (direct(n*self%n_observed, size(structure%harmonic)), source=zero)
         allocate (shown, found, mold=direct)
         call show(reshape([zero], [m, n], [zero]), 1.0_wp, direct)
         do a = 1, r + 1
            waves = answer(:, :, a)
            call structure%add_waves(waves, sectors)
            if (a > r) then
               call structure%read_own(sectors, tuned%rows)
               call show(sectors, 1.0_wp, found)
               tuned%observed = reshape(found(:, h), [self%n_observed, n])
               cycle
            end if
            call structure%read_own(sectors, tuned%gamma(:, a, :))
            ! Of the size of the answer to the load, which stands beside it.
            scale = maxval(abs(answer(:, :, r + 1)))/max(maxval(abs(sectors)), tiny(1.0_wp))
            if (.not. scale > 0.0_wp) scale = 1.0_wp
            call show(sectors, scale, shown)
            tuned%shown(:, a, :) = reshape((shown(:, h) - direct(:, h))/scale, &
                                           [self%n_observed, n])
         end do
      end associate
      tuned%is_solved = .true.

   contains

      !> What is observed of coordinates of all sectors, the load beside them.
      subroutine show(sectors, factor, observed)
         complex(wp), intent(in) :: sectors(:, :)
         real(wp), intent(in) :: factor
         complex(wp), intent(out), contiguous :: observed(:, :)
         complex(wp), allocatable :: q(:, :)
         integer :: j

         associate (structure => self%problem%structure)
            allocate (q(structure%n_coordinates, size(structure%harmonic)), source=zero)
            do j = 1, self%n_sectors
               q(structure%coordinate(:, j), h) = factor*sectors(:, j)
            end do
            call structure%recover(self%system%structure_state, q, observed)
         end associate
      end subroutine show

   end subroutine solve_tuned

end module fw_linear_blades
