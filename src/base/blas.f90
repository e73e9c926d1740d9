!> The BLAS in use: its name, its kernel, and whether the processor could run a faster one. An
!> OpenBLAS that does not know a processor takes a kernel that suits all, three times slower than
!> the one that fits (48 pairs, H = 17: 52 ms a point against 17).
module fw_blas
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_null_char, c_ptr, c_size_t
   implicit none (type, external)
   private

   public :: describe_blas, slow_kernel, text_length

   !> Of names and versions.
   integer, parameter :: text_length = 128

   !> Vectors of kernels and processors.
   integer, parameter :: unknown = -1, none = 0, avx = 1, avx2 = 2, avx512 = 3

   ! Kernels of OpenBLAS for x86-64, each with its level.
   character(*), parameter :: kernels(*) = [character(14) :: &
      'Prescott', 'Core2', 'Penryn', 'Dunnington', 'Nehalem', 'Atom', 'Athlon', 'Opteron', &
      'Opteron_SSE3', 'Barcelona', 'Bobcat', 'Nano', 'Katmai', 'Coppermine', 'Northwood', &
      'Banias', 'Generic', 'Sandybridge', 'Bulldozer', 'Piledriver', 'Steamroller', 'Excavator', &
      'Haswell', 'Zen', 'SkylakeX', 'Cooperlake', 'SapphireRapids']
   integer, parameter :: levels(*) = [none, none, none, none, none, none, none, none, none, none, &
                                      none, none, none, none, none, none, none, avx, avx, avx, &
                                      avx, avx2, avx2, avx2, avx512, avx512, avx512]

   interface
      type(c_ptr) function blas_config() bind(c, name='fretwear_blas_config')
         import :: c_ptr
      end function blas_config

      type(c_ptr) function blas_kernel() bind(c, name='fretwear_blas_kernel')
         import :: c_ptr
      end function blas_kernel

      integer(c_int) function vector_level() bind(c, name='fretwear_vector_level')
         import :: c_int
      end function vector_level

      integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
         import :: c_ptr, c_size_t
         type(c_ptr), value :: text
      end function c_strlen
   end interface

contains

   !> Name, version and kernel, as 'OpenBLAS 0.3.21, kernel Haswell'.
   subroutine describe_blas(text)
      character(text_length), intent(out) :: text
      character(text_length) :: config, kernel
      integer :: first, second

      call take(blas_config(), config)
      call take(blas_kernel(), kernel)
      if (len_trim(config) == 0) then
         text = 'not OpenBLAS'
         return
      end if
      ! 'OpenBLAS 0.3.21 NO_LAPACKE DYNAMIC_ARCH ...'
      first = index(config, ' ')
      second = index(config(first + 1:), ' ')
      text = config(:first + second - 1)
      if (len_trim(kernel) > 0) text = trim(text)//', kernel '//kernel
   end subroutine describe_blas

   !> Whether the kernel in use lacks vectors that the processor has, and the kernel to ask for.
   subroutine slow_kernel(is_slow, kernel, better)
      logical, intent(out) :: is_slow
      character(text_length), intent(out) :: kernel, better
      integer :: level, possible

      call take(blas_kernel(), kernel)
      level = vector_level_of(kernel)
      possible = int(vector_level())
      ! Between AVX2 and AVX-512 there is a third at most, and OpenBLAS may know better.
      is_slow = level /= unknown .and. level < avx2 .and. possible >= avx2
      better = merge('SkylakeX', 'Haswell ', possible == avx512)
   end subroutine slow_kernel

   !> Level of a kernel by its name, -1 for one that is not in the list.
   pure integer function vector_level_of(kernel) result(level)
      character(*), intent(in) :: kernel
      integer :: i

      level = unknown
      do i = 1, size(kernels)
         if (kernel == kernels(i)) level = levels(i)
      end do
   end function vector_level_of

   !> A text of C, cut where it is longer.
   subroutine take(address, text)
      type(c_ptr), intent(in) :: address
      character(text_length), intent(out) :: text
      character(kind=c_char), pointer :: letters(:)
      integer :: i, n

      n = min(len(text), int(c_strlen(address)))
      call c_f_pointer(address, letters, [n])
      text = ''
      do i = 1, n
         if (letters(i) == c_null_char) exit
         text(i:i) = letters(i)
      end do
   end subroutine take

end module fw_blas
