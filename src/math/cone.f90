!> The point of a cone that is nearest to a given one: x >= 0 for which |A x - b| is least, by the
!> active set of Lawson and Hanson. For few rows: no more columns than rows are above zero.
module fw_cone
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: nearest_in_cone, rank_of

   !> Part of a column that counts as independent of others, and round-off of a residual.
   real(wp), parameter :: independent = 1.0e-10_wp, round_off = 1.0e-12_wp

contains

   !> What is left of b, |A x - b| / |b| of rows and columns scaled to 1; 0 of a point of the cone.
   pure subroutine nearest_in_cone(a, b, left)
      !> (m, n), (m).
      real(wp), intent(in) :: a(:, :), b(:)
      real(wp), intent(out) :: left
      real(wp) :: scaled(size(a, 1), size(a, 2)), point(size(b)), x(size(a, 2)), trial(size(a, 2))
      real(wp) :: gain(size(a, 2)), rest(size(b)), step
      logical :: is_in(size(a, 2)), is_spent(size(a, 2))
      integer :: i, j, round

      scaled = a
      point = b
      do i = 1, size(b)
         associate (largest => maxval([abs(a(i, :)), 0.0_wp]))
            if (largest <= 0.0_wp) cycle
            scaled(i, :) = scaled(i, :)/largest
            point(i) = point(i)/largest
         end associate
      end do
      left = 0.0_wp
      if (norm2(point) <= 0.0_wp) return
      point = point/norm2(point)
      do j = 1, size(a, 2)
         if (norm2(scaled(:, j)) > 0.0_wp) scaled(:, j) = scaled(:, j)/norm2(scaled(:, j))
      end do
      x = 0.0_wp
      is_in = .false.
      is_spent = .false.
      ! Each round takes a column in, or gives one up.
      do round = 1, 10*size(a, 2) + 10
         rest = point - matmul(scaled, x)
         gain = matmul(rest, scaled)
         where (is_in .or. is_spent) gain = 0.0_wp
         j = maxloc([gain, 0.0_wp], dim=1)
         if (j > size(gain)) exit
         if (gain(j) <= round_off) exit
         is_in(j) = .true.
         if (rank_of(scaled(:, pack([(i, i=1, size(x))], is_in))) < count(is_in)) then
            is_in(j) = .false.
            is_spent(j) = .true.
            cycle
         end if
         do
            call fit(scaled, point, is_in, trial)
            if (all(trial > 0.0_wp .or. .not. is_in)) exit
            step = minval(x/merge(x - trial, 1.0_wp, is_in .and. trial <= 0.0_wp), &
                          mask=is_in .and. trial <= 0.0_wp)
            x = x + step*(trial - x)
            where (is_in .and. trial <= 0.0_wp .and. x <= round_off)
               is_in = .false.
               x = 0.0_wp
            end where
            if (.not. any(is_in)) exit
         end do
         x = merge(trial, 0.0_wp, is_in)
         is_spent = .false.
      end do
      left = norm2(point - matmul(scaled, x))
   end subroutine nearest_in_cone

   !> Least squares in the columns that are in, which are independent.
   pure subroutine fit(a, b, is_in, x)
      real(wp), intent(in) :: a(:, :), b(:)
      logical, intent(in) :: is_in(:)
      real(wp), intent(out) :: x(:)
      real(wp) :: q(size(a, 1), count(is_in)), r(count(is_in), count(is_in)), y(count(is_in))
      integer :: i, j, turn
      integer :: column(count(is_in))

      column = pack([(i, i=1, size(x))], is_in)
      r = 0.0_wp
      do j = 1, size(column)
         q(:, j) = a(:, column(j))
         do turn = 1, 2
            do i = 1, j - 1
               associate (part => dot_product(q(:, i), q(:, j)))
                  r(i, j) = r(i, j) + part
                  q(:, j) = q(:, j) - part*q(:, i)
               end associate
            end do
         end do
         r(j, j) = norm2(q(:, j))
         q(:, j) = q(:, j)/r(j, j)
      end do
      y = matmul(b, q)
      do j = size(column), 1, -1
         y(j) = (y(j) - dot_product(r(j, j + 1:), y(j + 1:)))/r(j, j)
      end do
      x = 0.0_wp
      x(column) = y
   end subroutine fit

   !> Independent columns.
   pure integer function rank_of(columns) result(rank)
      real(wp), intent(in) :: columns(:, :)
      real(wp) :: q(size(columns, 1), size(columns, 2)), rest(size(columns, 1))
      integer :: i, j, turn

      rank = 0
      do j = 1, size(columns, 2)
         rest = columns(:, j)
         do turn = 1, 2
            do i = 1, rank
               rest = rest - dot_product(q(:, i), rest)*q(:, i)
            end do
         end do
         if (norm2(rest) <= independent*norm2(columns(:, j))) cycle
         if (rank == size(columns, 1)) return
         rank = rank + 1
         q(:, rank) = rest/norm2(rest)
      end do
   end function rank_of

end module fw_cone
