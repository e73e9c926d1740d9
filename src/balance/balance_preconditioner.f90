!> The preconditioner of the linear problem of a Newton step: per harmonic, in single precision, for
!> the coordinates that were active when it was built.
submodule(fw_balance_state) fw_balance_preconditioner
   use fw_force_law, only: pair_mixed, pair_open
   use fw_kinds, only: sp
   use fw_size_options, only: sizes
   implicit none (type, external)

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)
   !> Share of the active coordinates that may have joined or left since a preconditioner was built.
   real(wp), parameter :: most_changed = 0.05_wp

   ! Two matrices for all harmonics (fw_balance_split).
   interface
      module subroutine build_split(self)
         type(balance_state), intent(inout) :: self
      end subroutine build_split

      !> Whether Z_n is one real matrix in all harmonics, to the last bit, as without mass.
      module subroutine are_alike(self, is_so)
         type(balance_state), intent(inout) :: self
         logical, intent(out) :: is_so
      end subroutine are_alike

      !> In place, a vector of the active coordinates.
      module subroutine solve_split(self, na, vector)
         type(balance_state), intent(inout) :: self
         integer, intent(in) :: na
         real(wp), intent(inout) :: vector(na, self%problem%fourier%n_coefficients)
      end subroutine solve_split
   end interface

contains

   !> Per harmonic, the matrix with each G replaced by its mean over cosine and sine.
   module procedure build_preconditioner
      integer :: h

      call self%form_jacobians()
      self%preconditioner%is_split = self%splits() .and. .not. allocated(self%shift)
      if (.not. (self%preconditioner%is_split .or. allocated(self%shift) .or. by_waves(self))) then
         if (self%active%n_active >= sizes%alike_harmonics .and. &
             self%preconditioner%left_out == 0 .and. &
             self%has_static_laws) call are_alike(self, self%preconditioner%is_split)
      end if
      if (by_waves(self)) then
         call build_waves(self)
      else if (self%preconditioner%is_split) then
         call build_split(self)
      else if (self%problem%structure%n_coordinates < coordinates_for_threads) then
         do h = 1, self%problem%fourier%n_retained
            call build_harmonic(self, h)
         end do
      else
         !$omp parallel do default(none) shared(self) private(h) schedule(dynamic)
         do h = 1, self%problem%fourier%n_retained
            call build_harmonic(self, h)
         end do
         !$omp end parallel do
      end if
      self%preconditioner%n = self%active%n_active
      self%preconditioner%coordinate(:self%active%n_active) = &
         self%active%used(:self%active%n_active)
      ! It knows all that are active now; place_kept finds those of later steps in it.
      self%preconditioner%place(:self%active%n_active) = [(h, h=1, self%active%n_active)]
      ! A shift belongs to one step of pseudo-time: its factors serve no other.
      self%preconditioner%alteration = merge(huge(1.0_wp), self%alteration, allocated(self%shift))
   end procedure build_preconditioner

   pure logical function by_waves(self)
      class(balance_state), intent(in) :: self

      by_waves = self%problem%structure%n_alike > 1 .and. .not. self%preconditioner%is_whole
   end function by_waves

   module procedure take_whole

      is_stronger = by_waves(self)
      if (.not. is_stronger) return
      if (self%problem%fits_whole()) then
         self%preconditioner%is_whole = .true.
      else
         is_stronger = .not. self%preconditioner%tells_sectors .and. &
                       .not. self%problem%forces%takes_balance()
         if (.not. is_stronger) return
         self%preconditioner%tells_sectors = .true.
      end if
      ! What was built does not serve any more.
      self%preconditioner%n = 0
   end procedure take_whole

   !> Factors of one harmonic, but for the one that an augmented system builds with its borders.
   subroutine build_harmonic(self, h)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: h

      if (h == self%preconditioner%left_out) return
      call self%fill_harmonic(h, 0, self%preconditioner%harmonic(h))
      call self%preconditioner%harmonic(h)%factor(packs=.true.)
   end subroutine build_harmonic

   !> One harmonic: Z_n and the mean of what the forces add to it, scaled for single precision.
   module procedure fill_harmonic
      !> Z_n of rows and columns in use; of one harmonic at a time, so that memory holds no more.
      complex(wp), allocatable :: stiffness(:, :)
      integer :: k

      allocate (stiffness(self%active%n_used, self%active%n_active))
      ! Rows in use, not only the active ones: add_rows takes rows of A of pinned coordinates too.
      call self%problem%structure%active_block(self%structure_state, h, stiffness)
      call factors%reserve(self%active%n_active + n_more, largest_diagonal(stiffness))
      associate (m => factors%matrix, na => self%active%n_active, scale => factors%scale)
         m(:na, :na) = cmplx(scale*stiffness(:na, :), kind=sp)
         do k = 1, self%problem%forces%n_laws
            call add_mean_forces(self, self%problem%forces%entry(k), self%work(k), h, scale, &
                                 stiffness, m)
         end do
         if (allocated(self%shift)) then
            m(:na, :na) = m(:na, :na) + cmplx(scale*self%shift(:, :, h), kind=sp)
         end if
      end associate
   end procedure fill_harmonic

   !> Largest diagonal entry of the stiffness in absolute value.
   pure real(wp) function largest_diagonal(stiffness)
      complex(wp), intent(in) :: stiffness(:, :)
      integer :: j

      ! The first n_active rows are those of the columns, so that (j, j) is on the diagonal of Z_n.
      largest_diagonal = 0.0_wp
      do j = 1, size(stiffness, 2)
         largest_diagonal = max(largest_diagonal, abs(stiffness(j, j)))
      end do
   end function largest_diagonal

   module procedure place_kept
      integer :: i, c, k, place

      self%preconditioner%place(:self%active%n_active) = 0
      do k = 1, self%preconditioner%n
         place = self%active%place(self%preconditioner%coordinate(k))
         if (place > 0 .and. place <= self%active%n_active) self%preconditioner%place(place) = k
      end do
      ! Only where a law takes the balance do coordinates join and leave; no others share them.
      do k = 1, self%problem%forces%n_laws
         associate (p => self%problem%forces%entry(k)%law%prediction, &
                    row => self%problem%forces%entry(k)%row)
            if (.not. p%takes_balance) cycle
            do i = 1, size(row, 2)
               if (.not. p%takes(i)) cycle
               do c = 1, size(row, 1)
                  if (row(c, i) == 0) cycle
                  place = self%active%place(self%problem%incidence%coordinate_of(row(c, i)))
                  if (place > 0) self%preconditioner%unknown_stiffness(place) = p%stiffness(i, c)
               end do
            end do
         end associate
      end do
   end procedure place_kept

   !> So it does while few coordinates have left the active ones or joined them.
   module procedure preconditioner_fits
      integer :: n_known

      preconditioner_fits = self%preconditioner%n > 0 .and. .not. allocated(self%shift) .and. &
                            abs(self%preconditioner%alteration - self%alteration) <= 0.0_wp
      if (.not. preconditioner_fits) return
      n_known = count(self%preconditioner%place(:self%active%n_active) > 0)
      ! Those that joined, n_active - n_known, and those that left, n - n_known.
      preconditioner_fits = self%active%n_active + self%preconditioner%n - 2*n_known &
                            <= most_changed*self%active%n_active
   end procedure preconditioner_fits

   !> Mean over cosine and sine of a block of a transposed derivative, as a complex factor.
   !> A factor r + i s of uc - i us is the block [r s; -s r] of (uc, us). Of all factors the nearest
   !> to a block (sum of squares) is r = (G_cc + G_ss)/2, s = (G_cs - G_sc)/2, G_cs being what the
   !> sine of the input does to the cosine of the output.
   module procedure mean_block

      if (harmonic == 0) then
         mean = cmplx(block(input, output), kind=wp)
      else
         mean = 0.5_wp*cmplx(block(input, output) + block(input + 1, output + 1), &
                             block(input + 1, output) - block(input, output + 1), wp)
      end if
   end procedure mean_block

   !> Add scale B^T G_mean (eps B d - B A) of the elements of a law, in one harmonic.
   subroutine add_mean_forces(self, entry, work, h, scale, stiffness, m)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: h
      real(wp), intent(in) :: scale
      complex(wp), intent(in) :: stiffness(:, :)
      complex(sp), intent(inout) :: m(:, :)
      integer :: i, c_out, c_in, k, nc
      complex(wp) :: mean

      k = self%problem%fourier%column(h)
      nc = self%problem%fourier%n_coefficients
      do i = 1, size(entry%row, 2)
         if (work%linear_state(i) == pair_open) cycle
         do c_out = 1, size(entry%row, 1)
            if (entry%row(c_out, i) == 0) cycle
            do c_in = 1, size(entry%row, 1)
               if (entry%row(c_in, i) == 0) cycle
               if (work%linear_state(i) == pair_mixed) then
                  mean = mean_block(work%jacobian(:, :, i), self%problem%fourier%harmonic(h), &
                                    (c_in - 1)*nc + k, (c_out - 1)*nc + k)
               else
                  ! Stuck: each direction transmits what is predicted for it, and nothing else.
                  if (c_in /= c_out) cycle
                  mean = one
               end if
               call add_rows(self, entry, h, i, c_out, c_in, work%linear_rests(i), &
                             scale*mean, stiffness, m)
            end do
         end do
      end do
   end subroutine add_mean_forces

   !> m(out, :) = m(out, :) + mean (k d e_in - A(in, :)), without A where the balance is not taken.
   subroutine add_rows(self, entry, h, element, c_out, c_in, rests, mean, stiffness, m)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: h, element, c_out, c_in
      logical, intent(in) :: rests
      complex(wp), intent(in) :: mean
      complex(wp), intent(in) :: stiffness(:, :)
      complex(sp), intent(inout) :: m(:, :)
      integer :: p_out, p_in, n
      complex(wp) :: factor

      associate (p => entry%law%prediction, row => entry%row(:, element), &
                 na => self%active%n_active)
         ! d/dtau is a factor i n of the complex coefficient uc - i us.
         n = self%problem%fourier%harmonic(h)
         factor = one
         if (p%order_of(element, c_in) > 0) then
            factor = cmplx(0.0_wp, self%rate_unit(p, element)*n, wp)
         end if
         ! A pair at rest takes its mean position, not the rate of it, which is zero.
         if (n == 0 .and. rests) factor = one
         if (p%has_inertia) then
            factor = factor*p%impedance_ratio(element, c_in, n, self%frequency())
         end if
         if (p%takes(element)) then
            p_out = self%active%place(self%problem%incidence%coordinate_of(row(c_out)))
            p_in = self%active%place(self%problem%incidence%coordinate_of(row(c_in)))
            if (p_in > 0 .and. p_out > 0 .and. p_out <= na) then
               call subtract_row(na, mean, stiffness(p_in, :), m(p_out, :))
            end if
         end if
         call self%problem%incidence%add_mapped_block(row(c_out), row(c_in), h, &
                                                      self%active%place, na, &
                                              p%stiffness(element, c_in)*factor*mean, m)
      end associate
   end subroutine add_rows

   !> row = row - factor other.
   pure subroutine subtract_row(n, factor, other, row)
      integer, intent(in) :: n
      complex(wp), intent(in) :: factor, other(:)
      complex(sp), intent(inout) :: row(:)

      row(:n) = cmplx(row(:n) - factor*other(:n), kind=sp)
   end subroutine subtract_row

   module procedure precondition
      integer :: h, k, na

      na = self%active%n_active
      if (self%preconditioner%is_split) then
         call solve_split(self, na, vector)
         return
      end if
      call active_to_complex(self, na, vector)
      if (self%problem%structure%n_coordinates < coordinates_for_threads) then
         do h = 1, self%problem%fourier%n_retained
            if (h /= self%preconditioner%left_out) call solve_harmonic(self, h)
         end do
      else
         !$omp parallel do default(none) shared(self) private(h)
         do h = 1, self%problem%fourier%n_retained
            if (h /= self%preconditioner%left_out) call solve_harmonic(self, h)
         end do
         !$omp end parallel do
      end if
      do h = 1, self%problem%fourier%n_retained
         k = self%problem%fourier%column(h)
         vector((k - 1)*na + 1:k*na) = real(self%scratch%complex_in(:na, h), wp)
         if (self%problem%fourier%harmonic(h) > 0) vector(k*na + 1:(k + 1)*na) &
            = -aimag(self%scratch%complex_in(:na, h))
      end do
   end procedure precondition

   module procedure precondition_columns
      integer :: h, j, last

      associate (kept => self%preconditioner, nc => self%problem%fourier%n_coefficients, &
                 nh => self%problem%fourier%n_retained, na => self%active%n_active)
         ! At once only with factors that know every coordinate, of each harmonic or of all.
         if (by_waves(self) .or. .not. knows_all(self)) then
            do j = 1, size(columns, 2)
               call self%precondition(columns(:, j))
            end do
            return
         end if
         h = 1
         do while (h <= nh)
            last = h
            ! All but harmonic 0 share a matrix.
            if (kept%is_split .and. self%problem%fourier%harmonic(h) > 0) last = nh
            call solve_columns(self, na, nc, size(columns, 2), h, last, columns)
            h = last + 1
         end do
      end associate
   end procedure precondition_columns

   !> Whether the factors are those of the active coordinates, in all harmonics.
   pure logical function knows_all(self)
      class(balance_state), intent(in) :: self
      integer :: k

      knows_all = self%preconditioner%left_out == 0 .and. &
                  self%preconditioner%n == self%active%n_active
      if (.not. knows_all) return
      do k = 1, self%active%n_active
         if (self%preconditioner%place(k) /= k) knows_all = .false.
      end do
   end function knows_all

   !> Harmonics first to last, which share a matrix, with all right-hand sides.
   subroutine solve_columns(self, na, nc, n_columns, first, last, columns)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: na, nc, n_columns, first, last
      real(wp), intent(inout) :: columns(na, nc, n_columns)
      complex(sp), allocatable :: b(:, :)
      real(wp), allocatable :: largest(:)
      real(wp) :: scale
      integer :: h, i, j, k, place
      logical :: has_sine

      allocate (b(na, n_columns*(last - first + 1)), largest(n_columns))
      do j = 1, n_columns
         ! Single precision ends at 1e38: the entries are brought to the order of one before.
         largest(j) = maxval(abs(columns(:, :, j)))
         if (.not. largest(j) > 0.0_wp) largest(j) = 1.0_wp
      end do
      do h = first, last
         k = self%problem%fourier%column(h)
         has_sine = self%problem%fourier%harmonic(h) > 0
         do j = 1, n_columns
            place = (h - first)*n_columns + j
            do i = 1, na
               b(i, place) = cmplx(columns(i, k, j)/largest(j), kind=sp)
            end do
            if (.not. has_sine) cycle
            do i = 1, na
               b(i, place) = cmplx(real(b(i, place)), -columns(i, k + 1, j)/largest(j), kind=sp)
            end do
         end do
      end do
      if (self%preconditioner%is_split) then
         call self%preconditioner%split%solve_alike(self%problem%fourier%harmonic(first) == 0, &
                                                    first, n_columns, b)
         scale = self%preconditioner%split%moving%scale
      else
         call self%preconditioner%harmonic(first)%solve_scaled(size(b, 2), b)
         scale = self%preconditioner%harmonic(first)%scale
      end if
      do h = first, last
         k = self%problem%fourier%column(h)
         has_sine = self%problem%fourier%harmonic(h) > 0
         do j = 1, n_columns
            place = (h - first)*n_columns + j
            columns(:, k, j) = scale*largest(j)*real(b(:, place), wp)
            if (has_sine) columns(:, k + 1, j) = -scale*largest(j)*real(aimag(b(:, place)), wp)
         end do
      end do
   end subroutine solve_columns

   subroutine solve_harmonic(self, h)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: h

      if (by_waves(self)) then
         call solve_waves(self, h)
      else
         call solve_kept(self, h)
      end if
   end subroutine solve_harmonic

   !> With the factors of one harmonic; coordinates that they do not know are taken as stuck.
   !> Of these the row of a stuck pair would read eps v = r: the right scale, which is all that a
   !> few coordinates need until the factors are built anew.
   subroutine solve_kept(self, h)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: h
      integer :: k

      associate (in => self%scratch%complex_in(:, h), &
                 z => self%scratch%complex_out(:self%preconditioner%n, h))
         z = zero
         do k = 1, self%active%n_active
            if (self%preconditioner%place(k) > 0) then
               z(self%preconditioner%place(k)) = in(k)
            else
               in(k) = in(k)/self%preconditioner%unknown_stiffness(k)
            end if
         end do
         call self%preconditioner%harmonic(h)%solve(z)
         do k = 1, self%active%n_active
            if (self%preconditioner%place(k) > 0) in(k) = z(self%preconditioner%place(k))
         end do
      end associate
   end subroutine solve_kept

end submodule fw_balance_preconditioner
