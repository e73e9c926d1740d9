!> The linear problem of a Newton step on a nonlinear mode: the derivative of the balance with two
!> borders. What the balance solves at once (rows that stick through the period, eps v = -r) leaves
!> it as in a response: such rows have no column of omega or xi, but the conditions see them.
!>
!> For GMRES harmonic 1 is preconditioned with its border, as a complex matrix of one order more,
!>
!>   [ P_1  c ] [ v     ]
!>   [ a^T  0 ] [ delta ],       domega = Re delta,   dxi = 2 Im delta,
!>
!> since both columns are multiples of M U_1 where damping is small: -2 omega M U_1 of omega,
!> -i omega M U_1 of xi. Then the columns leave the other harmonics, which are preconditioned as
!> those of a response. P_1 alone is as good as singular: the motion may be shifted in time.
submodule(fw_mode_system) fw_mode_linear
   use fw_kinds, only: sp
   use fw_structure_operator, only: by_frequency, by_self_excitation
   implicit none (type, external)

   complex(wp), parameter :: i = (0.0_wp, 1.0_wp)

contains

   module procedure linearize
      real(wp) :: slope(self%balance%n)
      integer :: k, na
      integer, parameter :: parameters(*) = [by_frequency, by_self_excitation]

      self%balance%reduced = self%reduced
      call self%balance%linearize(n_linear)
      associate (active => self%balance%active)
         na = active%n_active
         do k = 1, 2
            call self%balance%derivative_by(parameters(k), self%q, slope)
            slope = self%frequency_unit/self%length()*slope
            call gather(active%used(:na), size(self%mass, 1), slope, self%columns(:n_linear, k))
            self%active_rows(:na, k) = self%rows(active%used(:na), k)
         end do
      end associate
      n_linear = n_linear + 2
   end procedure linearize

   !> Rows in use of all coefficients.
   pure subroutine gather(used, m, whole, part)
      integer, intent(in) :: used(:), m
      real(wp), intent(in) :: whole(m, *)
      real(wp), intent(out) :: part(:)
      integer :: k, na

      na = size(used)
      if (na == 0) return
      do k = 1, size(part)/na
         part((k - 1)*na + 1:k*na) = whole(used, k)
      end do
   end subroutine gather

   ! The conditions see what is solved at once.
   module procedure reduce
      real(wp) :: step(self%balance%n), nothing(self%balance%active%n_linear)
      integer :: n, nl

      n = self%balance%n
      nl = size(nothing)
      call self%balance%reduce(r(:n), rhs(:nl))
      nothing = 0.0_wp
      call self%balance%expand(r(:n), nothing, step)
      associate (shape => self%motion(step))
         rhs(nl + 1) = -r(n + 1) - real(sum(self%rows(:, 1)*shape), wp)
         rhs(nl + 2) = -r(n + 2) - aimag(sum(self%rows(:, 2)*shape))
      end associate
   end procedure reduce

   module procedure expand
      integer :: n, nl

      n = self%balance%n
      nl = self%balance%active%n_linear
      self%scratch(:nl) = solution(:nl)
      call scale_static(self, self%static_unit/self%length())
      call self%balance%expand(r(:n), self%scratch(:nl), step(:n))
      step(:self%n_static) = self%length()/self%static_unit*step(:self%n_static)
      step(n + 1:) = solution(nl + 1:)
   end procedure expand

   !> Harmonic 0 of the scratch times a factor: it has its own unit among the unknowns.
   subroutine scale_static(self, factor)
      type(mode_system), intent(inout) :: self
      real(wp), intent(in) :: factor

      if (self%n_static == 0) return
      associate (na => self%balance%active%n_active)
         self%scratch(:na) = factor*self%scratch(:na)
      end associate
   end subroutine scale_static

   module procedure apply
      integer :: nl

      nl = self%balance%active%n_linear
      self%scratch(:nl) = vector(:nl)
      call scale_static(self, self%static_unit/self%length())
      call self%balance%apply(self%scratch(:nl), product(:nl))
      product(:nl) = product(:nl) + vector(nl + 1)*self%columns(:nl, 1) + &
                     vector(nl + 2)*self%columns(:nl, 2)
      call take_first(self, vector)
      associate (na => self%balance%active%n_active)
         product(nl + 1) = real(sum(self%active_rows(:na, 1)*self%active(:na)), wp)
         product(nl + 2) = aimag(sum(self%active_rows(:na, 2)*self%active(:na)))
      end associate
   end procedure apply

   !> Harmonic 1 of a vector of the linear problem, into `active`.
   subroutine take_first(self, vector)
      type(mode_system), intent(inout) :: self
      real(wp), intent(in) :: vector(:)
      integer :: c, s

      associate (na => self%balance%active%n_active)
         c = (self%cosine - 1)*na
         s = (self%sine - 1)*na
         self%active(:na) = cmplx(vector(c + 1:c + na), -vector(s + 1:s + na), wp)
      end associate
   end subroutine take_first

   ! The derivative of the balance as it assembles it, then the borders.
   module procedure assemble
      integer :: c, n, na, s

      n = self%balance%active%n_linear
      na = self%balance%active%n_active
      if (n > 0) call self%balance%assemble(matrix)
      if (self%n_static > 0) matrix(:n, :na) = self%static_unit/self%length()*matrix(:n, :na)
      matrix(:n, n + 1:n + 2) = self%columns(:n, :)
      matrix(n + 1:n + 2, :n + 2) = 0.0_wp
      c = (self%cosine - 1)*na
      s = (self%sine - 1)*na
      ! a^T (c - i s).
      matrix(n + 1, c + 1:c + na) = real(self%active_rows(:na, 1), wp)
      matrix(n + 1, s + 1:s + na) = aimag(self%active_rows(:na, 1))
      matrix(n + 2, c + 1:c + na) = aimag(self%active_rows(:na, 2))
      matrix(n + 2, s + 1:s + na) = -real(self%active_rows(:na, 2), wp)
   end procedure assemble

   module procedure build_preconditioner
      complex(wp) :: column(size(self%mass, 1))
      real(wp), parameter :: least = real(tiny(1.0_sp), wp)
      integer :: na

      call self%balance%build_preconditioner()
      na = self%balance%active%n_active
      ! Of all multiples of one complex column the nearest to both.
      call take_first(self, self%columns(:, 1))
      column(:na) = 0.5_wp*self%active(:na)
      call take_first(self, self%columns(:, 2))
      column(:na) = column(:na) - i*self%active(:na)
      call self%balance%fill_harmonic(self%first, 1, self%bordered)
      associate (b => self%bordered, row => self%active_rows(:na, 1))
         self%column_scale = 1.0_wp/max(b%scale*maxval(abs(column(:na))), least)
         self%row_scale = 1.0_wp/max(maxval(abs(row)), least)
         b%matrix(:na, na + 1) = cmplx(b%scale*self%column_scale*column(:na), kind=sp)
         b%matrix(na + 1, :na) = cmplx(self%row_scale*row, kind=sp)
         b%matrix(na + 1, na + 1) = (0.0_sp, 0.0_sp)
         call b%factor(packs=.true.)
      end associate
   end procedure build_preconditioner

   module procedure preconditioner_fits

      preconditioner_fits = self%bordered%n > 0 .and. self%balance%preconditioner_fits()
   end procedure preconditioner_fits

   module procedure precondition
      complex(wp) :: condition
      integer :: c, na, nl, s

      nl = self%balance%active%n_linear
      na = self%balance%active%n_active
      c = (self%cosine - 1)*na
      s = (self%sine - 1)*na
      call take_first(self, vector)
      condition = cmplx(vector(nl + 1), vector(nl + 2), wp)
      call solve_bordered(self, condition)
      vector(nl + 1) = real(condition, wp)
      vector(nl + 2) = 2.0_wp*aimag(condition)
      vector(:nl) = vector(:nl) - vector(nl + 1)*self%columns(:nl, 1) - &
                    vector(nl + 2)*self%columns(:nl, 2)
      call self%balance%precondition(vector(:nl))
      vector(c + 1:c + na) = real(self%active(:na), wp)
      vector(s + 1:s + na) = -aimag(self%active(:na))
      if (self%n_static > 0) vector(:na) = self%length()/self%static_unit*vector(:na)
   end procedure precondition

   !> Solve in `active` and the condition, which becomes delta; coordinates that joined since are
   !> taken as stuck, as in the balance.
   subroutine solve_bordered(self, condition)
      type(mode_system), intent(inout) :: self
      complex(wp), intent(inout) :: condition
      integer :: k, n

      associate (kept => self%balance%preconditioner, na => self%balance%active%n_active)
         n = kept%n
         self%border = (0.0_wp, 0.0_wp)
         do k = 1, na
            if (kept%place(k) > 0) then
               self%border(kept%place(k)) = self%active(k)
            else
               self%active(k) = self%active(k)/kept%unknown_stiffness(k)
            end if
         end do
         ! The factors are those of the matrix times its scale, of which the last row has none.
         self%border(n + 1) = self%row_scale/self%bordered%scale*condition
         call self%bordered%solve(self%border(:n + 1))
         condition = self%column_scale*self%border(n + 1)
         do k = 1, na
            if (kept%place(k) > 0) self%active(k) = self%border(kept%place(k))
         end do
      end associate
   end subroutine solve_bordered

   ! d/d ln A of R(A psi, u_0)/A, A the size: J (A psi)/A - R/A; the conditions do not see A. Asked
   ! for where nothing leaves the linear problem.
   module procedure parameter_derivative
      integer :: n

      n = self%balance%n
      self%scratch(:self%n_static) = 0.0_wp
      self%scratch(self%n_static + 1:) = x(self%n_static + 1:n)
      call self%balance%apply(self%scratch, dr(:n))
      dr(:n) = dr(:n) - self%r/self%length()
      dr(n + 1:) = 0.0_wp
   end procedure parameter_derivative

end submodule fw_mode_linear
