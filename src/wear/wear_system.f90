!> Vibration and wear depth together, at the end of an implicit step over many cycles:
!>
!>   R(q, w) = 0,     w - base - cycles rate(q, w) = 0,     rate = (k_w / A) S / eps
!>
!> with S the sliding under pressure over a period (fw_slip). Unknowns are those of the balance,
!> then one depth per pair. Where a pair sticks or stays open, its depth leaves the linear problem:
!> it equals the base. The derivative dR/dw = B^T G eps e_0 and that of the rate are exact.
!>
!> The preconditioner keeps the coupling of both: with M the block diagonal preconditioner of the
!> balance, B = dR/dw and C = d(wear equations)/dq, it solves [M B; C D] through the Schur
!> complement D - C M^-1 B, whose order is the number of pairs that wear.
module fw_wear_system
   use fw_kinds, only: wp
   use fw_contact_data, only: contact_type
   use fw_force_law, only: pair_mixed
   use fw_force_law, only: pair_stuck
   use fw_balance_state, only: balance_state
   use fw_fourier, only: to_complex
   use fw_lapack, only: zgemm
   use fw_linalg, only: lu_type
   implicit none (type, external)
   private

   public :: wear_system, new_wear_system

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

   type, extends(balance_state) :: wear_system
      !> Cycles of the step, and the depth that it starts from (n_pairs) [length].
      real(wp) :: cycles = 0.0_wp
      real(wp), allocatable :: base(:)
      !> Depth per cycle [length] at the last point (n_pairs).
      real(wp), allocatable :: rate(:)
      !> From S to the rate: k_w/(A eps) (n_pairs).
      real(wp), allocatable, private :: factor(:)
      !> Prediction stiffness in the normal direction (n_pairs) [force/length].
      real(wp), allocatable, private :: normal(:)
      !> Makes a force of a depth: the same, or where there is none the tangential one (n_pairs).
      real(wp), allocatable, private :: weight(:)
      !> Pairs whose depth stays in the linear problem (first n_wearing entries).
      integer, private :: n_wearing = 0
      integer, allocatable, private :: wearing(:)
      !> Unknowns of the balance in the linear problem.
      integer, private :: n_balance = 0
      !> Preconditioner: M^-1 B and the rows of C M^-1 per harmonic, factors of the complement.
      complex(wp), allocatable, private :: columns(:, :, :), stiff(:, :)
      type(lu_type), private :: complement
      real(wp), allocatable, private :: adjusted(:), solved(:)
   contains
      procedure :: begin_step
      procedure :: n_vibration
      procedure :: hold_depths
      procedure :: free_depths
      procedure :: update_rate
      procedure :: force_of_depth
      procedure :: mean_pressure
      procedure :: compression
      procedure :: depth_scale
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: preconditioner_fits
      procedure :: precondition
   end type wear_system

contains

   !> Add wear to a balance.
   subroutine new_wear_system(balance, contact, coefficient, by_energy, self)
      type(balance_state), intent(in) :: balance
      type(contact_type), intent(in) :: contact
      !> Wear coefficient k_w [area/force].
      real(wp), intent(in) :: coefficient
      !> The coefficient multiplies friction energy (mu p ds) instead of p ds.
      logical, intent(in) :: by_energy
      type(wear_system), intent(out) :: self
      real(wp) :: tangential(contact%n_pairs)
      integer :: k

      self%balance_state = balance
      do k = 1, size(self%work)
         call self%work(k)%renew_fft()
      end do
      call self%free_depths()
      call self%work(self%problem%forces%pairs)%measure_slip()
      associate (p => self%problem%forces%entry(self%problem%forces%pairs)%law%prediction)
         tangential = maxval(p%stiffness(:, 1:2), dim=2)
         self%normal = p%stiffness(:, 3)
      end associate
      allocate (self%base(contact%n_pairs), self%rate(contact%n_pairs), source=0.0_wp)
      allocate (self%factor(contact%n_pairs), source=0.0_wp)
      where (tangential > 0.0_wp) self%factor = coefficient/(contact%area*tangential)
      if (by_energy) self%factor = contact%mu*self%factor
      self%weight = self%normal
      where (self%weight <= 0.0_wp) self%weight = tangential
      where (self%weight <= 0.0_wp) self%weight = 1.0_wp
      allocate (self%wearing(contact%n_pairs), source=0)
   end subroutine new_wear_system

   !> Unknowns of the vibration; the depths follow them.
   pure integer function n_vibration(self)
      class(wear_system), intent(in) :: self

      n_vibration = self%problem%structure%n_coordinates*self%problem%fourier%n_coefficients
   end function n_vibration

   !> Make the balance a system of its own, at given depths.
   subroutine hold_depths(self, depth)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: depth(:)

      self%n = self%n_vibration()
      self%pins_normals = .true.
      self%depth = depth
   end subroutine hold_depths

   !> Make the depths unknowns again.
   subroutine free_depths(self)
      class(wear_system), intent(inout) :: self

      self%n = self%n_vibration() + self%problem%n_pairs
      self%pins_normals = .false.
   end subroutine free_depths

   !> State the step: residuals are those of its end from now on.
   subroutine begin_step(self, base, cycles)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in) :: base(:), cycles

      self%base = base
      self%cycles = cycles
   end subroutine begin_step

   !> Rates at the last point of the balance.
   subroutine update_rate(self)
      class(wear_system), intent(inout) :: self

      self%rate = self%factor*self%work(self%problem%forces%pairs)%slip
   end subroutine update_rate

   !> Depths in the units in which residuals count them [force].
   pure function force_of_depth(self, depth) result(force)
      class(wear_system), intent(in) :: self
      real(wp), intent(in) :: depth(:)
      real(wp) :: force(size(depth))

      force = self%weight*depth
   end function force_of_depth

   !> Mean compressive force of every pair at the last point [force].
   pure function mean_pressure(self) result(pressure)
      class(wear_system), intent(in) :: self
      real(wp) :: pressure(self%problem%n_pairs)

      pressure = self%problem%forces%entry(self%problem%forces%pairs)%law%prediction%load
      if (any(self%problem%joint%row(3, :) > 0)) pressure = merge( &
         -self%work(self%problem%forces%pairs)%force(:, 3, 1), pressure, &
            self%problem%joint%row(3, :) > 0)
   end function mean_pressure

   !> Largest elastic compression of a pair at the last point: the depth that would unload it
   !> alone [length]. Pairs pressed by dead loads do not count; zero where all are.
   pure real(wp) function compression(self)
      class(wear_system), intent(in) :: self
      real(wp) :: pressure(self%problem%n_pairs), stiffness
      integer :: i

      compression = 0.0_wp
      pressure = self%mean_pressure()
      do i = 1, self%problem%n_pairs
         if (self%problem%joint%row(3, i) == 0) cycle
         stiffness = self%normal(i)
         if (self%problem%forces%entry(self%problem%forces%pairs)%law%prediction%takes_balance) then
            stiffness = self%problem%structure%static_stiffness(self%problem%coordinate_of(3, i))
         end if
         if (stiffness > 0.0_wp) compression = max(compression, pressure(i)/stiffness)
      end do
   end function compression

   !> Depth with which steps may start [length]: the compression, or the slide of a pair under a
   !> dead load.
   pure real(wp) function depth_scale(self)
      class(wear_system), intent(in) :: self

      depth_scale = self%compression()
      if (depth_scale <= 0.0_wp) depth_scale = maxval(self%mean_pressure()/self%weight)
   end function depth_scale

   subroutine residual(self, x, r)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      integer :: n

      n = self%n_vibration()
      self%depth = x(n + 1:)
      call self%balance_state%residual(x(:n), r(:n))
      call self%update_rate()
      r(n + 1:) = self%weight*(x(n + 1:) - self%base - self%cycles*self%rate)
   end subroutine residual

   subroutine linearize(self, n_linear)
      class(wear_system), intent(inout) :: self
      integer, intent(out) :: n_linear
      integer :: i

      call self%balance_state%linearize(self%n_balance)
      self%n_wearing = 0
      do i = 1, self%problem%n_pairs
         if (self%work(self%problem%forces%pairs)%linear_state(i) /= pair_mixed) cycle
         self%n_wearing = self%n_wearing + 1
         self%wearing(self%n_wearing) = i
      end do
      n_linear = self%n_balance + self%n_wearing
      self%active%n_linear = n_linear
   end subroutine linearize

   subroutine reduce(self, r, rhs)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)
      integer :: n, j, i

      n = self%n_vibration()
      self%work(self%problem%forces%pairs)%input = 0.0_wp
      call settle_depths(self, r)
      call self%balance_state%reduce(self%adjusted, rhs(:self%n_balance))
      associate (work => self%work(self%problem%forces%pairs))
         do j = 1, self%n_wearing
            i = self%wearing(j)
            ! The inputs hold what the coordinates that are solved at once do to the prediction.
            rhs(self%n_balance + j) = -r(n + i) + self%weight(i)*self%cycles*self%factor(i)* &
                                      dot_product(work%slip_derivative(:, i), work%input(:, i))
         end do
      end associate
   end subroutine reduce

   !> Residuals of the balance after the depths that leave the linear problem have taken theirs.
   subroutine settle_depths(self, r)
      type(wear_system), intent(inout) :: self
      real(wp), intent(in) :: r(:)
      integer :: i, m, n, row

      m = self%problem%structure%n_coordinates
      n = self%n_vibration()
      self%adjusted = r(:n)
      if (.not. self%problem%fourier%has_constant()) return
      do i = 1, self%problem%n_pairs
         row = self%problem%joint%row(3, i)
         if (row == 0 .or. self%work(self%problem%forces%pairs)%linear_state(i) /= pair_stuck) cycle
         call self%problem%incidence%scatter_row(row, self%problem%incidence%identity, m, m, &
                                         -self%normal(i)/self%weight(i), r(n + i:n + i), &
                                         self%adjusted)
      end do
   end subroutine settle_depths

   subroutine expand(self, r, solution, step)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)
      integer :: n, j

      n = self%n_vibration()
      call settle_depths(self, r)
      call self%balance_state%expand(self%adjusted, solution(:self%n_balance), step(:n))
      step(n + 1:) = -r(n + 1:)/self%weight
      do j = 1, self%n_wearing
         step(n + self%wearing(j)) = solution(self%n_balance + j)
      end do
   end subroutine expand

   subroutine apply(self, vector, product)
      class(wear_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: i, j, n

      n = self%n_balance
      call self%balance_state%apply(vector(:n), product(:n))
      associate (work => self%work(self%problem%forces%pairs))
         do j = 1, self%n_wearing
            i = self%wearing(j)
            call add_depth_column(self, i, vector(n + j), product)
            product(n + j) = self%weight(i)*(vector(n + j) - self%cycles*self%factor(i)*( &
                             dot_product(work%slip_derivative(:, i), work%input(:, i)) + &
                             depth_slope(self, i)*vector(n + j)))
         end do
      end associate
   end subroutine apply

   !> dS/dw of a pair at fixed displacements.
   pure real(wp) function depth_slope(self, pair) result(slope)
      type(wear_system), intent(in) :: self
      integer, intent(in) :: pair

      slope = 0.0_wp
      if (self%problem%joint%row(3, pair) == 0) return
      slope = self%normal(pair)* &
              self%work(self%problem%forces%pairs)%slip_derivative(2* &
                 self%problem%fourier%n_coefficients + 1, pair)
   end function depth_slope

   !> product = product + B^T G eps e_0 of one pair, times its depth.
   subroutine add_depth_column(self, pair, depth, product)
      type(wear_system), intent(in) :: self
      integer, intent(in) :: pair
      real(wp), intent(in) :: depth
      real(wp), intent(inout) :: product(:)
      integer :: c, nc

      if (self%problem%joint%row(3, pair) == 0) return
      nc = self%problem%fourier%n_coefficients
      do c = 1, 3
         if (self%problem%joint%row(c, pair) == 0) cycle
         call self%problem%incidence%scatter_row( &
            self%problem%joint%row(c, pair), self%active%place, self%active%n_active, &
               self%active%n_active, &
            self%normal(pair)*depth, &
            self%work(self%problem%forces%pairs)%jacobian(2*nc + 1, (c - 1)*nc + 1:c*nc, pair), &
               product)
      end do
   end subroutine add_depth_column

   subroutine build_preconditioner(self)
      class(wear_system), intent(inout) :: self
      real(wp), allocatable :: column(:)
      integer :: h, i, j, na
      logical :: singular

      call self%balance_state%build_preconditioner()
      if (self%n_wearing == 0) return
      na = self%active%n_active
      call reserve(self)
      allocate (column(self%n_balance))
      call self%complement%reserve(self%n_wearing)
      associate (s => self%complement%matrix)
         s(:self%n_wearing, :self%n_wearing) = 0.0_wp
         do j = 1, self%n_wearing
            i = self%wearing(j)
            column = 0.0_wp
            call add_depth_column(self, i, 1.0_wp, column)
            call harmonics_of(self, na, column, self%columns(:, j, :))
            s(j, j) = self%weight(i)*(1.0_wp - self%cycles*self%factor(i)*depth_slope(self, i))
         end do
         do h = 1, self%problem%fourier%n_retained
            do j = 1, self%n_wearing
               call self%preconditioner%harmonic(h)%solve(self%columns(:na, j, h))
            end do
            if (takes_balance(self)) call multiply_columns(self, h)
            call subtract_rows(self, h, self%n_wearing, self%columns(:, :, h), s)
         end do
      end associate
      call self%complement%factor(singular)
   end subroutine build_preconditioner

   !> The complement holds the cycles of its step and the sliding at its point: it is built anew.
   pure logical function preconditioner_fits(self)
      class(wear_system), intent(in) :: self

      preconditioner_fits = self%n_wearing == 0
      if (preconditioner_fits) preconditioner_fits = self%balance_state%preconditioner_fits()
   end function preconditioner_fits

   subroutine reserve(self)
      type(wear_system), intent(inout) :: self
      integer :: m, n

      m = self%problem%structure%n_coordinates
      n = self%n_wearing
      if (allocated(self%columns)) then
         if (size(self%columns, 2) == n) return
         deallocate (self%columns, self%stiff)
      end if
      allocate (self%columns(m, n, self%problem%fourier%n_retained), self%stiff(m, max(n, 1)))
   end subroutine reserve

   !> Harmonics of active coordinates as complex rows.
   pure subroutine harmonics_of(self, na, vector, harmonics)
      type(wear_system), intent(in) :: self
      integer, intent(in) :: na
      real(wp), intent(in) :: vector(na, *)
      complex(wp), intent(inout) :: harmonics(:, :)
      integer :: h, k

      do h = 1, self%problem%fourier%n_retained
         k = self%problem%fourier%column(h)
         if (self%problem%fourier%harmonic(h) == 0) then
            harmonics(:na, h) = cmplx(vector(:, k), kind=wp)
         else
            harmonics(:na, h) = cmplx(vector(:, k), -vector(:, k + 1), wp)
         end if
      end do
   end subroutine harmonics_of

   !> Whether the pairs take the balance: their predictions need Z_n z.
   pure logical function takes_balance(self)
      type(wear_system), intent(in) :: self

      takes_balance = self%problem%forces%entry( &
         self%problem%forces%pairs)%law%prediction%takes_balance
   end function takes_balance

   !> stiff = Z_n columns of one harmonic, rows in use.
   subroutine multiply_columns(self, h)
      type(wear_system), intent(inout) :: self
      integer, intent(in) :: h
      complex(wp), allocatable :: stiffness(:, :)

      allocate (stiffness(self%active%n_used, self%active%n_active))
      call self%problem%structure%active_block(self%structure_state, h, stiffness)
      call zgemm('N', 'N', self%active%n_used, self%n_wearing, self%active%n_active, one, &
                 stiffness, &
                 self%active%n_used, self%columns(1, 1, h), size(self%columns, 1), zero, &
                    self%stiff, &
                 size(self%stiff, 1))
   end subroutine multiply_columns

   !> rows = rows - C z for displacements z of one harmonic (active coordinates, right-hand side);
   !> where the pairs take the balance, Z_n z is in `stiff`.
   subroutine subtract_rows(self, h, n_right, z, rows)
      type(wear_system), intent(inout) :: self
      integer, intent(in) :: h, n_right
      complex(wp), intent(in) :: z(:, :)
      real(wp), intent(inout) :: rows(:, :)
      complex(wp) :: input(n_right), turn
      integer :: c, i, j, k, n, nc, place, row

      nc = self%problem%fourier%n_coefficients
      n = self%problem%fourier%harmonic(h)
      associate (p => self%problem%forces%entry(self%problem%forces%pairs)%law%prediction, &
                 work => self%work(self%problem%forces%pairs))
         do j = 1, self%n_wearing
            i = self%wearing(j)
            do c = 1, 3
               row = self%problem%joint%row(c, i)
               if (row == 0) cycle
               ! d/dtau is a factor i n of the complex coefficient.
               turn = one
               if (p%order(c) > 0) turn = cmplx(0.0_wp, self%rate_unit(p)*n, wp)
               turn = turn*p%impedance_ratio(i, c, n, self%frequency())
               call self%problem%incidence%gather_harmonic(row, h, self%active%place, &
                                                           self%active%n_active, &
                                                   turn*p%stiffness(i, c), z, input)
               place = self%active%place(self%problem%incidence%coordinate_of(row))
               if (p%takes_balance .and. place > 0) input = input - self%stiff(place, :n_right)
               k = (c - 1)*nc + self%problem%fourier%column(h)
               associate (g => work%slip_derivative(:, i), &
                          scale => self%weight(i)*self%cycles*self%factor(i))
                  rows(j, :n_right) = rows(j, :n_right) + scale*g(k)*real(input, wp)
                  if (n > 0) rows(j, :n_right) = rows(j, :n_right) - scale*g(k + 1)*aimag(input)
               end associate
            end do
         end do
      end associate
   end subroutine subtract_rows

   subroutine precondition(self, vector)
      class(wear_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      complex(wp), allocatable :: z(:, :, :)
      real(wp) :: depth(self%n_wearing, 1)
      integer :: h, k, na, n

      n = self%n_balance
      call self%balance_state%precondition(vector(:n))
      if (self%n_wearing == 0) return
      na = self%active%n_active
      allocate (z(self%problem%structure%n_coordinates, 1, self%problem%fourier%n_retained))
      call harmonics_of(self, na, vector, z(:, 1, :))
      depth(:, 1) = vector(n + 1:)
      if (takes_balance(self)) then
         call self%problem%structure%multiply_active(self%structure_state, vector, &
                                                     self%scratch%active_out)
         call to_complex(self%problem%fourier, size(self%scratch%active_out, 1), &
                         self%scratch%active_out, self%scratch%complex_out)
      end if
      do h = 1, self%problem%fourier%n_retained
         self%stiff(:, 1) = self%scratch%complex_out(:, h)
         call subtract_rows(self, h, 1, z(:, :, h), depth)
      end do
      call self%complement%solve(depth(:, 1))
      vector(n + 1:) = depth(:, 1)
      do h = 1, self%problem%fourier%n_retained
         z(:na, 1, h) = matmul(self%columns(:na, :, h), depth(:, 1))
         k = self%problem%fourier%column(h)
         vector((k - 1)*na + 1:k*na) = vector((k - 1)*na + 1:k*na) - real(z(:na, 1, h), wp)
         if (self%problem%fourier%harmonic(h) > 0) vector(k*na + 1:(k + 1)*na) &
            = vector(k*na + 1:(k + 1)*na) + aimag(z(:na, 1, h))
      end do
   end subroutine precondition

end module fw_wear_system
