!> What sectors have beside each other, in the coordinates of all of them: rows of a sector as
!> combinations of coordinates of this one and of others, and for each harmonic the matrices
!>
!>   A_j = K_j - theta M_j + i s C_j
!>
!> on them. Their mean over the sectors belongs to every wave; what is left couples the waves.
module fw_ring_deviation
   use fw_cyclic_data, only: cyclic_type
   use fw_cyclic_relative, only: cyclic_relative
   use fw_deviation, only: damping_part, deviation_type, mass_part, stiffness_part
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: ring_deviation, new_ring_deviation

   !> Deviations of all sectors of a disk from the tuned one.
   type :: ring_deviation
      integer :: n_rows = 0, n_sectors = 0
      !> Rows as combinations: entries of row a are first(a) to first(a + 1) - 1, each a slot, the
      !> sectors that it is behind, and a weight.
      integer, allocatable, private :: first(:), slot(:), behind(:)
      real(wp), allocatable, private :: weight(:)
      !> The same rows in nodal diameters 0 .. N - 1 (n_rows, relative slots, n_sectors).
      complex(wp), allocatable :: wave(:, :, :)
      !> Of each sector.
      type(deviation_type), allocatable :: of
   contains
      procedure :: form
      procedure :: form_change
      procedure :: read_rows
      procedure :: add_rows
      procedure :: add_mean
      procedure :: add_block
   end type ring_deviation

   complex(wp), parameter :: zero = (0.0_wp, 0.0_wp)

contains

   !> The rows stand behind all others of a sector.
   subroutine new_ring_deviation(deviation, cyclic, relative, self)
      !> In dofs of a sector.
      type(deviation_type), intent(in) :: deviation
      !> How the sectors stand.
      type(cyclic_type), intent(in) :: cyclic
      !> Rows that are coordinates of all nodal diameters.
      type(cyclic_relative), intent(in) :: relative
      type(ring_deviation), intent(out) :: self
      integer, allocatable :: slot(:), behind(:)
      real(wp), allocatable :: weight(:)
      integer :: a, k, n, row

      self%n_rows = size(deviation%rows, 1)
      self%n_sectors = cyclic%n_sectors
      self%of = deviation
      n = cyclic%n_sectors
      allocate (self%first(self%n_rows + 1), source=1)
      allocate (self%slot(0), self%behind(0), self%weight(0))
      allocate (self%wave(self%n_rows, relative%n_coordinates, n))
      do a = 1, self%n_rows
         row = relative%n_rows - self%n_rows + a
         call relative%between(cyclic, row, slot, behind, weight)
         self%slot = [self%slot, slot]
         self%behind = [self%behind, behind]
         self%weight = [self%weight, weight]
         self%first(a + 1) = size(self%slot) + 1
         do k = 0, n - 1
            self%wave(a, :, k + 1) = relative%weights(merge(k - n, k, 2*k > n), row)
         end do
      end do
   end subroutine new_ring_deviation

   !> A_j of all sectors (n_rows, n_rows, n_sectors).
   pure subroutine form(self, k, theta, s, matrix)
      class(ring_deviation), intent(in) :: self
      !> Factors of the stiffness, the mass and the damping: Z = k K - theta M + i s C.
      real(wp), intent(in) :: k, s
      !> s**2 of the harmonic, with what excites itself.
      complex(wp), intent(in) :: theta
      !> (n_rows, n_rows, n_sectors)
      complex(wp), intent(out) :: matrix(:, :, :)

      call combine(self%of%part, k, theta, s, matrix)
   end subroutine form

   !> Their derivative by one of the values that they were given by.
   pure subroutine form_change(self, of, number, theta, s, matrix)
      class(ring_deviation), intent(in) :: self
      !> As in fw_deviation, and which value of the kind.
      integer, intent(in) :: of, number
      complex(wp), intent(in) :: theta
      real(wp), intent(in) :: s
      !> (n_rows, n_rows, n_sectors)
      complex(wp), intent(out) :: matrix(:, :, :)
      real(wp), allocatable :: part(:, :, :, :)

      allocate (part, mold=self%of%part)
      call self%of%change(of, number, part)
      call combine(part, 1.0_wp, theta, s, matrix)
   end subroutine form_change

   pure subroutine combine(part, k, theta, s, matrix)
      real(wp), intent(in) :: part(:, :, :, :)
      real(wp), intent(in) :: k, s
      complex(wp), intent(in) :: theta
      complex(wp), intent(out) :: matrix(:, :, :)

      matrix = k*part(:, :, :, stiffness_part) - theta*part(:, :, :, mass_part) + &
               cmplx(0.0_wp, s, wp)*part(:, :, :, damping_part)
   end subroutine combine

   !> The rows of every sector, from the coordinates of all (slot, sector).
   pure subroutine read_rows(self, sectors, rows)
      class(ring_deviation), intent(in) :: self
      !> (slot, sector)
      complex(wp), intent(in) :: sectors(:, :)
      !> (n_rows, n_sectors)
      complex(wp), intent(out) :: rows(:, :)
      integer :: a, e, j

      rows = zero
      do j = 1, self%n_sectors
         do a = 1, self%n_rows
            do e = self%first(a), self%first(a + 1) - 1
               rows(a, j) = rows(a, j) + self%weight(e)* &
                            sectors(self%slot(e), other(self, j, self%behind(e)))
            end do
         end do
      end do
   end subroutine read_rows

   !> Add what forces on the rows are to the coordinates, the transpose of `read_rows`; of their
   !> matrices where these are given.
   pure subroutine add_rows(self, rows, sectors, matrix)
      class(ring_deviation), intent(in) :: self
      !> (n_rows, n_sectors)
      complex(wp), intent(in) :: rows(:, :)
      !> (slot, sector)
      complex(wp), intent(inout) :: sectors(:, :)
      !> (n_rows, n_rows, n_sectors)
      complex(wp), intent(in), optional :: matrix(:, :, :)
      complex(wp) :: force
      integer :: a, b, e, j

      do j = 1, self%n_sectors
         do a = 1, self%n_rows
            force = rows(a, j)
            if (present(matrix)) then
               force = zero
               do b = 1, self%n_rows
                  force = force + matrix(a, b, j)*rows(b, j)
               end do
            end if
            do e = self%first(a), self%first(a + 1) - 1
               associate (to => sectors(self%slot(e), other(self, j, self%behind(e))))
                  to = to + self%weight(e)*force
               end associate
            end do
         end do
      end do
   end subroutine add_rows

   !> The mean of the matrices in every wave (slots, slots, n_sectors); it is taken off.
   pure subroutine add_mean(self, matrix, wave)
      class(ring_deviation), intent(in) :: self
      !> Of each sector; less their mean on return (n_rows, n_rows, n_sectors).
      complex(wp), intent(inout) :: matrix(:, :, :)
      !> Gains the mean.
      complex(wp), intent(inout) :: wave(:, :, :)
      complex(wp) :: mean(self%n_rows, self%n_rows)
      integer :: j, k, m

      mean = sum(matrix, dim=3)/self%n_sectors
      do j = 1, self%n_sectors
         matrix(:, :, j) = matrix(:, :, j) - mean
      end do
      m = size(self%wave, 2)
      do k = 1, self%n_sectors
         wave(:m, :m, k) = wave(:m, :m, k) + &
            matmul(conjg(transpose(self%wave(:, :, k))), matmul(mean, self%wave(:, :, k)))
      end do
   end subroutine add_mean

   !> Add them to a matrix of coordinates: row and column of each, 0 where it is not in it (slot,
   !> sector).
   pure subroutine add_block(self, matrix, row, column, block)
      class(ring_deviation), intent(in) :: self
      !> (n_rows, n_rows, n_sectors)
      complex(wp), intent(in) :: matrix(:, :, :)
      integer, intent(in) :: row(:, :), column(:, :)
      complex(wp), intent(inout) :: block(:, :)
      integer :: a, b, d, e, j
      integer :: at_column, at_row

      do j = 1, self%n_sectors
         do b = 1, self%n_rows
            do e = self%first(b), self%first(b + 1) - 1
               at_column = column(self%slot(e), other(self, j, self%behind(e)))
               if (at_column == 0) cycle
               do a = 1, self%n_rows
                  do d = self%first(a), self%first(a + 1) - 1
                     at_row = row(self%slot(d), other(self, j, self%behind(d)))
                     if (at_row == 0) cycle
                     block(at_row, at_column) = block(at_row, at_column) + &
                                                self%weight(d)*self%weight(e)*matrix(a, b, j)
                  end do
               end do
            end do
         end do
      end do
   end subroutine add_block

   !> The sector that stands so many places before another; from 1.
   pure integer function other(self, sector, behind)
      class(ring_deviation), intent(in) :: self
      integer, intent(in) :: sector, behind

      other = modulo(sector - 1 - behind, self%n_sectors) + 1
   end function other

end module fw_ring_deviation
