!> Whether memory is to be had, asked before it is needed: an allocation that fails deep inside
!> would end the program without a word of what to change.
module fw_memory
   use, intrinsic :: iso_c_binding, only: c_loc, c_ptr, c_size_t
   use, intrinsic :: iso_fortran_env, only: int64
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: require_memory, allocate_zeros

   !> More than any address space holds.
   real(wp), parameter :: most_bytes = 1.0e17_wp
   !> Numbers from which an array takes large pages (1 MB).
   integer, parameter :: large_array = 131072

   interface
      subroutine prefer_large_pages(array, bytes) bind(c, name='fretwear_prefer_large_pages')
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: array
         integer(c_size_t), value :: bytes
      end subroutine prefer_large_pages
   end interface

contains

   !> An array of zeros, of large pages where it is large: the first frequency of a small joint
   !> takes a good part of its time to get its pages one by one.
   subroutine allocate_zeros(array, extents)
      real(wp), intent(out), allocatable, target :: array(:, :, :)
      integer, intent(in) :: extents(3)
      integer(int64) :: n

      allocate (array(extents(1), extents(2), extents(3)))
      n = size(array, kind=int64)
      if (n >= large_array) call prefer_large_pages(c_loc(array), &
                                    int(n*(storage_size(array)/8), c_size_t))
      array = 0.0_wp
   end subroutine allocate_zeros

   !> Refuse what so many reals do not fit for. Nothing is reserved: the system gives pages when
   !> they are first written to.
   subroutine require_memory(n_reals, subject, remedy, error)
      !> A real number, because the product of sizes may exceed every integer.
      real(wp), intent(in) :: n_reals
      !> What needs the memory, with its values, and what to do where it is not there.
      character(*), intent(in) :: subject, remedy
      !> status_input where the system has no such amount.
      type(error_type), allocatable, intent(out) :: error
      ! Otherwise the compiler leaves out an allocation that nobody uses.
      real(wp), allocatable, volatile :: probe(:)
      real(wp) :: bytes
      character(16) :: size_text
      integer :: status

      bytes = n_reals*real(storage_size(n_reals)/8, wp)
      status = 1
      if (bytes < most_bytes) allocate (probe(int(n_reals, int64)), stat=status)
      if (status == 0) return
      write (size_text, '(es8.1)') bytes*1.0e-9_wp
      call fatal_error(error, subject//' needs about '//trim(adjustl(size_text))// &
                       ' GB of memory, which is not to be had: '//remedy, status_input)
   end subroutine require_memory

end module fw_memory
