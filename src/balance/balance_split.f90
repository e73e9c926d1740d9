!> The preconditioner of a structure whose stiffness is that of rest and a low rank, or of rest
!> alone: two matrices for all harmonics (fw_split_factors). With g_0 the mean derivative of the
!> forces in harmonic 0 and g_1 that of all others,
!>
!>   P_j = (1 - g_j) K + g_j k d,   X = (1 - g_1) V.
!>
!> In harmonic 0 nothing moves: P_0 is real, and has no part of low rank.
submodule(fw_balance_state:fw_balance_preconditioner) fw_balance_split
   implicit none (type, external)

   !> Terms g of the rows: m(row, :) = m(row, :) - g static(source, :).
   type :: row_terms
      integer :: n = 0
      integer, allocatable :: row(:), source(:)
      complex(wp), allocatable :: factor(:)
   end type row_terms

contains

   module procedure build_split
      real(wp), allocatable :: static(:, :)
      complex(wp), allocatable :: dynamic(:, :, :)
      type(row_terms) :: terms
      real(wp) :: largest
      integer :: h, j, k, na, nh, rank

      na = self%active%n_active
      nh = self%problem%fourier%n_retained
      ! Blocks that are all alike have no part of their own.
      rank = 0
      if (self%splits()) rank = self%problem%structure%split_rank()
      allocate (static(self%active%n_used, na + rank), dynamic(rank, rank, nh))
      if (self%splits()) then
         call self%problem%structure%static_block(self%structure_state, static)
      else
         call read_alike(self, static)
      end if
      largest = 0.0_wp
      do k = 1, na
         largest = max(largest, abs(static(k, k)))
      end do
      do h = 1, merge(nh, 0, rank > 0)
         call self%problem%structure%dynamic_block(self%structure_state, h, dynamic(:, :, h))
      end do
      call reserve_terms(self, terms)
      associate (split => self%preconditioner%split)
         call split%reserve(na, rank, nh, largest)
         split%v = cmplx(static(:na, na + 1:), kind=sp)
         ! P_0 takes shape in the place of P_1, which follows it.
         do j = merge(0, 1, first_moving(self) == 2), 1
            associate (m => split%moving%matrix, scale => split%moving%scale)
               call copy_scaled(na, scale, static, m)
               split%u = cmplx(scale*static(:na, na + 1:), kind=sp)
               terms%n = 0
               do k = 1, self%problem%forces%n_laws
                  call add_law(self, self%problem%forces%entry(k), self%work(k), j, scale, m, terms)
               end do
               call subtract_terms(terms, na, static, m, split%u)
               if (j == 0) split%constant(:na, :na) = real(m(:na, :na), sp)
            end associate
         end do
         call split%factor(first_moving(self), dynamic)
      end associate
   end procedure build_split

   !> The block that all harmonics share.
   subroutine read_alike(self, static)
      type(balance_state), intent(in) :: self
      real(wp), intent(out) :: static(:, :)
      complex(wp), allocatable :: stiffness(:, :)

      allocate (stiffness(size(static, 1), size(static, 2)))
      call self%problem%structure%active_block(self%structure_state, 1, stiffness)
      static = real(stiffness, wp)
   end subroutine read_alike

   module procedure are_alike
      complex(wp), allocatable :: first(:, :), other(:, :)
      integer :: h, m

      associate (place => [self%frequency(), self%moved%value])
         is_so = self%is_alike
         if (all(abs(self%compared_at - place) <= 0.0_wp)) return
         ! Blocks that were found to differ are not compared again.
         if (self%compared_at(1) > 0.0_wp .and. .not. self%is_alike) return
         self%compared_at = place
         m = self%problem%structure%n_coordinates
         allocate (first(m, m), other(m, m))
         call self%problem%structure%block(self%structure_state, 1, first)
         self%is_alike = .not. any(abs(aimag(first)) > 0.0_wp)
         do h = 2, self%problem%fourier%n_retained
            if (.not. self%is_alike) exit
            call self%problem%structure%block(self%structure_state, h, other)
            self%is_alike = .not. any(abs(other - first) > 0.0_wp)
         end do
         is_so = self%is_alike
      end associate
   end procedure are_alike

   !> Number of the first harmonic that is not 0.
   pure integer function first_moving(self) result(first)
      type(balance_state), intent(in) :: self

      first = merge(2, 1, self%problem%fourier%has_constant())
   end function first_moving

   !> Room for all terms of a derivative.
   pure subroutine reserve_terms(self, terms)
      type(balance_state), intent(in) :: self
      type(row_terms), intent(inout) :: terms
      integer :: k, n

      n = 0
      do k = 1, self%problem%forces%n_laws
         n = n + size(self%problem%forces%entry(k)%row)*size(self%problem%forces%entry(k)%row, 1)
      end do
      allocate (terms%row(n), terms%source(n), terms%factor(n))
   end subroutine reserve_terms

   !> k d of a law into the matrix, and what it takes of the rows of K and V into the terms.
   subroutine add_law(self, entry, work, j, scale, m, terms)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      !> 0 for harmonic 0, 1 for all others.
      integer, intent(in) :: j
      real(wp), intent(in) :: scale
      complex(sp), intent(inout) :: m(:, :)
      type(row_terms), intent(inout) :: terms
      integer :: i, c_out, c_in
      complex(wp) :: mean

      do i = 1, size(entry%row, 2)
         if (work%linear_state(i) == pair_open) cycle
         do c_out = 1, size(entry%row, 1)
            if (entry%row(c_out, i) == 0) cycle
            do c_in = 1, size(entry%row, 1)
               if (entry%row(c_in, i) == 0) cycle
               if (work%linear_state(i) /= pair_mixed .and. c_in /= c_out) cycle
               mean = one
               if (work%linear_state(i) == pair_mixed) mean = mean_of(self, work, i, c_in, c_out, j)
               call add_term(self, entry, i, c_out, c_in, scale*mean, m, terms)
            end do
         end do
      end do
   end subroutine add_law

   !> Mean block of the derivative of an element over harmonic 0, or over all others.
   pure complex(wp) function mean_of(self, work, element, c_in, c_out, j) result(mean)
      type(balance_state), intent(in) :: self
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: element, c_in, c_out, j
      integer :: h, k, n, nc

      nc = self%problem%fourier%n_coefficients
      mean = zero
      n = 0
      do h = 1, self%problem%fourier%n_retained
         if ((self%problem%fourier%harmonic(h) == 0) .neqv. j == 0) cycle
         k = self%problem%fourier%column(h)
         mean = mean + mean_block(work%jacobian(:, :, element), self%problem%fourier%harmonic(h), &
                                  (c_in - 1)*nc + k, (c_out - 1)*nc + k)
         n = n + 1
      end do
      if (n > 0) mean = mean/n
   end function mean_of

   !> mean (k d - A) of one input in the row of one output.
   subroutine add_term(self, entry, element, c_out, c_in, mean, m, terms)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: element, c_out, c_in
      complex(wp), intent(in) :: mean
      complex(sp), intent(inout) :: m(:, :)
      type(row_terms), intent(inout) :: terms
      integer :: p_out, p_in

      associate (p => entry%law%prediction, row => entry%row(:, element), &
                 na => self%active%n_active)
         if (p%takes(element)) then
            p_out = self%active%place(self%problem%incidence%coordinate_of(row(c_out)))
            p_in = self%active%place(self%problem%incidence%coordinate_of(row(c_in)))
            if (p_in > 0 .and. p_out > 0 .and. p_out <= na) then
               terms%n = terms%n + 1
               terms%row(terms%n) = p_out
               terms%source(terms%n) = p_in
               terms%factor(terms%n) = mean
            end if
         end if
         ! Of any harmonic: weights do not turn here.
         call self%problem%incidence%add_mapped_block(row(c_out), row(c_in), 1, &
                                                      self%active%place, na, &
                                                      p%stiffness(element, c_in)*mean, m)
      end associate
   end subroutine add_term

   !> K of the active coordinates; threads share the columns.
   subroutine copy_scaled(na, scale, static, m)
      integer, intent(in) :: na
      real(wp), intent(in) :: scale, static(:, :)
      complex(sp), intent(inout) :: m(:, :)
      integer :: k

      !$omp parallel do default(none) private(k) shared(na, scale, static, m) &
      !$omp if(na >= coordinates_for_threads)
      do k = 1, na
         m(:na, k) = cmplx(scale*static(:na, k), kind=sp)
      end do
      !$omp end parallel do
   end subroutine copy_scaled

   !> Column by column, as the matrices lie in memory; threads share them.
   subroutine subtract_terms(terms, na, static, m, x)
      type(row_terms), intent(in) :: terms
      integer, intent(in) :: na
      !> [K V].
      real(wp), intent(in) :: static(:, :)
      complex(sp), intent(inout) :: m(:, :), x(:, :)
      integer :: e, k

      !$omp parallel do default(none) private(e, k) shared(terms, na, static, m) &
      !$omp if(na >= coordinates_for_threads)
      do k = 1, na
         do e = 1, terms%n
            m(terms%row(e), k) = m(terms%row(e), k) - &
                                 cmplx(terms%factor(e)*static(terms%source(e), k), kind=sp)
         end do
      end do
      !$omp end parallel do
      do k = 1, size(x, 2)
         do e = 1, terms%n
            x(terms%row(e), k) = x(terms%row(e), k) - &
                                 cmplx(terms%factor(e)*static(terms%source(e), na + k), kind=sp)
         end do
      end do
   end subroutine subtract_terms

   !> Coordinates that the factors do not know are taken as stuck, as `solve_kept` does.
   module procedure solve_split
      integer :: k

      associate (kept => self%preconditioner, fourier => self%problem%fourier)
         kept%from(:kept%n) = 0
         do k = 1, na
            if (kept%place(k) > 0) then
               kept%from(kept%place(k)) = k
            else
               vector(k, :) = vector(k, :)/kept%unknown_stiffness(k)
            end if
         end do
         call kept%split%solve(fourier%harmonic, fourier%column, kept%from(:kept%n), &
                               self%problem%structure%n_coordinates >= coordinates_for_threads, &
                               vector)
      end associate
   end procedure solve_split

end submodule fw_balance_split
