!> Relative coordinates of a cyclic structure: rows of pairs and springs across sectors, with the
!> same coordinate numbers in all nodal diameters. Which rows are independent depends on the nodal
!> diameter: between a dof and itself in the next sector the row (1 - z) u vanishes where all
!> sectors move alike.
module fw_cyclic_relative
   use fw_cyclic_data, only: cyclic_type
   use fw_divisor, only: common_divisor
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_relative, only: relative_type
   use fw_sector, only: sector_rows
   use fw_sector_relative, only: new_sector_relative, sector_relative
   use fw_side, only: largest_weight
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
      procedure :: lay_out_all
      procedure :: weights
      procedure :: between
      procedure :: first_dependent
   end type cyclic_relative

   !> A row as a combination of coordinates: their numbers in a sector, how many sectors behind that
   !> of the row these are, and the weights.
   type :: ring_row
      integer, allocatable :: coordinate(:), behind(:)
      real(wp), allocatable :: weight(:)
   end type ring_row

contains

   subroutine new_cyclic_relative(model, side_1, side_2, sector_2, self, others)
      type(model_type), intent(in) :: model
      !> Signed dofs and rows of the model, 0 for the ground, and the sector of the second (n_rows).
      integer, intent(in) :: side_1(:), side_2(:), sector_2(:)
      type(cyclic_relative), intent(out) :: self
      !> Rows of all dofs behind them (n_others, n_dof).
      real(wp), intent(in), optional :: others(:, :)
      complex(wp), allocatable :: rows(:, :)
      real(wp), allocatable :: scale(:)
      logical, allocatable :: is_coordinate(:)
      integer :: k, r, step

      self%n_rows = size(side_1)
      if (present(others)) self%n_rows = self%n_rows + size(others, 1)
      allocate (is_coordinate(self%n_rows))
      allocate (scale(self%n_rows), source=1.0_wp)
      do r = 1, size(side_1)
         scale(r) = max(largest_weight(side_1(r), model%rows), &
                        largest_weight(side_2(r), model%rows))
      end do
      associate (n => model%cyclic%n_sectors)
         allocate (self%at(n/2 + 1))
         do k = 0, n/2
            call sector_rows(model, k, side_1, side_2, sector_2, rows, others)
            call new_sector_relative(rows, self%at(k + 1), scale)
         end do
         ! The wave has the multiples of gcd(N, EO), whatever its harmonics: numbers of coordinates
         ! do not depend on these.
         step = common_divisor(n, modulo(model%cyclic%engine_order, n))
         if (model%cyclic%is_mistuned) step = 1
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
            weight(:, h) = self%weights(cyclic%nodal_diameter(harmonic(h)), r)
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

   !> Rows of all sectors as combinations of the coordinates of all, which stand sector after
   !> sector: a row that is a coordinate in every nodal diameter is that of its sector, any other
   !> takes part of those of other sectors too,
   !>
   !>   w(j - l) = 1/N sum_k W_k z_k**(j - l).
   subroutine lay_out_all(self, cyclic, row, sector, relative)
      class(cyclic_relative), intent(in) :: self
      type(cyclic_type), intent(in) :: cyclic
      !> Which row of which sector each is, from 1 and from 0 (rows of all sectors).
      integer, intent(in) :: row(:), sector(:)
      type(relative_type), intent(inout) :: relative
      type(ring_row) :: entries(self%n_rows)
      integer :: first, last, r

      do r = 1, self%n_rows
         call spread_row(self, cyclic, r, entries(r))
      end do
      relative%n_rows = size(row)
      relative%n_coordinates = cyclic%n_sectors*self%n_coordinates
      relative%independent = self%coordinate(row) > 0
      if (allocated(relative%row_start)) deallocate (relative%row_start, relative%row_coordinate, &
                                                     relative%row_weight)
      allocate (relative%row_start(size(row) + 1))
      relative%row_start(1) = 1
      do r = 1, size(row)
         relative%row_start(r + 1) = relative%row_start(r) + size(entries(row(r))%weight)
      end do
      last = relative%row_start(size(row) + 1) - 1
      allocate (relative%row_coordinate(last), relative%row_weight(last))
      do r = 1, size(row)
         first = relative%row_start(r)
         last = relative%row_start(r + 1) - 1
         associate (e => entries(row(r)))
            relative%row_weight(first:last) = e%weight
            relative%row_coordinate(first:last) = e%coordinate + self%n_coordinates* &
                                                  modulo(sector(r) - e%behind, cyclic%n_sectors)
         end associate
      end do
   end subroutine lay_out_all

   !> One row between the sectors; that of its own coordinate comes first.
   subroutine spread_row(self, cyclic, row, entries)
      type(cyclic_relative), intent(in) :: self
      type(cyclic_type), intent(in) :: cyclic
      integer, intent(in) :: row
      type(ring_row), intent(out) :: entries
      real(wp), parameter :: negligible = 1.0e-12_wp
      real(wp) :: weight(self%n_coordinates, 0:cyclic%n_sectors - 1)
      logical :: is_there(self%n_coordinates, 0:cyclic%n_sectors - 1)
      integer :: d, j, k

      weight = 0.0_wp
      associate (n => cyclic%n_sectors)
         do d = 0, n - 1
            do k = 0, n - 1
               weight(:, d) = weight(:, d) + real(cyclic%factor(k, d)* &
                                                  self%weights(merge(k - n, k, 2*k > n), row), wp)/n
            end do
         end do
         is_there = abs(weight) > negligible
         allocate (entries%coordinate(0), entries%behind(0), entries%weight(0))
         if (self%coordinate(row) > 0) call append(self%coordinate(row), 0)
         do d = 0, n - 1
            do j = 1, self%n_coordinates
               if (is_there(j, d)) call append(j, d)
            end do
         end do
      end associate

   contains

      subroutine append(j, d)
         integer, intent(in) :: j, d

         entries%coordinate = [entries%coordinate, j]
         entries%behind = [entries%behind, d]
         entries%weight = [entries%weight, weight(j, d)]
         is_there(j, d) = .false.
      end subroutine append

   end subroutine spread_row

   !> A row of a sector as a combination of coordinates: which of a sector, how many sectors behind,
   !> and their weights.
   subroutine between(self, cyclic, row, slot, behind, weight)
      class(cyclic_relative), intent(in) :: self
      type(cyclic_type), intent(in) :: cyclic
      integer, intent(in) :: row
      integer, allocatable, intent(out) :: slot(:), behind(:)
      real(wp), allocatable, intent(out) :: weight(:)
      type(ring_row) :: entries

      call spread_row(self, cyclic, row, entries)
      slot = entries%coordinate
      behind = entries%behind
      weight = entries%weight
   end subroutine between

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
   pure function weights(self, k, row) result(weight)
      class(cyclic_relative), intent(in) :: self
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
   end function weights

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

end module fw_cyclic_relative
