!> A system with further unknowns z and as many conditions,
!>
!>   R(q, z) = 0,    g(q, z) = 0,    [ R_q  R_z ] [ dq ]     [ R ]
!>                                   [ g_q  g_z ] [ dz ] = - [ g ] ,
!>
!> such as depths of wear with their growth, or the parameter of a curve with the plane across it.
!> The inner system is only pointed at: others may solve it by itself at a held z. An extension says
!> what z is to the inner system, and the conditions; the unknowns are q, then z.
!>
!> What the inner system solves by itself leaves the linear problem here as well, and so may further
!> unknowns that follow from their own condition. GMRES is helped by the preconditioner M of the
!> inner system, bordered:
!>
!>   [ M  R_z; g_q  g_z ]  through the complement  g_z - g_q M^-1 R_z,  of the order of z.
!>
!> Where that is singular M helps alone and dz is left as it is: what is regular all the same is
!> solved, more slowly, and what is not is a step that fails, with numbers in it.
module fw_augmented_system
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_parameter_system, only: parameter_system
   use fw_tall_product, only: subtract_product
   implicit none (type, external)
   private

   public :: augmented_system

   type, abstract, extends(parameter_system) :: augmented_system
      class(parameter_system), pointer :: inner => null()
      !> Further unknowns, and how many of them stay in the linear problem.
      integer :: n_extra = 0
      integer :: n_linear_extra = 0
      !> Residuals are compared to `reference` as it is, not to that of the inner system, which may
      !> change with the further unknowns.
      logical :: holds_reference = .false.
      !> Unknowns of the inner system in the linear problem.
      integer :: n_linear_inner = 0
      !> Preconditioner: M^-1 R_z (n_linear_inner, n_linear_extra), factors of the complement.
      real(wp), allocatable, private :: columns(:, :)
      type(lu_type), private :: complement
      logical, private :: is_bordered = .false.
      !> Whether the inner system offered what is nearly right when this one was made of it.
      logical, private :: offers_nearly = .false.
      !> Precision that was asked of the last product of the linear problem; 0 before the first.
      real(wp) :: last_asked = 0.0_wp
      !> Scratch (n_extra), (inner%n).
      real(wp), allocatable, private :: unit(:), adjusted(:)
      !> The two parts of a vector (inner%n, 1), (n_extra, 1).
      real(wp), allocatable, private :: inner_part(:, :), extra_part(:, :)
   contains
      procedure :: augment
      procedure :: offer_nearly
      procedure(bring_to_extra), deferred :: take
      procedure(evaluate_conditions), deferred :: conditions
      procedure(choose_linear), deferred :: choose
      procedure(settle_first), deferred :: settle
      procedure(reduce_conditions), deferred :: reduce_rows
      procedure :: expand_extra
      procedure(multiply_columns), deferred :: add_columns
      procedure(multiply_rows), deferred :: rows
      procedure(multiply_rows_roughly), deferred :: subtract_rows
      procedure(fill_corner), deferred :: corner
      procedure :: set_parameter
      procedure :: parameter_derivative
      procedure :: residual
      procedure :: linearize
      procedure :: reduce
      procedure :: expand
      procedure :: apply
      procedure :: build_preconditioner
      procedure :: strengthen_preconditioner => strengthen_inner
      procedure :: preconditioner_fits
      procedure :: precondition
      procedure :: assemble
   end type augmented_system

   abstract interface
      !> Bring the inner system to further unknowns z (n_extra); an error is one that it cannot be
      !> brought to.
      subroutine bring_to_extra(self, z, error)
         import :: augmented_system, wp, error_type
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(in) :: z(:)
         type(error_type), allocatable, intent(out) :: error
      end subroutine bring_to_extra

      !> g(q, z), where the inner system was evaluated last (n_extra).
      subroutine evaluate_conditions(self, q, z, g)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(in) :: q(:), z(:)
         real(wp), intent(out) :: g(:)
      end subroutine evaluate_conditions

      !> Linearize the inner system, and choose which of the further unknowns stay in the linear
      !> problem: n_linear_inner, n_linear_extra.
      subroutine choose_linear(self)
         import :: augmented_system
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
      end subroutine choose_linear

      !> r = r + R_z dz for rows of the inner system that leave the linear problem, with dz of what
      !> left it and follows from g, and of what stays in it.
      subroutine settle_first(self, g, dz, r)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         !> (n_extra), (n_linear_extra), (inner%n)
         real(wp), intent(in) :: g(:), dz(:)
         real(wp), intent(inout), contiguous :: r(:)
      end subroutine settle_first

      !> Right-hand sides of the conditions, -g - g_q dq with the steps dq that the inner system
      !> solves at once: its `reduce` was called last, with r.
      subroutine reduce_conditions(self, r, g, rhs)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: r(:), g(:)
         real(wp), intent(out), contiguous :: rhs(:)
      end subroutine reduce_conditions

      !> product = product + R_z dz, rows of the linear problem.
      subroutine multiply_columns(self, dz, product)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(in) :: dz(:)
         real(wp), intent(inout), contiguous :: product(:)
      end subroutine multiply_columns

      !> product = g_q v + g_z dz; the inner system has multiplied v just before.
      subroutine multiply_rows(self, v, dz, product)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(in), contiguous :: v(:), dz(:)
         real(wp), intent(out), contiguous :: product(:)
      end subroutine multiply_rows

      !> rows = rows - g_q v, as well as the preconditioner needs it. Several v at once are those
      !> of its construction, for which a matrix may be formed.
      subroutine multiply_rows_roughly(self, v, rows, is_built)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         !> (n_linear_inner, n), (n_linear_extra, n)
         real(wp), intent(in), contiguous :: v(:, :)
         real(wp), intent(inout) :: rows(:, :)
         !> False while the preconditioner is built.
         logical, intent(in) :: is_built
      end subroutine multiply_rows_roughly

      !> matrix = g_z (n_linear_extra, n_linear_extra).
      subroutine fill_corner(self, matrix)
         import :: augmented_system, wp
         implicit none (type, external)
         class(augmented_system), intent(inout) :: self
         real(wp), intent(out) :: matrix(:, :)
      end subroutine fill_corner
   end interface

   !> Residual, over the reference, where the inner system cannot be brought: who makes a trial step
   !> there cuts it short.
   real(wp), parameter :: out_of_reach = 1.0e30_wp

contains

   !> Put n_extra unknowns beside those of a system, which has to live as long as this one.
   subroutine augment(self, inner, n_extra)
      class(augmented_system), intent(inout) :: self
      class(parameter_system), intent(in), target :: inner
      integer, intent(in) :: n_extra

      self%inner => inner
      self%n_extra = n_extra
      self%n = inner%n + n_extra
      self%reference = inner%reference
      self%reduced = inner%reduced
      self%offers_nearly = inner%nearly
      self%nearly = inner%nearly
      self%interrupt => inner%interrupt
      if (allocated(self%unit)) deallocate (self%unit, self%adjusted, self%inner_part, &
                                            self%extra_part)
      allocate (self%unit(n_extra), self%adjusted(inner%n), source=0.0_wp)
      allocate (self%inner_part(inner%n, 1), self%extra_part(n_extra, 1), source=0.0_wp)
   end subroutine augment

   !> The parameter is that of the inner system, unless an extension says otherwise.
   subroutine set_parameter(self, parameter, error)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error

      call self%inner%set_parameter(parameter, error)
      self%reference = self%inner%reference
   end subroutine set_parameter

   !> The conditions do not depend on the parameter, unless an extension says otherwise.
   subroutine parameter_derivative(self, x, dr)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: dr(:)
      integer :: n

      n = self%inner%n
      call self%inner%parameter_derivative(x(:n), dr(:n))
      dr(n + 1:) = 0.0_wp
   end subroutine parameter_derivative

   !> R and g at (q, z). A z that the inner system cannot be brought to has a residual that every
   !> line search turns back from.
   subroutine residual(self, x, r)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: r(:)
      type(error_type), allocatable :: error
      integer :: n

      n = self%inner%n
      call self%take(x(n + 1:), error)
      if (allocated(error)) then
         r = out_of_reach*self%reference
         return
      end if
      call self%inner%residual(x(:n), r(:n))
      call self%conditions(x(:n), x(n + 1:), r(n + 1:))
      if (.not. self%holds_reference) self%reference = self%inner%reference
   end subroutine residual

   subroutine linearize(self, n_linear)
      class(augmented_system), intent(inout) :: self
      integer, intent(out) :: n_linear
      logical :: reduced

      ! Derivatives that products are to read nearly are taken as the inner system is linearized.
      self%inner%nearly = self%nearly
      ! Who solves the inner system by itself finds it as it was.
      reduced = self%inner%reduced
      self%inner%reduced = self%reduced
      call self%choose()
      self%inner%reduced = reduced
      self%last_asked = 0.0_wp
      n_linear = self%n_linear_inner + self%n_linear_extra
   end subroutine linearize

   !> Right-hand sides of what stays: what leaves the problem is settled first, inside and among z.
   subroutine reduce(self, r, rhs)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:)
      real(wp), intent(out), contiguous :: rhs(:)
      integer :: k, n

      n = self%inner%n
      k = self%n_linear_inner
      self%adjusted = r(:n)
      self%unit = 0.0_wp
      call self%settle(r(n + 1:), self%unit(:self%n_linear_extra), self%adjusted)
      self%inner%asked = self%asked
      call self%inner%reduce(self%adjusted, rhs(:k))
      self%inner%asked = 0.0_wp
      call self%reduce_rows(self%adjusted, r(n + 1:), rhs(k + 1:))
   end subroutine reduce

   !> Steps of all unknowns from those of the linear problem, in the same order.
   subroutine expand(self, r, solution, step)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: r(:), solution(:)
      real(wp), intent(out), contiguous :: step(:)
      integer :: k, n

      n = self%inner%n
      k = self%n_linear_inner
      self%adjusted = r(:n)
      call self%settle(r(n + 1:), solution(k + 1:), self%adjusted)
      call self%inner%expand(self%adjusted, solution(:k), step(:n))
      call self%expand_extra(r(n + 1:), solution(:k), solution(k + 1:), step(n + 1:))
   end subroutine expand

   !> Steps of all further unknowns from those in the linear problem; where some leave it, an
   !> extension knows theirs.
   subroutine expand_extra(self, g, v, solution, dz)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in) :: g(:), solution(:)
      !> Steps of the inner system in the linear problem, which was reduced last.
      real(wp), intent(in), contiguous :: v(:)
      real(wp), intent(out) :: dz(:)

      associate (unused => self, unused_conditions => g, unused_step => v)
      end associate
      dz = solution
   end subroutine expand_extra

   !> [R_q v + R_z dz; g_q v + g_z dz]. The rows g come first: they read what the inner product
   !> has just left.
   subroutine apply(self, vector, product)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: k

      k = self%n_linear_inner
      call pass_precision(self)
      call self%inner%apply(vector(:k), product(:k))
      self%inner%asked = 0.0_wp
      if (self%n_linear_extra == 0) return
      call self%rows(vector(:k), vector(k + 1:), product(k + 1:))
      call self%add_columns(vector(k + 1:), product(:k))
   end subroutine apply

   !> Take up again what is nearly right, after a solution that failed with it: who takes steps
   !> says where another kind of problem begins.
   subroutine offer_nearly(self)
      class(augmented_system), intent(inout) :: self

      self%nearly = self%offers_nearly
      self%inner%nearly = self%offers_nearly
   end subroutine offer_nearly

   !> The solution that asks for products is the one of this system: its precision, and whether it
   !> may rest on what is nearly right, hold inside as well.
   subroutine pass_precision(self)
      class(augmented_system), intent(inout) :: self

      self%inner%asked = self%asked
      self%inner%nearly = self%nearly
      if (self%asked > 0.0_wp) self%last_asked = self%asked
   end subroutine pass_precision

   subroutine strengthen_inner(self, is_stronger)
      class(augmented_system), intent(inout) :: self
      logical, intent(out) :: is_stronger

      call self%inner%strengthen_preconditioner(is_stronger)
   end subroutine strengthen_inner

   !> M, its solutions M^-1 R_z, one for each further unknown, and the complement.
   subroutine build_preconditioner(self)
      class(augmented_system), intent(inout) :: self
      logical :: singular
      integer :: j, n

      call pass_precision(self)
      call self%inner%build_preconditioner()
      self%inner%asked = 0.0_wp
      n = self%n_linear_extra
      if (n == 0) return
      call reserve_columns(self)
      call self%complement%reserve(n)
      call self%corner(self%complement%matrix(:n, :n))
      do j = 1, n
         self%columns(:, j) = 0.0_wp
         self%unit = 0.0_wp
         self%unit(j) = 1.0_wp
         call self%add_columns(self%unit(:n), self%columns(:, j))
      end do
      call self%inner%precondition_columns(self%columns)
      call self%subtract_rows(self%columns, self%complement%matrix(:n, :n), is_built=.false.)
      call self%complement%factor(singular)
      self%is_bordered = .not. singular
   end subroutine build_preconditioner

   !> Their number changes with the states of the pairs.
   subroutine reserve_columns(self)
      class(augmented_system), intent(inout) :: self

      if (allocated(self%columns)) then
         if (all(shape(self%columns) == [self%n_linear_inner, self%n_linear_extra])) return
         deallocate (self%columns)
      end if
      allocate (self%columns(self%n_linear_inner, self%n_linear_extra))
   end subroutine reserve_columns

   !> The complement belongs to its point: it is built anew.
   pure logical function preconditioner_fits(self)
      class(augmented_system), intent(in) :: self

      preconditioner_fits = self%n_linear_extra == 0
      if (preconditioner_fits) preconditioner_fits = self%inner%preconditioner_fits()
   end function preconditioner_fits

   !> The bordered solution by blocks: q alone, then z with the complement, then q for that z.
   subroutine precondition(self, vector)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: vector(:)
      integer :: k, n

      k = self%n_linear_inner
      n = self%n_linear_extra
      call self%inner%precondition(vector(:k))
      if (n == 0 .or. .not. self%is_bordered) return
      self%inner_part(:k, 1) = vector(:k)
      self%extra_part(:n, 1) = vector(k + 1:)
      call self%subtract_rows(self%inner_part(:k, :), self%extra_part(:n, :), is_built=.true.)
      call self%complement%solve(self%extra_part(:n, 1))
      vector(k + 1:) = self%extra_part(:n, 1)
      call subtract_product(k, n, self%columns, self%extra_part, vector)
   end subroutine precondition

   !> Column by column: rows of the conditions take what the product of the inner system leaves.
   subroutine assemble(self, matrix)
      class(augmented_system), intent(inout) :: self
      real(wp), intent(inout), contiguous :: matrix(:, :)
      real(wp) :: unit(self%n_linear_inner + self%n_linear_extra)
      integer :: j, n

      n = size(unit)
      do j = 1, n
         unit = 0.0_wp
         unit(j) = 1.0_wp
         call self%apply(unit, matrix(:n, j))
      end do
   end subroutine assemble

end module fw_augmented_system
