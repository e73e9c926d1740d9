!> Nonlinear springs in a model file: group /spring. Its datasets are checked for their shapes here;
!> dofs, sectors and powers pass the checks of the keys of &spring, whichever of both gave them.
module fw_spring_file
   use fw_contact_data, only: spring_type
   use fw_error, only: error_type
   use fw_hdf5, only: dataset_failure, get_shape, hdf5_file, read_dataset
   use fw_kinds, only: wp
   use fw_model_file_parts, only: read_pair_values
   use fw_text, only: to_text
   use hdf5, only: hsize_t
   implicit none (type, external)
   private

   public :: read_spring_file

contains

   !> Group /spring; no springs where the file has none.
   subroutine read_spring_file(file, springs, error)
      type(hdf5_file), intent(in) :: file
      type(spring_type), intent(inout) :: springs
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      if (.not. file%exists('/spring')) return
      call read_dataset(file, '/spring/side_1', springs%side_1, error)
      if (allocated(error)) return
      ! The other parts are of as many springs.
      n = size(springs%side_1)
      if (.not. file%exists('/spring/coefficient')) then
         call dataset_failure(file, '/spring/coefficient', 'is missing: each spring needs one', &
                              error)
         return
      end if
      call read_pair_values(file, '/spring/coefficient', n, springs%coefficient, error)
      if (allocated(error)) return
      ! Pairs may have values of every sector; springs are the same in each.
      call check_size(file, '/spring/coefficient', size(springs%coefficient), n, error)
      if (.not. allocated(error)) call read_whole(file, '/spring/side_2', n, springs%side_2, error)
      if (.not. allocated(error)) call read_whole(file, '/spring/power', n, springs%power, error)
      if (.not. allocated(error)) call read_whole(file, '/spring/sector_2', n, &
                                                  springs%sector_2, error)
      if (.not. allocated(error)) springs%n_springs = n
   end subroutine read_spring_file

   !> A whole number for each of n springs, or one for all; nothing where the file has none.
   subroutine read_whole(file, name, n, values, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: n
      integer, allocatable, intent(inout) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer(hsize_t), allocatable :: dims(:)
      integer :: single

      if (.not. file%exists(name)) return
      call get_shape(file, name, dims, error)
      if (allocated(error)) return
      if (size(dims) > 0) then
         call read_dataset(file, name, values, error)
         if (.not. allocated(error)) call check_size(file, name, size(values), n, error)
         return
      end if
      call read_dataset(file, name, single, error)
      if (.not. allocated(error)) allocate (values(n), source=single)
   end subroutine read_whole

   !> As many values as springs.
   subroutine check_size(file, name, found, n, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      integer, intent(in) :: found, n
      type(error_type), allocatable, intent(out) :: error

      if (found == n) return
      call dataset_failure(file, name, 'has '//to_text(found)//' values, expected '// &
                           to_text(n)//', as many as /spring/side_1, or one for all', error)
   end subroutine check_size

end module fw_spring_file
