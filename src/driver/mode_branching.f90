!> Whether a nonlinear mode has passed a point at which another curve branches off: equal parts that
!> move alike may begin to move apart. There the determinant of the bordered matrix changes its
!> sign, which a curve over amplitudes without a fold does nowhere else.
module fw_mode_branching
   use fw_kinds, only: wp
   use fw_linalg, only: lu_type
   use fw_mode_system, only: mode_system
   use fw_remarks, only: remark_list
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: branch_watch

   type :: branch_watch
      type(lu_type), private :: lu
      integer, private :: sign = 0, n_passed = 0
      !> Amplitudes of the last row, and on both sides of the first point that was passed.
      real(wp), private :: before = 0.0_wp, between(2) = 0.0_wp
   contains
      procedure :: note
      procedure :: remark
   end type branch_watch

   !> Unknowns up to which the matrix is factored for it.
   integer, parameter :: most_unknowns = 120

contains

   !> Take a solution, at the amplitude where the system stands.
   subroutine note(self, system, y)
      class(branch_watch), intent(inout) :: self
      type(mode_system), intent(inout) :: system
      real(wp), intent(in), contiguous :: y(:)
      real(wp) :: r(system%n)
      logical :: reduced, singular
      integer :: n, sign

      if (system%n > most_unknowns) return
      reduced = system%reduced
      system%reduced = .false.
      call system%residual(y, r)
      call system%linearize(n)
      call self%lu%reserve(n)
      call system%assemble(self%lu%matrix)
      call self%lu%factor(singular)
      system%reduced = reduced
      if (singular) return
      sign = self%lu%determinant_sign()
      if (sign*self%sign < 0) then
         self%n_passed = self%n_passed + 1
         if (self%n_passed == 1) self%between = [self%before, system%amplitude]
      end if
      self%sign = sign
      self%before = system%amplitude
   end subroutine note

   subroutine remark(self, remarks)
      class(branch_watch), intent(in) :: self
      type(remark_list), intent(inout) :: remarks

      if (self%n_passed == 0) return
      call remarks%add('branches off', 'between the amplitudes '//to_text(self%between(1))// &
                       ' and '//to_text(self%between(2))//' another curve branches off (equal '// &
                       'parts may begin to move apart), or the solutions went over to another '// &
                       'one: which of them is followed from there may depend on the steps and '// &
                       'the law; detune equal parts a little to tell them apart')
   end subroutine remark

end module fw_mode_branching
