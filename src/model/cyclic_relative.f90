!> Relative coordinates of a cyclic structure: rows of pairs and springs across sectors, with the
!> same coordinate numbers in all nodal diameters. Which rows are independent depends on the nodal
!> diameter: between a dof and itself in the next sector the row (1 - z) u vanishes where all
!> sectors move alike.
module fw_cyclic_relative
   use fw_cyclic_data, only: cyclic_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_relative, only: relative_type
   use fw_sector, only: sector_rows
   use fw_sector_relative, only: new_sector_relative
   use fw_sector_relative, only: sector_relative
   implicit none (type, external)
   private

   public :: cyclic_relative, new_cyclic_relative

   type :: cyclic_relative
      integer :: n_rows = 0
      !> Coordinates that some nodal diameter of the wave has.
      integer :: n_coordinates = 0
      !> The coordinate that a row is, 0 where it depends on others in all of them (n_rows).
      integer, allocatable :: coordinate(:)
      !> Of nodal diameter k at place k + 1, k = 0 .. N/2.
      type(sector_relative), allocatable :: at(:)
   contains
      procedure :: slots
      procedure :: lay_out
      procedure :: first_dependent
   end type cyclic_relative

contains

   subroutine new_cyclic_relative(model, side_1, side_2, sector_2, self)
      type(model_type), intent(in) :: model
      !> Signed dofs of the rows, 0 for the ground, and the sector of the second (n_rows).
      integer, intent(in) :: side_1(:), side_2(:), sector_2(:)
      type(cyclic_relative), intent(out) :: self
      complex(wp), allocatable :: rows(:, :)
      logical :: is_coordinate(size(side_1))
      integer :: k, r, step

      self%n_rows = size(side_1)
      associate (n => model%cyclic%n_sectors)
         allocate (self%at(n/2 + 1))
         do k = 0, n/2
            call sector_rows(model, k, side_1, side_2, sector_2, rows)
            call new_sector_relative(rows, self%at(k + 1))
         end do
         ! The wave has the multiples of gcd(N, EO), whatever its harmonics: numbers of coordinates
         ! do not depend on these.
         step = common_divisor(n, modulo(model%cyclic%engine_order, n))
         is_coordinate = .false.
         do k = 0, n/2, step
            is_coordinate(self%at(k + 1)%row) = .true.
         end do
      end associate
      allocate (self%coordinate(self%n_rows), source=0)
      do r = 1, self%n_rows
         if (.not. is_coordinate(r)) cycle
         self%n_coordinates = self%n_coordinates + 1
         self%coordinate(r) = self%n_coordinates
      end do
   end subroutine new_cyclic_relative

   !> Places of the coordinates of nodal diameter k among those of all; 0 for one that the wave does
   !> not have.
   pure function slots(self, k) result(slot)
      class(cyclic_relative), intent(in) :: self
      integer, intent(in) :: k
      integer, allocatable :: slot(:)

      slot = self%coordinate(self%at(k + 1)%row)
   end function slots

   !> The rows as combinations of the coordinates, in the form that real rows have: weights that
   !> differ from harmonic to harmonic stand in `turned`.
   subroutine lay_out(self, cyclic, harmonic, relative)
      class(cyclic_relative), intent(in) :: self
      type(cyclic_type), intent(in) :: cyclic
      !> Harmonics in use.
      integer, intent(in) :: harmonic(:)
      type(relative_type), intent(inout) :: relative
      complex(wp) :: weight(self%n_coordinates, size(harmonic))
      complex(wp), allocatable :: turned(:, :), longer(:, :)
      integer :: h, j, n, r

      relative%n_rows = self%n_rows
      relative%n_coordinates = self%n_coordinates
      if (allocated(relative%row_start)) deallocate (relative%row_start, relative%row_coordinate, &
                                                     relative%row_weight, relative%independent)
      allocate (relative%row_start(self%n_rows + 1), relative%independent(self%n_rows))
      allocate (relative%row_coordinate(0), relative%row_weight(0))
      allocate (turned(0, size(harmonic)))
      relative%independent = self%coordinate > 0
      relative%row_start(1) = 1
      do r = 1, self%n_rows
         do h = 1, size(harmonic)
            weight(:, h) = row_of(self, cyclic%nodal_diameter(harmonic(h)), r)
         end do
         do j = 1, self%n_coordinates
            ! A row that is a coordinate begins with that.
            if (all(abs(weight(j, :)) <= 0.0_wp) .and. j /= self%coordinate(r)) cycle
            n = size(relative%row_coordinate)
            relative%row_coordinate = [relative%row_coordinate, j]
            relative%row_weight = [relative%row_weight, 1.0_wp]
            allocate (longer(n + 1, size(harmonic)))
            longer(:n, :) = turned
            longer(n + 1, :) = weight(j, :)
            call move_alloc(longer, turned)
         end do
         relative%row_start(r + 1) = size(relative%row_coordinate) + 1
         call put_first(relative, turned, r, self%coordinate(r))
      end do
      if (allocated(relative%turned)) deallocate (relative%turned)
      if (all(abs(turned - 1.0_wp) <= 0.0_wp)) return
      call move_alloc(turned, relative%turned)
   end subroutine lay_out

   !> Bring the entry of a coordinate to the front of its row.
   pure subroutine put_first(relative, turned, row, coordinate)
      type(relative_type), intent(inout) :: relative
      complex(wp), intent(inout) :: turned(:, :)
      integer, intent(in) :: row, coordinate
      integer :: e, first

      first = relative%row_start(row)
      do e = first + 1, relative%row_start(row + 1) - 1
         if (relative%row_coordinate(e) /= coordinate) cycle
         relative%row_coordinate([first, e]) = relative%row_coordinate([e, first])
         turned([first, e], :) = turned([e, first], :)
      end do
   end subroutine put_first

   !> Weights of a row in a signed nodal diameter, among the coordinates of all.
   pure function row_of(self, k, row) result(weight)
      type(cyclic_relative), intent(in) :: self
      integer, intent(in) :: k, row
      complex(wp) :: weight(self%n_coordinates)
      integer :: j

      weight = (0.0_wp, 0.0_wp)
      associate (at => self%at(abs(k) + 1))
         do j = 1, size(at%row)
            if (self%coordinate(at%row(j)) == 0) cycle
            weight(self%coordinate(at%row(j))) = at%weight(row, j)
         end do
      end associate
      if (k < 0) weight = conjg(weight)
   end function row_of

   !> The first of some rows that depends on earlier ones in a nodal diameter; 0 for none.
   pure integer function first_dependent(self, k, is_asked) result(row)
      class(cyclic_relative), intent(in) :: self
      integer, intent(in) :: k
      !> (n_rows).
      logical, intent(in) :: is_asked(:)

      do row = 1, self%n_rows
         if (is_asked(row) .and. all(self%at(abs(k) + 1)%row /= row)) return
      end do
      row = 0
   end function first_dependent

   !> Euclid's; 0 and n have n.
   pure integer function common_divisor(a, b) result(divisor)
      integer, intent(in) :: a, b
      integer :: other, rest

      divisor = a
      other = b
      do while (other > 0)
         rest = modulo(divisor, other)
         divisor = other
         other = rest
      end do
   end function common_divisor

end module fw_cyclic_relative
