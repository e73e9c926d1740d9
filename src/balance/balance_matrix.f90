!> The matrix of the linear problem of a Newton step, for problems that LU solves: the columns of a
!> harmonic at a time, and a law with all of them by one matrix product. Where every law is a
!> function of displacements its blocks have their places in the matrix, and nothing is multiplied.
submodule(fw_balance_state:fw_balance_linear) fw_balance_matrix
   use fw_lapack, only: dgemm
   implicit none (type, external)

   !> Room for the columns of a harmonic.
   type :: column_room
      !> Rows in use of the products with all that is not a law with the balance
      !> (n_used, n_coefficients, column).
      real(wp), allocatable :: rows(:, :, :)
      !> Z_n (n_used, n_active).
      complex(wp), allocatable :: stiffness(:, :)
      !> Of one element (coefficient and component, column), and a unit vector.
      real(wp), allocatable :: inputs(:, :), outputs(:, :), unit(:, :)
   end type column_room

contains

   module procedure assemble
      type(column_room) :: room
      integer :: h, k, n_columns, n_inputs

      call self%form_jacobians()
      if (places_blocks(self)) then
         call place_blocks(self, matrix)
         return
      end if
      n_inputs = 0
      do k = 1, self%problem%forces%n_laws
         n_inputs = max(n_inputs, size(self%work(k)%input, 1))
      end do
      associate (na => self%active%n_active, nc => self%problem%fourier%n_coefficients)
         n_columns = 2*na
         allocate (room%rows(self%active%n_used, nc, n_columns))
         allocate (room%stiffness(self%active%n_used, na), room%unit(na, nc))
         allocate (room%inputs(n_inputs, n_columns), room%outputs(n_inputs, n_columns))
         room%unit = 0.0_wp
      end associate
      do h = 1, self%problem%fourier%n_retained
         call assemble_harmonic(self, h, room, matrix)
      end do
   end procedure assemble

   !> Whether inputs of the laws are displacements alone, with one weight in all harmonics.
   pure logical function places_blocks(self)
      type(balance_state), intent(in) :: self
      integer :: k

      places_blocks = .not. self%problem%incidence%turns()
      do k = 1, self%problem%forces%n_laws
         ! A case without pairs has a law of pairs all the same.
         if (self%problem%forces%entry(k)%law%n_elements == 0) cycle
         associate (p => self%problem%forces%entry(k)%law%prediction)
            if (p%takes_balance .or. p%has_inertia .or. any(p%order > 0)) places_blocks = .false.
         end associate
      end do
   end function places_blocks

   !> The structure harmonic by harmonic, then the laws element by element.
   subroutine place_blocks(self, matrix)
      type(balance_state), intent(in) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      complex(wp) :: stiffness(self%active%n_active, self%active%n_active)
      integer :: h, i, k, na, nc

      na = self%active%n_active
      nc = self%problem%fourier%n_coefficients
      matrix(:na*nc, :na*nc) = 0.0_wp
      do h = 1, self%problem%fourier%n_retained
         i = (self%problem%fourier%column(h) - 1)*na
         call self%problem%structure%active_block(self%structure_state, h, stiffness)
         if (allocated(self%shift)) stiffness = stiffness + self%shift(:na, :na, h)
         call place_harmonic(na, self%problem%fourier%harmonic(h) == 0, stiffness, i, matrix)
      end do
      do k = 1, self%problem%forces%n_laws
         associate (entry => self%problem%forces%entry(k), work => self%work(k))
            do i = 1, size(entry%row, 2)
               if (work%linear_state(i) == pair_open) cycle
               call place_element(self, entry, work, i, matrix)
            end do
         end associate
      end do
   end subroutine place_blocks

   !> A complex block as the real one of cosine and sine: (uc, us) of uc - i us.
   pure subroutine place_harmonic(n, is_constant, block, first, matrix)
      integer, intent(in) :: n
      logical, intent(in) :: is_constant
      complex(wp), intent(in) :: block(n, n)
      !> Rows and columns before those of the harmonic.
      integer, intent(in) :: first
      real(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: i, j

      do j = 1, n
         do i = 1, n
            matrix(first + i, first + j) = real(block(i, j), wp)
            if (is_constant) cycle
            matrix(first + n + i, first + j) = -aimag(block(i, j))
            matrix(first + i, first + n + j) = aimag(block(i, j))
            matrix(first + n + i, first + n + j) = real(block(i, j), wp)
         end do
      end do
   end subroutine place_harmonic

   !> The derivative of an element, component by component; one that sticks has G = 1.
   subroutine place_element(self, entry, work, element, matrix)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: element
      real(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: c, d, na, nc

      na = self%active%n_active
      nc = self%problem%fourier%n_coefficients
      do d = 1, size(entry%row, 1)
         if (entry%row(d, element) == 0) cycle
         associate (stiffness => entry%law%prediction%stiffness(element, d), &
                    row_in => entry%row(d, element))
            if (work%linear_state(element) /= pair_mixed) then
               call self%problem%incidence%add_diagonal(row_in, self%active%place, na, nc, &
                                                        stiffness, size(matrix, 1), matrix)
               cycle
            end if
            do c = 1, size(entry%row, 1)
               if (entry%row(c, element) == 0) cycle
               call self%problem%incidence%add_coefficients( &
                  entry%row(c, element), row_in, self%active%place, na, nc, stiffness, &
                  work%jacobian((d - 1)*nc + 1:d*nc, (c - 1)*nc + 1:c*nc, element), &
                  size(matrix, 1), matrix)
            end do
         end associate
      end do
   end subroutine place_element

   !> Columns of the coefficients of one harmonic: cosine (or constant), then sine.
   subroutine assemble_harmonic(self, h, room, matrix)
      type(balance_state), intent(inout) :: self
      integer, intent(in) :: h
      type(column_room), intent(inout) :: room
      real(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: first, j, k, na, nc, n_columns

      na = self%active%n_active
      nc = self%problem%fourier%n_coefficients
      n_columns = na*merge(1, 2, self%problem%fourier%harmonic(h) == 0)
      first = (self%problem%fourier%column(h) - 1)*na
      call fill_linear(self, h, room%stiffness, room%rows)
      matrix(:na*nc, first + 1:first + n_columns) = 0.0_wp
      if (allocated(self%shift)) call fill_shift(self, h, na, first, matrix)
      ! Laws with the balance come last: the rows hold all that they take then.
      do k = 1, self%problem%forces%n_laws
         call add_law(self, self%problem%forces%entry(k), self%work(k), first, n_columns, room, &
                      matrix)
      end do
      do j = 1, n_columns
         do k = 1, nc
            matrix((k - 1)*na + 1:k*na, first + j) = matrix((k - 1)*na + 1:k*na, first + j) + &
                                                     room%rows(:na, k, j)
         end do
      end do
   end subroutine assemble_harmonic

   !> Z_n as real rows: (uc, us) of uc - i us.
   subroutine fill_linear(self, h, stiffness, rows)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: h
      complex(wp), intent(out), contiguous :: stiffness(:, :)
      real(wp), intent(out) :: rows(:, :, :)
      integer :: j, k, na

      na = self%active%n_active
      k = self%problem%fourier%column(h)
      rows = 0.0_wp
      call self%problem%structure%active_block(self%structure_state, h, stiffness)
      do j = 1, na
         rows(:, k, j) = real(stiffness(:, j), wp)
         if (self%problem%fourier%harmonic(h) == 0) cycle
         rows(:, k + 1, j) = -aimag(stiffness(:, j))
         rows(:, k, na + j) = aimag(stiffness(:, j))
         rows(:, k + 1, na + j) = real(stiffness(:, j), wp)
      end do
   end subroutine fill_linear

   !> What pseudo-time adds to a harmonic, all coordinates being active.
   subroutine fill_shift(self, h, na, first, matrix)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: h, na, first
      real(wp), intent(inout) :: matrix(:, :)
      integer :: j

      do j = 1, na
         associate (shift => self%shift(:na, j, h))
            matrix(first + 1:first + na, first + j) = real(shift, wp)
            if (self%problem%fourier%harmonic(h) == 0) cycle
            matrix(first + na + 1:first + 2*na, first + j) = -aimag(shift)
            matrix(first + 1:first + na, first + na + j) = aimag(shift)
            matrix(first + na + 1:first + 2*na, first + na + j) = real(shift, wp)
         end associate
      end do
   end subroutine fill_shift

   !> Outputs of a law for all columns, element by element: into the rows, or into the matrix where
   !> the law takes the balance.
   subroutine add_law(self, entry, work, first, n_columns, room, matrix)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: first, n_columns
      type(column_room), intent(inout) :: room
      real(wp), intent(inout), contiguous :: matrix(:, :)
      integer :: i, j, na, n, place

      na = self%active%n_active
      n = size(work%input, 1)
      do i = 1, size(entry%row, 2)
         if (work%linear_state(i) == pair_open) cycle
         do j = 1, n_columns
            place = modulo(j - 1, na) + 1
            associate (one_entry => room%unit(place, first/na + (j - 1)/na + 1))
               one_entry = 1.0_wp
               call gather_inputs(self, entry, i, self%active%place, na, room%unit, &
                                  work%linear_rests(i), room%rows(:, :, j), room%inputs(:n, j))
               one_entry = 0.0_wp
            end associate
         end do
         if (work%linear_state(i) == pair_mixed) then
            call dgemm('T', 'N', n, n_columns, n, 1.0_wp, work%jacobian(1, 1, i), n, room%inputs, &
                       size(room%inputs, 1), 0.0_wp, room%outputs, size(room%outputs, 1))
         else
            room%outputs(:n, :n_columns) = room%inputs(:n, :n_columns)
         end if
         do j = 1, n_columns
            if (entry%law%prediction%takes(i)) then
               call add_rows_of(self, entry, i, room%outputs(:n, j), na, na, &
                                matrix(:, first + j))
            else
               call add_rows_of(self, entry, i, room%outputs(:n, j), self%active%n_used, &
                                size(room%rows, 1), room%rows(:, :, j))
            end if
         end do
      end do
   end subroutine add_law

   !> rows = rows + B^T outputs of an element, of the first n_mapped places.
   subroutine add_rows_of(self, entry, element, outputs, n_mapped, n_stored, rows)
      type(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      integer, intent(in) :: element, n_mapped, n_stored
      real(wp), intent(in) :: outputs(:)
      real(wp), intent(inout) :: rows(n_stored, *)
      integer :: c, nc

      nc = self%problem%fourier%n_coefficients
      do c = 1, size(entry%row, 1)
         if (entry%row(c, element) == 0) cycle
         call self%problem%incidence%scatter_row(entry%row(c, element), self%active%place, &
                                                 n_mapped, n_stored, 1.0_wp, &
                                                 outputs((c - 1)*nc + 1:c*nc), rows)
      end do
   end subroutine add_rows_of

end submodule fw_balance_matrix
