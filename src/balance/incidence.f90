!> Relative displacements of pairs and springs from coordinates, and their forces back:
!>
!>   u_r = B q,     r <- r + B^T f,     Z <- Z + B^T k B.
!>
!> The only loops over B are here. A row of B has few entries, one where the row itself is a
!> coordinate. Every procedure takes all coefficients of a row at once, or says which harmonic is
!> meant: weights that differ from harmonic to harmonic and are complex (sectors of a cyclic
!> structure: B^H in the place of B^T) need no other calls. Vectors are (coordinate, coefficient).
!> Fewer coefficients than all are the first of them.
!>
!> Vectors of some of the coordinates come with a map (n_coordinates): the place of each coordinate
!> in the vector. Places 0 and those beyond the vector do not count. `identity` is the map of all.
module fw_incidence
   use fw_kinds, only: sp, wp
   use fw_relative, only: relative_type
   implicit none (type, external)
   private

   public :: incidence_type, new_incidence

   type :: incidence_type
      !> Rows of B, those of the pairs before those of the springs.
      integer :: n_rows = 0
      !> The map of all coordinates: 1, 2, ..
      integer, allocatable :: identity(:)
      !> Row r is sum_e weight(e) q(coordinate(e)), e = first(r) .. first(r+1)-1.
      integer, allocatable, private :: first(:), coordinate(:)
      real(wp), allocatable, private :: weight(:)
      !> In place of them where weights turn from harmonic to harmonic (sectors of a cyclic
      !> structure): complex ones (entries, n_retained), and what the coefficients are of.
      complex(wp), allocatable, private :: turned(:, :)
      integer, allocatable, private :: harmonic(:), column(:)
   contains
      procedure :: coordinate_of
      procedure :: reaches
      procedure :: turns
      procedure :: weights_of
      procedure :: gather
      procedure :: scatter
      procedure :: gather_row
      procedure :: scatter_row
      procedure :: scatter_harmonic
      procedure :: add_block
      procedure :: add_coupling
      procedure :: add_mapped_block
      procedure :: add_coefficients
      procedure :: add_diagonal
   end type incidence_type

contains

   !> The rows of relative coordinates, in a vector of n_coordinates: these are the first of them.
   pure subroutine new_incidence(relative, n_coordinates, self, harmonic, column)
      type(relative_type), intent(in) :: relative
      integer, intent(in) :: n_coordinates
      type(incidence_type), intent(out) :: self
      !> Harmonics and the columns of their coefficients, for weights that turn (n_retained).
      integer, intent(in), optional :: harmonic(:), column(:)
      integer :: j

      self%n_rows = relative%n_rows
      self%first = relative%row_start
      self%coordinate = relative%row_coordinate
      self%weight = relative%row_weight
      if (allocated(relative%turned) .and. present(harmonic) .and. present(column)) then
         self%turned = relative%turned
         self%harmonic = harmonic
         self%column = column
      end if
      self%identity = [(j, j=1, n_coordinates)]
   end subroutine new_incidence

   !> The coordinate that a row is; of a row that depends on others, the first of its coordinates.
   pure integer function coordinate_of(self, row) result(coordinate)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row

      coordinate = self%coordinate(self%first(row))
   end function coordinate_of

   !> Whether weights turn from harmonic to harmonic.
   pure logical function turns(self)
      class(incidence_type), intent(in) :: self

      turns = allocated(self%turned)
   end function turns

   !> A row of B in full.
   pure subroutine weights_of(self, row, weights)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row
      !> Weights of all coordinates (n_coordinates).
      real(wp), intent(out) :: weights(:)
      integer :: e

      weights = 0.0_wp
      do e = self%first(row), self%first(row + 1) - 1
         weights(self%coordinate(e)) = weights(self%coordinate(e)) + self%weight(e)
      end do
   end subroutine weights_of

   !> values = B q for rows in the order given; 0 where a row is 0.
   pure subroutine gather(self, rows, n_coordinates, n_columns, q, values)
      class(incidence_type), intent(in) :: self
      !> Numbers of rows, 0 for none.
      integer, intent(in) :: rows(:)
      integer, intent(in) :: n_coordinates, n_columns
      real(wp), intent(in) :: q(n_coordinates, n_columns)
      real(wp), intent(out) :: values(size(rows), n_columns)
      integer :: i, e, k

      if (allocated(self%turned)) then
         values = 0.0_wp
         do i = 1, size(rows)
            if (rows(i) == 0) cycle
            do e = self%first(rows(i)), self%first(rows(i) + 1) - 1
               call add_turned(self, e, .false., n_columns, 1.0_wp, q(self%coordinate(e), :), &
                               values(i, :))
            end do
         end do
         return
      end if
      do k = 1, n_columns
         do i = 1, size(rows)
            values(i, k) = 0.0_wp
            if (rows(i) == 0) cycle
            do e = self%first(rows(i)), self%first(rows(i) + 1) - 1
               values(i, k) = values(i, k) + self%weight(e)*q(self%coordinate(e), k)
            end do
         end do
      end do
   end subroutine gather

   !> q = q + factor B^T values.
   pure subroutine scatter(self, rows, n_coordinates, n_columns, factor, values, q)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: rows(:)
      integer, intent(in) :: n_coordinates, n_columns
      real(wp), intent(in) :: factor
      real(wp), intent(in) :: values(size(rows), n_columns)
      real(wp), intent(inout) :: q(n_coordinates, n_columns)
      integer :: i, e, k

      if (allocated(self%turned)) then
         do i = 1, size(rows)
            if (rows(i) == 0) cycle
            do e = self%first(rows(i)), self%first(rows(i) + 1) - 1
               call add_turned(self, e, .true., n_columns, factor, values(i, :), &
                               q(self%coordinate(e), :))
            end do
         end do
         return
      end if
      do k = 1, n_columns
         do i = 1, size(rows)
            if (rows(i) == 0) cycle
            do e = self%first(rows(i)), self%first(rows(i) + 1) - 1
               ! Added, not set: rows may share coordinates.
               q(self%coordinate(e), k) = q(self%coordinate(e), k) + &
                                          factor*self%weight(e)*values(i, k)
            end do
         end do
      end do
   end subroutine scatter

   !> Whether a row has a coordinate with a place in a vector.
   pure logical function reaches(self, row, map, n_mapped)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      integer :: e

      reaches = .false.
      do e = self%first(row), self%first(row + 1) - 1
         associate (place => map(self%coordinate(e)))
            reaches = reaches .or. (place > 0 .and. place <= n_mapped)
         end associate
      end do
   end function reaches

   !> values = factor B q for one row and the first size(values) coefficients.
   pure subroutine gather_row(self, row, map, n_mapped, factor, q, values)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row
      !> Place of each coordinate in q, see the module header (n_coordinates).
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      real(wp), intent(in) :: factor
      real(wp), intent(in) :: q(n_mapped, *)
      real(wp), intent(out), contiguous :: values(:)
      real(wp) :: weight
      integer :: e, k, place

      values = 0.0_wp
      do e = self%first(row), self%first(row + 1) - 1
         place = map(self%coordinate(e))
         if (place == 0 .or. place > n_mapped) cycle
         if (allocated(self%turned)) then
            call add_turned(self, e, .false., size(values), factor, q(place, :size(values)), values)
            cycle
         end if
         ! The same for all coefficients: the product is taken from the left.
         weight = factor*self%weight(e)
         do k = 1, size(values)
            values(k) = values(k) + weight*q(place, k)
         end do
      end do
   end subroutine gather_row

   !> q = q + factor B^T values for one row and the first size(values) coefficients. Memory of q
   !> may have more rows (n_stored) than there are places.
   pure subroutine scatter_row(self, row, map, n_mapped, n_stored, factor, values, q)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped, n_stored
      real(wp), intent(in) :: factor
      real(wp), intent(in) :: values(:)
      real(wp), intent(inout) :: q(n_stored, *)
      real(wp) :: weight
      integer :: e, k, place

      do e = self%first(row), self%first(row + 1) - 1
         place = map(self%coordinate(e))
         if (place == 0 .or. place > n_mapped) cycle
         if (allocated(self%turned)) then
            call add_turned(self, e, .true., size(values), factor, values, q(place, :size(values)))
            cycle
         end if
         weight = factor*self%weight(e)
         do k = 1, size(values)
            q(place, k) = q(place, k) + weight*values(k)
         end do
      end do
   end subroutine scatter_row

   !> q = q + B_n^H value for one row, complex amplitudes of harmonic h.
   pure subroutine scatter_harmonic(self, row, h, value, q)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row, h
      complex(wp), intent(in) :: value
      complex(wp), intent(inout) :: q(:)
      integer :: e

      do e = self%first(row), self%first(row + 1) - 1
         q(self%coordinate(e)) = q(self%coordinate(e)) + &
                                 conjg(harmonic_weight(self, e, h))*value
      end do
   end subroutine scatter_harmonic

   !> matrix = matrix + B_n^H k B_n for one row and harmonic h.
   pure subroutine add_block(self, row, h, stiffness, matrix)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row, h
      complex(wp), intent(in) :: stiffness
      !> Block of the harmonic (n_coordinates, n_coordinates).
      complex(wp), intent(inout) :: matrix(:, :)
      integer :: e, f

      do f = self%first(row), self%first(row + 1) - 1
         do e = self%first(row), self%first(row + 1) - 1
            associate (entry => matrix(self%coordinate(e), self%coordinate(f)))
               entry = entry + conjg(harmonic_weight(self, e, h))*harmonic_weight(self, f, h)* &
                       stiffness
            end associate
         end do
      end do
   end subroutine add_block

   !> matrix = matrix + B_n^H k B_n with the rows of an output and of an input.
   pure subroutine add_coupling(self, row_out, row_in, h, stiffness, matrix)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row_out, row_in, h
      complex(wp), intent(in) :: stiffness
      complex(wp), intent(inout) :: matrix(:, :)
      integer :: e, f

      do f = self%first(row_in), self%first(row_in + 1) - 1
         do e = self%first(row_out), self%first(row_out + 1) - 1
            associate (entry => matrix(self%coordinate(e), self%coordinate(f)))
               entry = entry + conjg(harmonic_weight(self, e, h))*harmonic_weight(self, f, h)* &
                       stiffness
            end associate
         end do
      end do
   end subroutine add_coupling

   !> matrix = matrix + B_n^H k B_n with the rows of an output and of an input, both mapped.
   !> In single precision: the matrix is that of the preconditioner.
   pure subroutine add_mapped_block(self, row_out, row_in, h, map, n_mapped, stiffness, matrix)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row_out, row_in, h
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped
      complex(wp), intent(in) :: stiffness
      !> Block of the harmonic, n_mapped rows and columns of it.
      complex(sp), intent(inout) :: matrix(:, :)
      integer :: e, f, i, j

      do f = self%first(row_in), self%first(row_in + 1) - 1
         j = map(self%coordinate(f))
         if (j == 0 .or. j > n_mapped) cycle
         do e = self%first(row_out), self%first(row_out + 1) - 1
            i = map(self%coordinate(e))
            if (i == 0 .or. i > n_mapped) cycle
            matrix(i, j) = matrix(i, j) + cmplx(conjg(harmonic_weight(self, e, h))* &
                                                harmonic_weight(self, f, h)*stiffness, kind=sp)
         end do
      end do
   end subroutine add_mapped_block

   !> matrix = matrix + B^T G k B with the rows of an output and of an input, both mapped, for
   !> weights that do not turn.
   pure subroutine add_coefficients(self, row_out, row_in, map, n_mapped, n, stiffness, gain, &
                                    n_stored, matrix)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row_out, row_in
      integer, intent(in) :: map(:)
      !> Places of a coefficient, coefficients, and rows that memory of the matrix has.
      integer, intent(in) :: n_mapped, n, n_stored
      real(wp), intent(in) :: stiffness
      !> (coefficient of the input, of the output)
      real(wp), intent(in) :: gain(:, :)
      !> (place, coefficient) both ways: places innermost.
      real(wp), intent(inout) :: matrix(n_stored, *)
      real(wp) :: weight
      integer :: e, f, i, j, place_in, place_out

      do f = self%first(row_in), self%first(row_in + 1) - 1
         place_in = map(self%coordinate(f))
         if (place_in == 0 .or. place_in > n_mapped) cycle
         do e = self%first(row_out), self%first(row_out + 1) - 1
            place_out = map(self%coordinate(e))
            if (place_out == 0 .or. place_out > n_mapped) cycle
            weight = self%weight(e)*self%weight(f)*stiffness
            do i = 1, n
               do j = 1, n
                  associate (entry => matrix((j - 1)*n_mapped + place_out, &
                                             (i - 1)*n_mapped + place_in))
                     entry = entry + weight*gain(i, j)
                  end associate
               end do
            end do
         end do
      end do
   end subroutine add_coefficients

   !> The same of a row that sticks: G = 1.
   pure subroutine add_diagonal(self, row, map, n_mapped, n, stiffness, n_stored, matrix)
      class(incidence_type), intent(in) :: self
      integer, intent(in) :: row
      integer, intent(in) :: map(:)
      integer, intent(in) :: n_mapped, n, n_stored
      real(wp), intent(in) :: stiffness
      real(wp), intent(inout) :: matrix(n_stored, *)
      integer :: e, f, i, place_in, place_out

      do f = self%first(row), self%first(row + 1) - 1
         place_in = map(self%coordinate(f))
         if (place_in == 0 .or. place_in > n_mapped) cycle
         do e = self%first(row), self%first(row + 1) - 1
            place_out = map(self%coordinate(e))
            if (place_out == 0 .or. place_out > n_mapped) cycle
            do i = 0, (n - 1)*n_mapped, n_mapped
               matrix(i + place_out, i + place_in) = matrix(i + place_out, i + place_in) &
                                                     + self%weight(e)*self%weight(f)*stiffness
            end do
         end do
      end do
   end subroutine add_diagonal

   !> target = target + factor w source of one entry, or its conjugate weight, coefficient by
   !> coefficient: w (uc - i us) is the complex amplitude.
   pure subroutine add_turned(self, e, conjugated, n_columns, factor, source, target)
      type(incidence_type), intent(in) :: self
      integer, intent(in) :: e
      logical, intent(in) :: conjugated
      integer, intent(in) :: n_columns
      real(wp), intent(in) :: factor
      real(wp), intent(in) :: source(:)
      real(wp), intent(inout) :: target(:)
      real(wp) :: a, b
      integer :: h, k

      do h = 1, size(self%harmonic)
         k = self%column(h)
         if (k > n_columns) exit
         a = factor*real(self%turned(e, h), wp)
         if (self%harmonic(h) == 0) then
            target(k) = target(k) + a*source(k)
            cycle
         end if
         b = factor*aimag(self%turned(e, h))
         if (conjugated) b = -b
         target(k) = target(k) + a*source(k) + b*source(k + 1)
         target(k + 1) = target(k + 1) + a*source(k + 1) - b*source(k)
      end do
   end subroutine add_turned

   !> Weight of an entry in a harmonic: the same real one in all, or one that turns.
   pure complex(wp) function harmonic_weight(self, e, h) result(weight)
      type(incidence_type), intent(in) :: self
      integer, intent(in) :: e, h

      if (allocated(self%turned)) then
         weight = self%turned(e, h)
      else
         weight = cmplx(self%weight(e), kind=wp)
      end if
   end function harmonic_weight

end module fw_incidence
