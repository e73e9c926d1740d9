!> Explicit interfaces to the BLAS and LAPACK routines in use, so that every call is checked.
module fw_lapack
   use fw_kinds, only: sp
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: dgemm, dgemv, zgemm, zgemv, dgetrf, dgetrs, zgetrf, zgetrs, dsyevd, dsygvd
   public :: dgeev, dpotrf, ztrsv, cgetrf, claswp, ctrsv

   interface
      subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm

      subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         real(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
         real(wp), intent(inout) :: y(*)
      end subroutine dgemv

      subroutine zgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         complex(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         complex(wp), intent(inout) :: c(ldc, *)
      end subroutine zgemm

      subroutine zgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         complex(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
         complex(wp), intent(inout) :: y(*)
      end subroutine zgemv

      subroutine dgetrf(m, n, a, lda, ipiv, info)
         import :: wp
         integer, intent(in) :: m, n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine dgetrf

      subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dgetrs

      subroutine ztrsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: wp
         character(1), intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         complex(wp), intent(in) :: a(lda, *)
         complex(wp), intent(inout) :: x(*)
      end subroutine ztrsv

      subroutine zgetrf(m, n, a, lda, ipiv, info)
         import :: wp
         integer, intent(in) :: m, n, lda
         complex(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine zgetrf

      subroutine cgetrf(m, n, a, lda, ipiv, info)
         import :: sp
         integer, intent(in) :: m, n, lda
         complex(sp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine cgetrf

      subroutine claswp(n, a, lda, k1, k2, ipiv, incx)
         import :: sp
         integer, intent(in) :: n, lda, k1, k2, ipiv(*), incx
         complex(sp), intent(inout) :: a(lda, *)
      end subroutine claswp

      subroutine ctrsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: sp
         character, intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         complex(sp), intent(in) :: a(lda, *)
         complex(sp), intent(inout) :: x(*)
      end subroutine ctrsv

      subroutine zgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
         complex(wp), intent(in) :: a(lda, *)
         complex(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine zgetrs

      subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      subroutine dsyevd(jobz, uplo, n, a, lda, w, work, lwork, iwork, liwork, info)
         import :: wp
         character, intent(in) :: jobz, uplo
         integer, intent(in) :: n, lda, lwork, liwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: w(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(inout) :: iwork(*)
         integer, intent(out) :: info
      end subroutine dsyevd

      subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
         import :: wp
         integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
         character, intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(inout) :: iwork(*)
         integer, intent(out) :: info
      end subroutine dsygvd

      subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
         import :: wp
         character, intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *), vl(ldvl, *), vr(ldvr, *)
         real(wp), intent(out) :: wr(*), wi(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(out) :: info
      end subroutine dgeev

   end interface

end module fw_lapack
