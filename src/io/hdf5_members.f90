!> What a group of an HDF5 file holds, and the refusal of what nobody reads there: a matrix under a
!> name that is off by a letter would be left out without a word.
module fw_hdf5_members
   use fw_error, only: error_type
   use fw_hdf5_file, only: dataset_failure, hdf5_file
   use fw_text, only: string_type, to_text
   use hdf5, only: h5gget_obj_info_idx_f, h5gn_members_f
   implicit none (type, external)
   private

   public :: refuse_strangers

   !> Names are read up to this length.
   integer, parameter :: longest_name = 256

contains

   !> An error at the first member of a group that is neither one of the names nor a number of the
   !> range; nothing where there is no such group.
   subroutine refuse_strangers(file, group, names, error, numbers)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: group
      !> All of one length; none of them of length 0.
      character(*), intent(in) :: names(:)
      type(error_type), allocatable, intent(out) :: error
      !> First and last.
      integer, intent(in), optional :: numbers(2)
      type(string_type), allocatable :: members(:)
      character(:), allocatable :: accepted
      integer :: i, k
      logical :: known

      if (.not. file%exists(group)) return
      call list_members(file, group, members)
      do i = 1, size(members)
         known = any(names == members(i)%text)
         if (present(numbers)) then
            do k = numbers(1), numbers(2)
               known = known .or. members(i)%text == to_text(k)
            end do
         end if
         if (known) cycle
         accepted = ''
         do k = 1, size(names)
            accepted = accepted//trim(merge(', ', '  ', k > 1))//' '//trim(names(k))
         end do
         if (present(numbers)) accepted = accepted//' a number from '//to_text(numbers(1))// &
                                          ' to '//to_text(numbers(2))
         call dataset_failure(file, group//'/'//members(i)%text, 'is nothing that is read; '// &
                              'expected there:'//accepted, error)
         return
      end do
   end subroutine refuse_strangers

   subroutine list_members(file, group, members)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: group
      type(string_type), allocatable, intent(out) :: members(:)
      character(longest_name) :: name
      integer :: i, kind, n, status

      call h5gn_members_f(file%id, group, n, status)
      if (status < 0) n = 0
      allocate (members(n))
      do i = 1, n
         call h5gget_obj_info_idx_f(file%id, group, i - 1, name, kind, status)
         if (status < 0) name = '?'
         members(i)%text = trim(name)
      end do
   end subroutine list_members

end module fw_hdf5_members
