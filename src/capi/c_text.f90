!> Texts between C and Fortran.
!>
!> Letters are copied one by one: a Fortran text has no null at its end and a length of its own.
module fw_c_text
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_null_char, c_ptr, &
      c_size_t
   implicit none (type, external)
   private

   public :: take_text, give_text

   interface
      integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: text
      end function c_strlen
   end interface

contains

   !> A copy of a text of C; not allocated for a null pointer.
   subroutine take_text(pointer, text)
      type(c_ptr), intent(in) :: pointer
      character(:), allocatable, intent(out) :: text
      character(kind=c_char), pointer :: letters(:)
      integer(c_size_t) :: i, n

      if (.not. c_associated(pointer)) return
      n = c_strlen(pointer)
      call c_f_pointer(pointer, letters, [n])
      allocate (character(n) :: text)
      do i = 1, n
         text(i:i) = letters(i)
      end do
   end subroutine take_text

   !> Copy a text to a buffer of C as far as it fits, always with a null at the end.
   subroutine give_text(text, buffer, buffer_size)
      !> Text of any length; it may hold nulls, which C will take for its end.
      character(*), intent(in) :: text
      !> Null, or a size of 0: only the length is of interest, and nothing is written.
      type(c_ptr), intent(in) :: buffer
      !> Letters of the buffer, the null included.
      integer(c_size_t), intent(in) :: buffer_size
      character(kind=c_char), pointer :: letters(:)
      integer(c_size_t) :: i, n

      if (.not. c_associated(buffer) .or. buffer_size < 1_c_size_t) return
      call c_f_pointer(buffer, letters, [buffer_size])
      n = min(len(text, c_size_t), buffer_size - 1_c_size_t)
      do i = 1, n
         letters(i) = text(i:i)
      end do
      letters(n + 1) = c_null_char
   end subroutine give_text

end module fw_c_text
