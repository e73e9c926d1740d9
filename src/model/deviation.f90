!> What one sector has beside the others: matrices of each sector on rows that all of them share,
!>
!>   dK_j = B^T K_j B,   dM_j = B^T M_j B,   dC_j = B^T C_j B,   j = 0 .. N - 1,
!>
!> with few rows B, whatever the deviation was given by. The matrices are sums of terms, a value
!> times a matrix on the rows each, so that the scale of all may change, and derivatives by a value
!> are known. A further kind of deviation is one more call of `add`.
module fw_deviation
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: deviation_type, stiffness_part, mass_part, damping_part
   public :: of_frequency, of_damping, of_stiffness, of_mass, of_scale, of_sector

   !> Which matrix of a sector.
   integer, parameter :: stiffness_part = 1, mass_part = 2, damping_part = 3

   !> What a value is: of frequencies, damping ratios, stiffness or mass of the blades, the scale of
   !> all, or of the matrix of a sector, by which nothing is derived.
   integer, parameter :: of_frequency = 1, of_damping = 2, of_stiffness = 3, of_mass = 4, &
                         of_scale = 5, of_sector = 6

   !> f(s, value) weight a a^T, or a matrix in place of a a^T; with the scale s, f is
   !> (1 + s value)**2 - 1 of a frequency and s value of all else.
   type :: deviation_term
      integer :: of = of_sector, part = stiffness_part
      !> From 1.
      integer :: sector = 1
      real(wp) :: value = 1.0_wp, weight = 1.0_wp
      !> (r) or (r, r).
      real(wp), allocatable :: along(:), matrix(:, :)
   end type deviation_term

   !> By how much sectors differ from the tuned one, as the user gives it.
   type :: deviation_type
      !> B (r, n_dof).
      real(wp), allocatable :: rows(:, :)
      !> K_j, M_j and C_j (r, r, n_sectors, 3).
      real(wp), allocatable :: part(:, :, :, :)
      real(wp), private :: scale = 1.0_wp
      !> The first n_terms of them.
      type(deviation_term), allocatable, private :: term(:)
      integer, private :: n_terms = 0
   contains
      procedure :: start
      procedure :: add_rows
      procedure :: add_range
      procedure :: settle
      procedure :: bring_to_rows
      procedure :: add
      procedure :: set_scale
      procedure :: values_of
      procedure :: change
   end type deviation_type

   !> Parts of a row, and of a matrix, that are round-off.
   real(wp), parameter :: dependent = 1.0e-10_wp, round_off = 1.0e-13_wp

contains

   pure subroutine start(self, n_dof)
      class(deviation_type), intent(inout) :: self
      !> Of a sector.
      integer, intent(in) :: n_dof

      if (allocated(self%rows)) deallocate (self%rows)
      allocate (self%rows(0, n_dof))
   end subroutine start

   !> Rows that deviations act on.
   pure subroutine add_rows(self, rows)
      class(deviation_type), intent(inout) :: self
      !> (n_rows, n_dof)
      real(wp), intent(in) :: rows(:, :)
      real(wp) :: row(size(rows, 2)), size_of_row
      integer :: i

      do i = 1, size(rows, 1)
         row = rows(i, :)
         size_of_row = norm2(row)
         if (size_of_row <= 0.0_wp) cycle
         call append(self, row, dependent*size_of_row)
      end do
   end subroutine add_rows

   !> What is left of a row beside those that there are, made a row where it is no round-off.
   pure subroutine append(self, row, limit)
      class(deviation_type), intent(inout) :: self
      !> (n_dof)
      real(wp), intent(inout) :: row(:)
      !> Length up to which what is left is round-off.
      real(wp), intent(in) :: limit
      real(wp), allocatable :: longer(:, :)
      integer :: pass, r

      r = size(self%rows, 1)
      ! Twice is enough.
      do pass = 1, 2
         row = row - matmul(matmul(self%rows, row), self%rows)
      end do
      if (norm2(row) <= limit) return
      allocate (longer(r + 1, size(row)))
      longer(:r, :) = self%rows
      longer(r + 1, :) = row/norm2(row)
      call move_alloc(longer, self%rows)
   end subroutine append

   !> Rows that a symmetric matrix acts on.
   pure subroutine add_range(self, matrix, size_of_tuned)
      class(deviation_type), intent(inout) :: self
      !> Symmetric (n_dof, n_dof).
      real(wp), intent(in) :: matrix(:, :)
      !> Of the matrices whose difference it is; 0 of one that was given.
      real(wp), intent(in) :: size_of_tuned
      real(wp), allocatable :: left(:, :)
      real(wp) :: limit, squares(size(matrix, 2)), row(size(matrix, 2))
      integer :: j, r

      limit = max(round_off*sqrt(maxval(sum(matrix**2, dim=1))), &
                  4.0_wp*epsilon(1.0_wp)*size_of_tuned)
      left = matrix - matmul(transpose(self%rows), matmul(self%rows, matrix))
      do
         squares = sum(left**2, dim=1)
         j = maxloc(squares, dim=1)
         if (sqrt(squares(j)) <= limit) exit
         r = size(self%rows, 1)
         row = left(:, j)
         call append(self, row, 0.5_wp*limit)
         if (size(self%rows, 1) == r) then
            left(:, j) = 0.0_wp
            cycle
         end if
         row = self%rows(r + 1, :)
         call deflate(row, left)
      end do
   end subroutine add_range

   !> Take off what acts on a row.
   pure subroutine deflate(row, left)
      !> Of unit length (n_dof).
      real(wp), intent(in) :: row(:)
      !> The matrix, without what acts on rows that there are (n_dof, n_dof).
      real(wp), intent(inout) :: left(:, :)
      real(wp) :: along(size(left, 2))
      integer :: j

      along = matmul(row, left)
      do j = 1, size(left, 2)
         left(:, j) = left(:, j) - along(j)*row
      end do
   end subroutine deflate

   !> All rows are there: those of single dofs where they say as much. Nothing deviates yet.
   pure subroutine settle(self, n_sectors)
      class(deviation_type), intent(inout) :: self
      !> N.
      integer, intent(in) :: n_sectors
      integer, allocatable :: touched(:)
      integer :: i, n

      n = size(self%rows, 2)
      touched = pack([(i, i=1, n)], any(abs(self%rows) > 0.0_wp, dim=1))
      if (size(touched) <= size(self%rows, 1)) then
         deallocate (self%rows)
         allocate (self%rows(size(touched), n), source=0.0_wp)
         do i = 1, size(touched)
            self%rows(i, touched(i)) = 1.0_wp
         end do
      end if
      n = size(self%rows, 1)
      if (allocated(self%part)) deallocate (self%part)
      allocate (self%part(n, n, n_sectors, 3), source=0.0_wp)
      if (allocated(self%term)) deallocate (self%term)
      allocate (self%term(n_sectors))
      self%n_terms = 0
   end subroutine settle

   !> A symmetric matrix, which acts on the rows alone, on them (r, r).
   pure subroutine bring_to_rows(self, matrix, on_rows)
      class(deviation_type), intent(in) :: self
      !> (n_dof, n_dof)
      real(wp), intent(in) :: matrix(:, :)
      real(wp), allocatable, intent(out) :: on_rows(:, :)

      on_rows = matmul(self%rows, matmul(matrix, transpose(self%rows)))
   end subroutine bring_to_rows

   !> One value of a sector, on a row of dofs that lies in the rows that there are, or with a matrix
   !> on these. Values of a kind come sector after sector.
   pure subroutine add(self, of, part, sector, value, weight, row, matrix)
      class(deviation_type), intent(inout) :: self
      !> of_frequency, ..; stiffness_part, mass_part or damping_part; the sector from 0.
      integer, intent(in) :: of, part, sector
      real(wp), intent(in) :: value, weight
      !> (n_dof) or (r, r).
      real(wp), intent(in), optional :: row(:), matrix(:, :)
      type(deviation_term), allocatable :: longer(:)
      integer :: k

      if (self%n_terms == size(self%term)) then
         allocate (longer(2*self%n_terms))
         do k = 1, self%n_terms
            longer(k) = self%term(k)
         end do
         call move_alloc(longer, self%term)
      end if
      self%n_terms = self%n_terms + 1
      associate (term => self%term(self%n_terms))
         term%of = of
         term%part = part
         term%sector = sector + 1
         term%value = value
         term%weight = weight
         if (present(row)) term%along = matmul(self%rows, row)
         if (present(matrix)) term%matrix = matrix
      end associate
   end subroutine add

   !> The matrices with another factor of all values.
   pure subroutine set_scale(self, scale)
      class(deviation_type), intent(inout) :: self
      real(wp), intent(in) :: scale
      integer :: k

      self%scale = scale
      self%part = 0.0_wp
      do k = 1, self%n_terms
         associate (term => self%term(k))
            if (term%of == of_frequency) then
               call add_term(term, scale*term%value*(2.0_wp + scale*term%value), self%part)
            else
               call add_term(term, scale*term%value, self%part)
            end if
         end associate
      end do
   end subroutine set_scale

   !> Add a term with a factor to the matrices.
   pure subroutine add_term(term, factor, part)
      type(deviation_term), intent(in) :: term
      real(wp), intent(in) :: factor
      !> (r, r, n_sectors, 3)
      real(wp), intent(inout) :: part(:, :, :, :)
      integer :: b

      associate (own => part(:, :, term%sector, term%part))
         if (allocated(term%matrix)) own = own + factor*term%weight*term%matrix
         if (.not. allocated(term%along)) return
         do b = 1, size(own, 2)
            own(:, b) = own(:, b) + factor*term%weight*term%along(b)*term%along
         end do
      end associate
   end subroutine add_term

   !> Values of a kind, sector after sector; none where none were given.
   pure function values_of(self, of) result(values)
      class(deviation_type), intent(in) :: self
      integer, intent(in) :: of
      real(wp), allocatable :: values(:)

      values = [self%scale]
      if (of /= of_scale) values = pack(self%term(:self%n_terms)%value, &
                                        self%term(:self%n_terms)%of == of)
   end function values_of

   !> Derivative of all matrices by the number-th value of a kind, or by the scale.
   pure subroutine change(self, of, number, part)
      class(deviation_type), intent(in) :: self
      integer, intent(in) :: of, number
      !> (r, r, n_sectors, 3)
      real(wp), intent(out) :: part(:, :, :, :)
      integer :: k, n_found

      part = 0.0_wp
      n_found = 0
      do k = 1, self%n_terms
         associate (term => self%term(k), s => self%scale)
            if (of == of_scale) then
               call add_term(term, term%value*merge(2.0_wp*(1.0_wp + s*term%value), 1.0_wp, &
                                                    term%of == of_frequency), part)
            else if (term%of == of) then
               n_found = n_found + 1
               if (n_found == number) call add_term( &
                  term, s*merge(2.0_wp*(1.0_wp + s*term%value), 1.0_wp, of == of_frequency), part)
            end if
         end associate
      end do
   end subroutine change

end module fw_deviation
