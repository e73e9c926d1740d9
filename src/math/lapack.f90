!> Explicit interfaces to the BLAS and LAPACK routines in use, so that every call is checked.
!> The routines keep their names, argument orders and conventions of the reference BLAS and LAPACK:
!> matrices by columns, `info` = 0 for success, < 0 for a bad argument, > 0 for a numerical failure.
!> Arrays are of assumed size, so that a leading block or a column can be passed without a copy; the
!> shapes are the caller's business, since the routines do not check them.
module fw_lapack
   use fw_kinds, only: sp, wp
   implicit none (type, external)
   private

   public :: dgemm, dgemv, zgemm, zgemv, dgetrf, dgetrs, zgetrf, zgetrs, dsyevd, dsygvd
   public :: dgeev, dpotrf, ztrsv, cgemm, cgetrf, claswp, ctrsm, ctrsv, zhegvd, zpotrf, zpotrs
   public :: zggev, sgetrf, strsm, dlaswp, dtrsm, dtrmm, dsyrk, dpocon, dsygst
   public :: dsyevr, dsytrf, zgeev

   interface
      !> c = alpha op(a) op(b) + beta c, with op the matrix itself ('N') or its transpose ('T').
      subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm

      !> y = alpha op(a) x + beta y; with beta = 0 the old y is never read, and may be undefined.
      subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         real(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
         real(wp), intent(inout) :: y(*)
      end subroutine dgemv

      !> As dgemm for complex matrices; 'C' is the conjugate transpose.
      subroutine zgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         complex(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         complex(wp), intent(inout) :: c(ldc, *)
      end subroutine zgemm

      !> As dgemv for complex matrices.
      subroutine zgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         complex(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
         complex(wp), intent(inout) :: y(*)
      end subroutine zgemv

      !> LU factors with row pivots, in place; info = k > 0: pivot k is exactly zero, the factors
      !> are complete but cannot solve. A nearly singular matrix is not noticed.
      subroutine dgetrf(m, n, a, lda, ipiv, info)
         import :: wp
         integer, intent(in) :: m, n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine dgetrf

      !> Swap the rows k1 to k2 as the pivots say, forwards for incx = 1.
      subroutine dlaswp(n, a, lda, k1, k2, ipiv, incx)
         import :: wp
         integer, intent(in) :: n, lda, k1, k2, ipiv(*), incx
         real(wp), intent(inout) :: a(lda, *)
      end subroutine dlaswp

      !> B = alpha op(A)^-1 B or alpha B op(A)^-1 with a triangular A (side 'L', 'R').
      subroutine dtrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: wp
         character, intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         real(wp), intent(in) :: alpha, a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
      end subroutine dtrsm

      !> Solutions by the factors of dgetrf, in place of the right-hand sides.
      subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dgetrs

      !> Triangular solution in place: half of zgetrs for one right-hand side, without its blocking.
      subroutine ztrsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: wp
         character(1), intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         complex(wp), intent(in) :: a(lda, *)
         complex(wp), intent(inout) :: x(*)
      end subroutine ztrsv

      !> As dgetrf for complex matrices.
      subroutine zgetrf(m, n, a, lda, ipiv, info)
         import :: wp
         integer, intent(in) :: m, n, lda
         complex(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine zgetrf

      !> In single precision: the preconditioner, of which few digits serve, is factored and applied
      !> at half the memory traffic.
      subroutine cgetrf(m, n, a, lda, ipiv, info)
         import :: sp
         integer, intent(in) :: m, n, lda
         complex(sp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine cgetrf

      !> Real factors in single precision.
      subroutine sgetrf(m, n, a, lda, ipiv, info)
         import :: sp
         integer, intent(in) :: m, n, lda
         real(sp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine sgetrf

      !> Swap the rows k1 to k2 as the pivots say, forwards for incx = 1.
      subroutine claswp(n, a, lda, k1, k2, ipiv, incx)
         import :: sp
         integer, intent(in) :: n, lda, k1, k2, ipiv(*), incx
         complex(sp), intent(inout) :: a(lda, *)
      end subroutine claswp

      !> As zgemm in single precision.
      subroutine cgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: sp
         character, intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         complex(sp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         complex(sp), intent(inout) :: c(ldc, *)
      end subroutine cgemm

      !> B = alpha op(A)^-1 B or alpha B op(A)^-1 with a triangular A (side 'L', 'R').
      subroutine ctrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: sp
         character, intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         complex(sp), intent(in) :: alpha, a(lda, *)
         complex(sp), intent(inout) :: b(ldb, *)
      end subroutine ctrsm

      !> As ctrsm for real matrices.
      subroutine strsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: sp
         character, intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         real(sp), intent(in) :: alpha, a(lda, *)
         real(sp), intent(inout) :: b(ldb, *)
      end subroutine strsm

      !> As ztrsv in single precision.
      subroutine ctrsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: sp
         character, intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         complex(sp), intent(in) :: a(lda, *)
         complex(sp), intent(inout) :: x(*)
      end subroutine ctrsv

      !> Solutions by the factors of zgetrf, in place of the right-hand sides.
      subroutine zgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         character, intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
         complex(wp), intent(in) :: a(lda, *)
         complex(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine zgetrs

      !> b = alpha op(a) b ('L'), or b op(a) ('R'), with a triangular.
      subroutine dtrmm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         real(wp), intent(in) :: alpha, a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
      end subroutine dtrmm

      !> c = alpha a a^T + beta c ('N'), or a^T a ('T'); one triangle of it.
      subroutine dsyrk(uplo, trans, n, k, alpha, a, lda, beta, c, ldc)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: uplo, trans
         integer, intent(in) :: n, k, lda, ldc
         real(wp), intent(in) :: alpha, beta, a(lda, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dsyrk

      !> Estimate of the reciprocal condition from a Cholesky factor and the 1-norm of the matrix.
      subroutine dpocon(uplo, n, a, lda, anorm, rcond, work, iwork, info)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(in) :: a(lda, *), anorm
         real(wp), intent(out) :: rcond, work(*)
         integer, intent(out) :: iwork(*), info
      end subroutine dpocon

      !> itype 1: a = inv(L) a inv(L^T) with the Cholesky factor L in b; one triangle of it.
      subroutine dsygst(itype, uplo, n, a, lda, b, ldb, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: itype, n, lda, ldb
         character, intent(in) :: uplo
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(in) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dsygst

      !> Cholesky factor, in place; info > 0: the matrix is not positive definite.
      subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      !> L D L^T of a symmetric matrix by diagonal pivoting, in the triangle of a; ipiv is negative
      !> where D has a block of order two, one of whose eigenvalues is negative.
      subroutine dsytrf(uplo, n, a, lda, ipiv, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: uplo
         integer, intent(in) :: n, lda, lwork
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*), info
         real(wp), intent(out) :: work(*)
      end subroutine dsytrf

      !> Eigenpairs of a symmetric matrix with values in (vl, vu] (range 'V'), in ascending order; a
      !> is spoilt.
      subroutine dsyevr(jobz, range, uplo, n, a, lda, vl, vu, il, iu, abstol, m, w, z, ldz, &
                        isuppz, work, lwork, iwork, liwork, info)
         import :: wp
         implicit none (type, external)
         character, intent(in) :: jobz, range, uplo
         integer, intent(in) :: n, lda, il, iu, ldz, lwork, liwork
         real(wp), intent(in) :: vl, vu, abstol
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: m, isuppz(*), iwork(*), info
         real(wp), intent(out) :: w(*), z(ldz, *), work(*)
      end subroutine dsyevr

      !> Eigenpairs of a symmetric matrix in ascending order, by divide and conquer; vectors in
      !> place of a. It needs workspace of order 2 n**2 in return for its speed.
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

      !> As dsyevd for a x = value b x (itype = 1), b positive definite; info > n: b is not.
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

      !> Eigenvalues and, on request, eigenvectors of a general matrix; a complex pair stands in two
      !> following entries of wr and wi.
      subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
         import :: wp
         character, intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *), vl(ldvl, *), vr(ldvr, *)
         real(wp), intent(out) :: wr(*), wi(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(out) :: info
      end subroutine dgeev

      !> As dsygvd for Hermitian matrices.
      subroutine zhegvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, rwork, lrwork, &
                        iwork, liwork, info)
         import :: wp
         integer, intent(in) :: itype, n, lda, ldb, lwork, lrwork, liwork
         character, intent(in) :: jobz, uplo
         complex(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*)
         complex(wp), intent(inout) :: work(*)
         real(wp), intent(inout) :: rwork(*)
         integer, intent(inout) :: iwork(*)
         integer, intent(out) :: info
      end subroutine zhegvd

      !> Eigenvalues alpha/beta of a general pencil, and on request both eigenvectors.
      subroutine zggev(jobvl, jobvr, n, a, lda, b, ldb, alpha, beta, vl, ldvl, vr, ldvr, work, &
                       lwork, rwork, info)
         import :: wp
         character, intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldb, ldvl, ldvr, lwork
         complex(wp), intent(inout) :: a(lda, *), b(ldb, *), vl(ldvl, *), vr(ldvr, *)
         complex(wp), intent(out) :: alpha(*), beta(*)
         complex(wp), intent(inout) :: work(*)
         real(wp), intent(inout) :: rwork(*)
         integer, intent(out) :: info
      end subroutine zggev

      !> Eigenpairs of a complex matrix a x = w x; vectors of unit length.
      subroutine zgeev(jobvl, jobvr, n, a, lda, w, vl, ldvl, vr, ldvr, work, lwork, rwork, info)
         import :: wp
         character, intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         complex(wp), intent(inout) :: a(lda, *), vl(ldvl, *), vr(ldvr, *)
         complex(wp), intent(out) :: w(*)
         complex(wp), intent(inout) :: work(*)
         real(wp), intent(inout) :: rwork(*)
         integer, intent(out) :: info
      end subroutine zgeev

      !> As dpotrf for a Hermitian matrix.
      subroutine zpotrf(uplo, n, a, lda, info)
         import :: wp
         character, intent(in) :: uplo
         integer, intent(in) :: n, lda
         complex(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine zpotrf

      !> Solutions by the factor of zpotrf, in place of the right-hand sides.
      subroutine zpotrs(uplo, n, nrhs, a, lda, b, ldb, info)
         import :: wp
         character, intent(in) :: uplo
         integer, intent(in) :: n, nrhs, lda, ldb
         complex(wp), intent(in) :: a(lda, *)
         complex(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine zpotrs

   end interface

end module fw_lapack
