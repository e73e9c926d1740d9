! Says whether the BLAS that this is linked with runs a kernel below what the processor can do.
program blas_probe
   use fw_blas, only: slow_kernel, text_length
   implicit none (type, external)
   interface
      subroutine dscal(n, a, x, incx)
         implicit none (type, external)
         integer, intent(in) :: n, incx
         double precision, intent(in) :: a
         double precision, intent(inout) :: x(*)
      end subroutine dscal
   end interface
   logical :: is_slow
   character(text_length) :: kernel, better
   double precision :: x(1)

   ! Without a call the linker may leave the library out.
   x = 1.0d0
   call dscal(1, 2.0d0, x, 1)
   call slow_kernel(is_slow, kernel, better)
   if (is_slow) then
      print '(a)', 'slow: '//trim(kernel)//' in place of '//trim(better)
   else
      print '(a)', 'fits: '//trim(kernel)
   end if
end program blas_probe
