!> A scheme that integrates the flow of a pseudo_system step by step.
module fw_pseudo_scheme
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_kinds, only: wp
   use fw_linear_step, only: linear_step_type
   use fw_pseudo_system, only: pseudo_system
   use fw_solver_options, only: pseudo_time_options, solver_options
   implicit none (type, external)
   private

   public :: pseudo_scheme, estimate_scales

   !> Size of the unknowns and of pseudo-time in which they move.
   type :: pseudo_scales
      real(wp) :: unknown = 1.0_wp
      real(wp) :: time = 1.0_wp
   end type pseudo_scales

   type, abstract :: pseudo_scheme
      type(solver_options) :: solver
      type(pseudo_time_options) :: options
      type(pseudo_scales) :: scales
      !> Pseudo-time reached and the next step.
      real(wp) :: time = 0.0_wp
      real(wp) :: step = 0.0_wp
      !> Steps taken and refused, linear solutions behind them.
      integer :: accepted = 0
      integer :: rejected = 0
      integer :: linear_solves = 0
      !> Residual R (without a shift) at the last point (n).
      real(wp), allocatable :: r(:)
      !> Why the scheme cannot go on.
      character(:), allocatable :: message
   contains
      procedure(start_scheme), deferred :: start
      procedure(advance_scheme), deferred :: advance
      procedure :: finish
   end type pseudo_scheme

   abstract interface
      !> Begin at x; the residual there is in self%r and the scales are set.
      subroutine start_scheme(self, system, x, done)
         import :: pseudo_scheme, pseudo_system, wp
         class(pseudo_scheme), intent(inout) :: self
         class(pseudo_system), intent(inout), target :: system
         real(wp), intent(inout), contiguous, target :: x(:)
         logical, intent(out) :: done
      end subroutine start_scheme

      !> One step accepted, or none and a message. Leaves the residual in self%r and the system
      !> without a shift.
      subroutine advance_scheme(self, system, x, done)
         import :: pseudo_scheme, pseudo_system, wp
         class(pseudo_scheme), intent(inout) :: self
         class(pseudo_system), intent(inout), target :: system
         real(wp), intent(inout), contiguous, target :: x(:)
         logical, intent(out) :: done
      end subroutine advance_scheme
   end interface

   !> Accuracy of the linear solution behind the scales.
   real(wp), parameter :: rough = 0.1_wp

contains

   !> Release what a scheme holds outside Fortran: nothing by default.
   subroutine finish(self)
      class(pseudo_scheme), intent(inout) :: self

      associate (self => self)
      end associate
   end subroutine finish

   !> The unknowns from the guess and Newton's step from there, since the guess may be zero; the
   !> time in which the flow, at its present rate, would go as far as that step.
   subroutine estimate_scales(system, linear, x, r, scales)
      class(pseudo_system), intent(inout) :: system
      integer, intent(in) :: linear
      !> The point and its residual (n), the system being there.
      real(wp), intent(in), contiguous :: x(:), r(:)
      type(pseudo_scales), intent(out) :: scales
      type(linear_step_type) :: newton
      real(wp), allocatable :: step(:), rate(:)
      real(wp) :: length, speed
      logical :: done

      allocate (step(system%n))
      rate = r
      newton%kind = linear
      call newton%solve(system, r, rough, step, done)
      length = 0.0_wp
      if (done) length = norm2(step)
      if (.not. ieee_is_finite(length)) length = 0.0_wp
      call system%flow_solve(rate)
      speed = norm2(rate)
      scales%unknown = (length + norm2(x))/sqrt(real(max(1, system%n), wp))
      if (.not. scales%unknown > 0.0_wp) scales%unknown = 1.0_wp
      if (length <= 0.0_wp) length = norm2(x)
      if (length > 0.0_wp .and. speed > 0.0_wp) scales%time = length/speed
   end subroutine estimate_scales

end module fw_pseudo_scheme
