!> The transposed derivative of a balance with symmetric Z_n: for the weights w of the equations,
!>
!>   J^T w = A^T w + sum (Y^T - A^T S^T) G^T B w   of the laws that take the balance,
!>   A^T w = Z^T w + sum Y^T G^T B w               of the others,
!>
!> Y v being the part k B d v of the inputs that follows the displacements, and S the rows of the
!> balance that a law takes. Real forms of symmetric complex matrices have their conjugates for
!> transposes. The state has to be linearized with all of its coordinates active (`reduced` false).
module fw_transposed_balance
   use fw_balance_state, only: balance_state
   use fw_complex_form, only: amplitudes_of, coefficients_of
   use fw_force_law, only: force_workspace, pair_mixed, pair_open, prediction_type
   use fw_force_list, only: force_entry
   use fw_kinds, only: wp
   use fw_krylov, only: linear_operator
   use fw_lapack, only: dgemv, zgetrs
   implicit none (type, external)
   private

   public :: transposed_balance, pull_forces

   !> For iterative solutions; the preconditioner is the transpose of the one of the balance.
   type, extends(linear_operator) :: transposed_balance
      type(balance_state), pointer :: state => null()
   contains
      procedure :: apply
      procedure :: precondition
   end type transposed_balance

contains

   !> product = J^T vector (n_coordinates * n_coefficients).
   subroutine apply(self, vector, product)
      class(transposed_balance), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)

      associate (p => self%state%problem)
         call multiply_transposed(self%state, p%structure%n_coordinates, &
                                  p%fourier%n_coefficients, vector, product)
      end associate
   end subroutine apply

   !> The same, shaped.
   subroutine multiply_transposed(state, m, nc, vector, product)
      type(balance_state), intent(inout) :: state
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: vector(m, nc)
      real(wp), intent(out) :: product(m, nc)
      real(wp) :: weight(m, nc)
      integer :: k

      call state%form_jacobians()
      product = 0.0_wp
      weight = vector
      do k = 1, state%problem%forces%n_laws
         associate (entry => state%problem%forces%entry(k), work => state%work(k))
            if (.not. entry%law%prediction%takes_balance) cycle
            call gather_outputs(state, entry, m, vector, work)
            call pull_inputs(state, entry, m, .true., work, product, weight)
         end associate
      end do
      call add_without_balance(state, m, nc, weight, product)
   end subroutine multiply_transposed

   !> product = product + (d lambda/d q)^T weights: slopes of something by the forces of the pairs
   !> become slopes by the coordinates.
   subroutine pull_forces(state, slope, product)
      type(balance_state), intent(inout) :: state
      !> By the coefficients of the forces (n_pairs, 3, n_coefficients).
      real(wp), intent(in) :: slope(:, :, :)
      !> (n_coordinates, n_coefficients)
      real(wp), intent(inout) :: product(:, :)
      real(wp) :: weight(size(product, 1), size(product, 2))
      integer :: c, i, nc

      call state%form_jacobians()
      nc = size(product, 2)
      weight = 0.0_wp
      associate (entry => state%problem%forces%entry(state%problem%forces%pairs), &
                 work => state%work(state%problem%forces%pairs))
         do i = 1, size(slope, 1)
            do c = 1, 3
               work%input((c - 1)*nc + 1:c*nc, i) = slope(i, c, :)
            end do
         end do
         if (entry%law%prediction%some_are_free()) then
            call pull_inputs(state, entry, size(product, 1), .false., work, product)
         end if
         if (.not. entry%law%prediction%takes_balance) return
         call pull_inputs(state, entry, size(product, 1), .true., work, product, weight)
      end associate
      call add_without_balance(state, size(product, 1), nc, weight, product)
   end subroutine pull_forces

   !> product = product + A^T weight.
   subroutine add_without_balance(state, m, nc, weight, product)
      type(balance_state), intent(inout) :: state
      integer, intent(in) :: m, nc
      real(wp), intent(in) :: weight(m, nc)
      real(wp), intent(inout) :: product(m, nc)
      real(wp) :: turned(m, nc), pulled(m, nc)
      integer :: k

      turned = weight
      call conjugate(state, turned)
      call state%problem%structure%multiply(state%structure_state, turned, pulled)
      call conjugate(state, pulled)
      product = product + pulled
      do k = 1, state%problem%forces%n_laws
         associate (entry => state%problem%forces%entry(k), work => state%work(k))
            if (.not. entry%law%prediction%some_are_free()) cycle
            call gather_outputs(state, entry, m, weight, work)
            call pull_inputs(state, entry, m, .false., work, product)
         end associate
      end do
   end subroutine add_without_balance

   !> Turn the sign of the sines: the coefficients uc, us are the amplitude uc - i us.
   pure subroutine conjugate(state, rows)
      type(balance_state), intent(in) :: state
      real(wp), intent(inout) :: rows(:, :)
      integer :: h, sine

      do h = 1, state%problem%fourier%n_retained
         if (state%problem%fourier%harmonic(h) == 0) cycle
         sine = state%problem%fourier%column(h) + 1
         rows(:, sine) = -rows(:, sine)
      end do
   end subroutine conjugate

   !> B w of all elements of a law, into `input`.
   subroutine gather_outputs(state, entry, m, vector, work)
      type(balance_state), intent(in) :: state
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: m
      real(wp), intent(in) :: vector(m, *)
      type(force_workspace), intent(inout) :: work
      integer :: c, i, nc

      nc = state%problem%fourier%n_coefficients
      do i = 1, size(entry%row, 2)
         do c = 1, size(entry%row, 1)
            work%input((c - 1)*nc + 1:c*nc, i) = 0.0_wp
            if (entry%row(c, i) == 0) cycle
            call state%problem%incidence%gather_row(entry%row(c, i), &
                                                    state%problem%incidence%identity, m, 1.0_wp, &
                                                    vector, work%input((c - 1)*nc + 1:c*nc, i))
         end do
      end do
   end subroutine gather_outputs

   !> Add Y^T G^T input to the product, and take S^T G^T input off `balance`, where that is there:
   !> of the elements that take the balance, or of the others.
   subroutine pull_inputs(state, entry, m, takes, work, product, balance)
      type(balance_state), intent(in) :: state
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: m
      logical, intent(in) :: takes
      type(force_workspace), intent(inout) :: work
      real(wp), intent(inout) :: product(:, :)
      real(wp), intent(inout), optional :: balance(:, :)
      integer :: c, i, j, nc

      nc = state%problem%fourier%n_coefficients
      do i = 1, size(entry%row, 2)
         if (work%linear_state(i) == pair_open) cycle
         if (entry%law%prediction%takes(i) .neqv. takes) cycle
         call multiply_block(work, i)
         do c = 1, size(entry%row, 1)
            if (entry%row(c, i) == 0) cycle
            associate (p => entry%law%prediction, h => work%output((c - 1)*nc + 1:c*nc, i))
               if (present(balance)) then
                  j = state%problem%incidence%coordinate_of(entry%row(c, i))
                  balance(j, :) = balance(j, :) - h
               end if
               ! Backwards through what makes an input of a displacement.
               if (p%has_inertia) call turn_back(state, p, i, c, h)
               if (p%order_of(i, c) > 0) then
                  call take_back(state, work%linear_rests(i), state%rate_unit(p, i), h)
               end if
               call state%problem%incidence%scatter_row(entry%row(c, i), &
                                                        state%problem%incidence%identity, m, &
                                                        size(product, 1), p%stiffness(i, c), h, &
                                                        product)
            end associate
         end do
      end do
   end subroutine pull_inputs

   !> output = G^T input of one element.
   subroutine multiply_block(work, element)
      type(force_workspace), intent(inout) :: work
      integer, intent(in) :: element
      integer :: n

      n = size(work%input, 1)
      if (work%linear_state(element) == pair_mixed) then
         ! Stored transposed, (input, output).
         call dgemv('N', n, n, 1.0_wp, work%jacobian(1, 1, element), n, work%input(1, element), 1, &
                    0.0_wp, work%output(1, element), 1)
      else
         work%output(:, element) = work%input(:, element)
      end if
   end subroutine multiply_block

   !> The transpose of a derivative by tau: (a, b) -> (-n b, n a).
   subroutine take_back(state, keeps_mean, unit, values)
      type(balance_state), intent(in) :: state
      logical, intent(in) :: keeps_mean
      real(wp), intent(in) :: unit
      real(wp), intent(inout) :: values(:)
      real(wp) :: cosine, n
      integer :: h, k

      do h = 1, state%problem%fourier%n_retained
         k = state%problem%fourier%column(h)
         if (state%problem%fourier%harmonic(h) == 0) then
            if (.not. keeps_mean) values(k) = 0.0_wp
            cycle
         end if
         n = unit*real(state%problem%fourier%harmonic(h), wp)
         cosine = values(k)
         values(k) = -n*values(k + 1)
         values(k + 1) = n*cosine
      end do
   end subroutine take_back

   !> The transpose of a factor E_n over the stiffness: its conjugate.
   subroutine turn_back(state, prediction, element, component, values)
      type(balance_state), intent(in) :: state
      type(prediction_type), intent(in) :: prediction
      integer, intent(in) :: element, component
      real(wp), intent(inout) :: values(:)
      complex(wp) :: turned
      integer :: h, k

      do h = 1, state%problem%fourier%n_retained
         if (state%problem%fourier%harmonic(h) == 0) cycle
         k = state%problem%fourier%column(h)
         turned = conjg(prediction%impedance_ratio(element, component, &
                                                   state%problem%fourier%harmonic(h), &
                                                   state%frequency()))* &
                  cmplx(values(k), -values(k + 1), wp)
         values(k) = real(turned, wp)
         values(k + 1) = -aimag(turned)
      end do
   end subroutine turn_back

   !> P^-T, harmonic by harmonic: conjugate, transposed factors, conjugate.
   subroutine precondition(self, vector)
      class(transposed_balance), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      complex(wp), allocatable :: amplitude(:, :), ordered(:)
      integer :: h, m

      associate (state => self%state, f => self%state%problem%fourier)
         m = state%problem%structure%n_coordinates
         allocate (amplitude(m, f%n_retained), ordered(m))
         call amplitudes_of(f%harmonic, f%column, m, vector, m, amplitude)
         if (state%problem%structure%n_alike > 1 .and. .not. state%preconditioner%is_whole) then
            do h = 1, f%n_retained
               call solve_waves(state, h, amplitude(:, h))
            end do
            call coefficients_of(f%harmonic, f%column, m, m, amplitude, vector)
            return
         end if
         do h = 1, f%n_retained
            ! Built for all coordinates, in whatever order.
            ordered(state%preconditioner%place(:m)) = conjg(amplitude(:, h))
            call state%preconditioner%harmonic(h)%solve_transposed(ordered)
            amplitude(:, h) = conjg(ordered(state%preconditioner%place(:m)))
         end do
         call coefficients_of(f%harmonic, f%column, m, m, amplitude, vector)
      end associate
   end subroutine precondition

   !> The same with waves around equal sectors (fw_balance_waves), of symmetric Z_n: the transpose
   !> of M_k stands in N - k, and with D symmetric that of the whole is
   !>
   !>   M^-T - M^-T W^T (I + Gamma D)^-T D W M^-T.
   subroutine solve_waves(state, h, values)
      type(balance_state), intent(inout) :: state
      integer, intent(in) :: h
      !> In place (n_coordinates).
      complex(wp), intent(inout) :: values(:)
      integer :: info, j, m, n, r

      n = state%problem%structure%n_alike
      associate (around => state%preconditioner%around, s => state%problem%structure, &
                 own => state%preconditioner%around%own(h))
         do j = 1, s%n_coordinates
            around%sectors(s%slot(j), s%sector(j), h) = conjg(values(j))
         end do
         if (around%differing(h)%is_there) then
            call s%find_waves(around%sectors(:, :, h), around%waves(:, :, h))
            call around%differing(h)%take_off_transposed(around%waves(:, :, h))
            call s%add_waves(around%waves(:, :, h), around%sectors(:, :, h))
         end if
         call solve_each_wave(state, h)
         if (own%is_there) then
            r = size(own%rows, 1)
            m = n*r
            call s%read_own(around%sectors(:, :, h), own%rows)
            do j = 1, n
               own%force((j - 1)*r + 1:j*r) = matmul(own%block(:, :, j), own%rows(:, j))
            end do
            call zgetrs('T', m, 1, own%matrix, m, own%pivot, own%force, m, info)
            own%rows = reshape(own%force, [r, n])
            around%answer(:, :, h) = around%sectors(:, :, h)
            around%sectors(:, :, h) = (0.0_wp, 0.0_wp)
            call s%add_own(own%rows, around%sectors(:, :, h))
            call solve_each_wave(state, h)
            around%sectors(:, :, h) = around%answer(:, :, h) - around%sectors(:, :, h)
         end if
         do j = 1, s%n_coordinates
            values(j) = conjg(around%sectors(s%slot(j), s%sector(j), h))
         end do
      end associate
   end subroutine solve_waves

   !> M^-T of the coordinates of all sectors.
   subroutine solve_each_wave(state, h)
      type(balance_state), intent(inout) :: state
      integer, intent(in) :: h
      integer :: k, n

      n = state%problem%structure%n_alike
      associate (around => state%preconditioner%around, s => state%problem%structure)
         call s%find_waves(around%sectors(:, :, h), around%waves(:, :, h))
         do k = 1, n
            call around%wave(modulo(n - k + 1, n) + 1, h)%solve_transposed(around%waves(:, k, h))
         end do
         call s%add_waves(around%waves(:, :, h), around%sectors(:, :, h))
      end associate
   end subroutine solve_each_wave

end module fw_transposed_balance
