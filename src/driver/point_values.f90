!> The numbers of a solution point by the names of the datasets of a result file, laid out as a row
!> of the dataset: the last index of the documented shape runs fastest.
module fw_point_values
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_usage
   use fw_kinds, only: wp
   use fw_point, only: point_type
   use fw_point_quantities, only: point_quantities, quantity_type
   implicit none (type, external)
   private

   public :: get_point_values

contains

   !> The values of a name, flattened; a flag is 1 or 0.
   subroutine get_point_values(point, name, case, values, error)
      type(point_type), intent(in) :: point
      character(*), intent(in) :: name
      !> The case that the point is of.
      type(case_type), intent(in) :: case
      real(wp), allocatable, intent(out) :: values(:)
      !> status_usage where there is no such name, or the point does not hold it.
      type(error_type), allocatable, intent(out) :: error
      type(quantity_type), allocatable :: list(:)
      integer :: i

      call point_quantities(list)
      do i = 1, size(list)
         if (list(i)%name == name) exit
      end do
      if (i > size(list)) then
         call unknown_name(name, list, error)
         return
      end if
      call list(i)%row(point, case, values)
      if (allocated(values)) return
      call fatal_error(error, "the point holds no '"//name//"': histories need "// &
                       'output%histories = .true., contact values contact pairs and '// &
                       'output%contact = .true., Floquet multipliers sweep%stability = '// &
                       ".true., error estimates harmonics%accuracy, derivatives &sensitivity, "// &
                       "wear case%analysis = 'wear'", &
                       status_usage)
   end subroutine get_point_values

   !> Say which names there are, in the order of the table.
   subroutine unknown_name(name, list, error)
      character(*), intent(in) :: name
      type(quantity_type), intent(in) :: list(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: names
      integer :: i

      names = trim(list(1)%name)
      do i = 2, size(list)
         ! Too many to name each.
         if (any(list(i)%sensitivity /= 0)) cycle
         names = names//', '//trim(list(i)%name)
      end do
      names = names//', sensitivity/QUANTITY/PARAMETER'
      call fatal_error(error, "there is no result '"//name//"': must be one of "//names, &
                       status_usage)
   end subroutine unknown_name

end module fw_point_values
