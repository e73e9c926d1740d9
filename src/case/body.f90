!> What vibrates: the structure of a case, its contact pairs and springs, and what a parameter of it
!> that moves needs. All that says how it is solved is in fw_case.
module fw_body
   use fw_contact_data, only: contact_type, spring_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_model_forming, only: model_origin
   implicit none (type, external)
   private

   public :: body_type

   type :: body_type
      type(model_type) :: model
      type(contact_type) :: contact
      type(spring_type) :: springs
      !> The parameter of fw_parameters that changes from point to point (0: none), and what the
      !> model is formed from, only where that changes its matrices.
      integer :: varied = 0
      !> Lowest and highest value of a parameter of the matrices that changes so.
      real(wp) :: varied_span(2) = 0.0_wp
      type(model_origin), allocatable :: origin
   end type body_type

end module fw_body
