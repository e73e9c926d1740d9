!> A case once more, with changes on top: see fw_case_source.
module fw_changed_case
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_read_case, only: case_input, read_input
   use fw_text, only: string_type
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: read_changed

contains

   !> Read a case that has kept its source.
   subroutine read_changed(case, changes, origin, changed, error)
      type(case_type), intent(in) :: case
      !> `group%key=value` each, as after --set.
      type(string_type), intent(in) :: changes(:)
      !> What messages put before a change.
      character(*), intent(in) :: origin
      type(case_type), intent(out) :: changed
      type(error_type), allocatable, intent(out) :: error
      type(case_input) :: input
      integer :: i

      associate (source => case%source)
         input%path = source%path
         if (allocated(source%text)) input%text = source%text
         input%overrides = source%overrides
         input%origin = origin
         input%tries_files = source%tries_files
         input%is_changed = .true.
         if (allocated(source%laws)) input%laws = source%laws
         do i = 1, size(changes)
            call append(input%overrides, changes(i)%text)
         end do
         if (allocated(source%model)) then
            call read_input(input, changed, error, source%model)
         else
            call read_input(input, changed, error)
         end if
      end associate
   end subroutine read_changed

end module fw_changed_case
