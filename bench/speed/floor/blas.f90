!> Interfaces to BLAS in single precision that the library does not use.
module floor_blas
   use fw_kinds, only: sp
   implicit none (type, external)
   private

   public :: sgemm, sgemv, strsv, cgemv

   interface
      subroutine sgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: sp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(sp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(sp), intent(inout) :: c(ldc, *)
      end subroutine sgemm

      subroutine sgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: sp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         real(sp), intent(in) :: alpha, beta, a(lda, *), x(*)
         real(sp), intent(inout) :: y(*)
      end subroutine sgemv

      subroutine cgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: sp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         complex(sp), intent(in) :: alpha, beta, a(lda, *), x(*)
         complex(sp), intent(inout) :: y(*)
      end subroutine cgemv

      subroutine strsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: sp
         character, intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         real(sp), intent(in) :: a(lda, *)
         real(sp), intent(inout) :: x(*)
      end subroutine strsv
   end interface

end module floor_blas
