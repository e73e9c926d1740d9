!> What a case was read from, where other cases are read from it once more with changes on top: the
!> blocks of a mission, the engine orders of a Campbell diagram.
module fw_case_source
   use fw_raw_model, only: raw_model
   use fw_text, only: string_type
   use fw_user_element, only: user_element
   implicit none (type, external)
   private

   public :: case_source

   !> What the matrices of a case were formed from, kept where they change from point to point.
   type :: case_source
      character(:), allocatable :: path
      !> Not allocated where the path names the file.
      character(:), allocatable :: text
      type(string_type), allocatable :: overrides(:)
      !> The model where the calling program gives it.
      type(raw_model), allocatable :: model
      logical :: tries_files = .false.
      !> Laws that the calling program has added.
      type(user_element), allocatable :: laws(:)
   end type case_source

end module fw_case_source
