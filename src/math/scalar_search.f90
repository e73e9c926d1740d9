!> A root and a largest value of a function of one variable, which may fail.
module fw_scalar_search
   use fw_error, only: error_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: function_of_one, find_root, find_largest

   !> An object in place of a procedure within another, which would need an executable stack.
   type, abstract :: function_of_one
   contains
      procedure(value_at), deferred :: at
   end type function_of_one

   abstract interface
      subroutine value_at(self, x, value, error)
         import :: error_type, function_of_one, wp
         implicit none (type, external)
         class(function_of_one), intent(inout) :: self
         real(wp), intent(in) :: x
         real(wp), intent(out) :: value
         type(error_type), allocatable, intent(out) :: error
      end subroutine value_at
   end interface

   !> Roots are found to this part of themselves, maxima to the root of the round-off of the height.
   real(wp), parameter :: root_accuracy = 1.0e-12_wp, maximum_accuracy = 1.0e-8_wp
   integer, parameter :: most_steps = 100
   real(wp), parameter :: golden = 0.3819660112501051_wp

contains

   !> By the Illinois variant of regula falsi, and by halves where it is slow.
   subroutine find_root(f, ends, values, root, error)
      !> Evaluated a few times; a failure ends the search.
      class(function_of_one), intent(inout) :: f
      !> Of an interval, with values of opposite signs.
      real(wp), intent(in) :: ends(2), values(2)
      !> Between the ends.
      real(wp), intent(out) :: root
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: a, b, fa, fb, value
      integer :: i

      a = ends(1)
      b = ends(2)
      fa = values(1)
      fb = values(2)
      root = merge(a, b, abs(fa) <= abs(fb))
      if (.not. min(abs(fa), abs(fb)) > 0.0_wp) return
      do i = 1, most_steps
         root = b - fb*(b - a)/(fb - fa)
         if (mod(i, 4) == 0) root = 0.5_wp*(a + b)
         call f%at(root, value, error)
         if (allocated(error)) return
         if (.not. abs(value) > 0.0_wp) return
         if (value*fb < 0.0_wp) then
            a = b
            fa = fb
         else
            fa = 0.5_wp*fa
         end if
         b = root
         fb = value
         if (abs(b - a) <= root_accuracy*abs(root) .or. &
             abs(value) <= root_accuracy*abs(values(1) - values(2))) return
      end do
   end subroutine find_root

   !> By Brent's parabolas and golden sections: Algorithms for Minimization without Derivatives,
   !> 1973, chapter 5.
   subroutine find_largest(f, ends, height, place, error)
      !> Evaluated some ten times.
      class(function_of_one), intent(inout) :: f
      !> Of an interval, and a place inside that is higher than both.
      real(wp), intent(in) :: ends(3), height
      !> Of the largest value that was seen.
      real(wp), intent(out) :: place
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: a, b, d, e, fu, fv, fw, fx, m, p, q, r, tolerance, u, v, w, x
      integer :: i

      a = ends(1)
      b = ends(3)
      x = ends(2)
      w = x
      v = x
      fx = -height
      fw = fx
      fv = fx
      d = 0.0_wp
      e = 0.0_wp
      do i = 1, most_steps
         m = 0.5_wp*(a + b)
         tolerance = maximum_accuracy*abs(x)
         if (abs(x - m) <= 2.0_wp*tolerance - 0.5_wp*(b - a)) exit
         p = 0.0_wp
         q = 0.0_wp
         r = 0.0_wp
         if (abs(e) > tolerance) then
            r = (x - w)*(fx - fv)
            q = (x - v)*(fx - fw)
            p = (x - v)*q - (x - w)*r
            q = 2.0_wp*(q - r)
            if (q > 0.0_wp) p = -p
            q = abs(q)
            r = e
            e = d
         end if
         if (abs(p) < abs(0.5_wp*q*r) .and. p > q*(a - x) .and. p < q*(b - x)) then
            d = p/q
            u = x + d
            if (min(u - a, b - u) < 2.0_wp*tolerance) d = sign(tolerance, m - x)
         else
            e = merge(b, a, x < m) - x
            d = golden*e
         end if
         u = x + merge(d, sign(tolerance, d), abs(d) >= tolerance)
         call f%at(u, fu, error)
         if (allocated(error)) exit
         fu = -fu
         if (fu <= fx) then
            if (u < x) then
               b = x
            else
               a = x
            end if
            v = w
            fv = fw
            w = x
            fw = fx
            x = u
            fx = fu
         else
            if (u < x) then
               a = u
            else
               b = u
            end if
            if (fu <= fw .or. .not. abs(w - x) > 0.0_wp) then
               v = w
               fv = fw
               w = u
               fw = fu
            else if (fu <= fv .or. .not. abs(v - x) > 0.0_wp .or. .not. abs(v - w) > 0.0_wp) then
               v = u
               fv = fu
            end if
         end if
      end do
      place = x
   end subroutine find_largest

end module fw_scalar_search
