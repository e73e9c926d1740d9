!> What a group of an HDF5 file holds: the names of its members and of attributes, and what kind of
!> object stands under a name.
module fw_hdf5_members
   use fw_hdf5_file, only: hdf5_file
   use fw_text, only: string_type
   use hdf5, only: h5aget_name_by_idx_f, h5aget_num_attrs_f, h5gn_members_f, h5lget_name_by_idx_f, &
      h5i_dataset_f, h5i_group_f, h5iget_type_f, h5oclose_f, h5oopen_f, h5_index_name_f, &
      h5_iter_inc_f, hid_t, hsize_t
   implicit none (type, external)
   private

   public :: kind_of, list_attributes, list_members

   !> Names are read up to this length.
   integer, parameter :: longest_name = 256

contains

   !> Names in a group.
   subroutine list_members(file, group, members)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: group
      type(string_type), allocatable, intent(out) :: members(:)
      character(longest_name) :: name
      integer :: i, n, status

      call h5gn_members_f(file%id, group, n, status)
      if (status < 0) n = 0
      allocate (members(n))
      do i = 1, n
         name = '?'
         ! Of links too that lead nowhere.
         call h5lget_name_by_idx_f(file%id, group, h5_index_name_f, h5_iter_inc_f, &
                                   int(i - 1, hsize_t), name, status)
         if (status < 0) name = '?'
         members(i)%text = trim(name)
      end do
   end subroutine list_members

   !> Names of the attributes of an object.
   subroutine list_attributes(file, object, names)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: object
      type(string_type), allocatable, intent(out) :: names(:)
      character(longest_name) :: name
      integer(hid_t) :: id
      integer :: i, n, status

      n = 0
      call h5oopen_f(file%id, object, id, status)
      if (status < 0) then
         allocate (names(0))
         return
      end if
      call h5aget_num_attrs_f(id, n, status)
      if (status < 0) n = 0
      allocate (names(n))
      do i = 1, n
         name = '?'
         call h5aget_name_by_idx_f(id, '.', h5_index_name_f, h5_iter_inc_f, int(i - 1, hsize_t), &
                                   name, status)
         if (status < 0) name = '?'
         names(i)%text = trim(name)
      end do
      call h5oclose_f(id, status)
   end subroutine list_attributes

   !> `group`, `dataset`, or `link` where nothing that can be opened stands behind the name.
   function kind_of(file, name) result(word)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      character(7) :: word
      integer(hid_t) :: id
      integer :: kind, status

      word = 'link'
      call h5oopen_f(file%id, name, id, status)
      if (status < 0) return
      call h5iget_type_f(id, kind, status)
      if (status >= 0 .and. kind == h5i_group_f) word = 'group'
      if (status >= 0 .and. kind == h5i_dataset_f) word = 'dataset'
      call h5oclose_f(id, status)
   end function kind_of

end module fw_hdf5_members
