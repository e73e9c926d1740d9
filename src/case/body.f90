!> What vibrates: the structure of a case, its contact pairs, springs and other elements, and what a
!> parameter of it that moves needs. All that says how it is solved is in fw_case.
module fw_body
   use fw_contact_data, only: contact_type, spring_type
   use fw_elements, only: element_list
   use fw_kinds, only: wp
   use fw_loose_bodies, only: loose_bodies
   use fw_model, only: model_type
   use fw_model_forming, only: model_origin
   implicit none (type, external)
   private

   public :: body_type

   !> What vibrates: model, pairs, springs and other elements, without what is asked of them.
   type :: body_type
      type(model_type) :: model
      type(contact_type) :: contact
      type(spring_type) :: springs
      !> What acts on rows of its own beside them.
      type(element_list) :: elements
      !> The parameter of fw_parameters that changes from point to point (0: none), and what the
      !> model is formed from, only where that changes its matrices.
      integer :: varied = 0
      !> Lowest and highest value of a parameter of the matrices that changes so.
      real(wp) :: varied_span(2) = 0.0_wp
      type(model_origin), allocatable :: origin
      !> Bodies that no spring holds, where there are any.
      type(loose_bodies), allocatable :: bodies
   contains
      procedure :: has_joint
      procedure :: is_nonlinear
      procedure :: stand_at
   end type body_type

contains

   !> Whether anything acts on rows of its own: pairs, springs, other elements.
   pure logical function has_joint(self)
      class(body_type), intent(in) :: self

      has_joint = self%contact%n_pairs + self%springs%n_springs + self%elements%n_elements() > 0
   end function has_joint

   !> The same at the rotation speed that follows a frequency [rad/s]; none follows any more.
   subroutine stand_at(self, omega, body)
      class(body_type), intent(in) :: self
      real(wp), intent(in) :: omega
      type(body_type), intent(out) :: body

      body%contact = self%contact
      body%springs = self%springs
      body%elements = self%elements
      if (allocated(self%bodies)) body%bodies = self%bodies
      body%model = self%model%at_frequency(omega)
      if (allocated(body%model%cyclic%speed)) deallocate (body%model%cyclic%speed)
   end subroutine stand_at

   !> Whether forces of these are not in proportion to the motion.
   pure logical function is_nonlinear(self)
      class(body_type), intent(in) :: self

      is_nonlinear = self%contact%n_pairs > 0 .or. .not. self%elements%are_linear()
      if (self%springs%n_springs > 0) then
         is_nonlinear = is_nonlinear .or. any(self%springs%power > 1)
      end if
   end function is_nonlinear

end module fw_body
