!> Values of a calling program as a source of one part of a model, which bears the name of the
!> dataset of a model file. They are flat: the extents are those that are known, or follow from the
!> number of values.
module fw_part_values
   use fw_error, only: fatal_error, status_input
   use fw_kinds, only: i8, wp
   use fw_part, only: part_source, part_type, scalar
   use fw_parts, only: is_of_kind, put_name
   use fw_text, only: to_text
   use fw_values, only: read_integer
   implicit none (type, external)
   private

   public :: value_source

   !> The values stand in the components of part_source.
   type, extends(part_source) :: value_source
      character(:), allocatable :: name
      !> 'real', 'integer' or 'text', and how many values there are.
      character(7) :: kind = ''
      integer(i8) :: n_values = 0
      !> Whether there is a part of that name and kind.
      logical :: is_taken = .false.
   contains
      procedure :: seek
      procedure :: numbers
      procedure :: fail
      procedure, private :: find_extents
      procedure, private :: expect
   end type value_source

contains

   subroutine seek(self, part, found)
      class(value_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      logical, intent(out) :: found

      found = .false.
      if (.not. is_of_kind(part, self%kind)) return
      if (put_name(self%name_of(part)) /= self%name) return
      found = .true.
      self%is_taken = .true.
      if (index(part%shape, 'order') > 0 .and. self%extent_of('order') < 0 .and. &
          index(part%name, '/mass') == 0) then
         call self%fail(part, 'comes before the mass of its nodal diameter: put that first')
      else
         call self%find_extents(part)
      end if
   end subroutine seek

   !> Extents of a part from the number of its values.
   subroutine find_extents(self, part)
      class(value_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), parameter :: of_square = ', the real and the imaginary part of a square matrix'
      integer(i8) :: known
      integer :: last, n

      self%dims = self%extents_of(part)
      last = size(self%dims)
      ! In 64 bits: n_dof**2 passes the range of 32.
      known = product(int(self%dims, i8), mask=self%dims >= 0)
      select case (count(self%dims < 0))
      case (0)
         call self%expect(known, self%n_values == known)
      case (1)
         ! As many as there are, which parts that are given later may have to fit.
         n = int(self%n_values/known)
         self%dims(last) = n
         call self%set_extent(first_word(part%shape), n)
         if (part%shape == 'quantity order') then
            call self%expect(known, self%n_values == known*n, 'a multiple of ', &
                             ', a row for each observed quantity')
         else if (part%shape == 'motion dof') then
            call self%expect(known, self%n_values == known*n .and. n > 0, 'a multiple of ', &
                             ', the dofs')
         else
            call self%expect(known*n, self%n_values == known*n)
         end if
      case default
         n = nint(sqrt(0.5_wp*real(self%n_values, wp)))
         self%dims(2:) = n
         call self%expect(2_i8, self%n_values == 2_i8*n*n, behind= &
                          merge(' n**2', ' a**2', index(part%shape, 'order') > 0)//of_square)
      end select
   end subroutine find_extents

   !> What the extent of a shape that varies slowest counts.
   pure function first_word(shape) result(word)
      character(*), intent(in) :: shape
      character(len(shape)) :: word

      word = shape
      if (index(word, scalar) == 1) word = word(len(scalar) + 1:)
      word = word(:index(word//' ', ' ') - 1)
   end function first_word

   !> Refuse another number of values.
   subroutine expect(self, expected, is_met, before, behind)
      class(value_source), intent(inout) :: self
      integer(i8), intent(in) :: expected
      logical, intent(in) :: is_met
      !> Words around the number.
      character(*), intent(in), optional :: before, behind
      character(20) :: given, number
      character(:), allocatable :: text

      if (is_met) return
      write (given, '(i0)') self%n_values
      write (number, '(i0)') expected
      text = trim(number)
      if (present(before)) text = before//text
      if (present(behind)) text = text//behind
      call fatal_error(self%error, self%name//' has '//trim(given)//' values: must be '//text, &
                       status_input)
   end subroutine expect

   !> The number in the name.
   subroutine numbers(self, part, least, most, list)
      class(value_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, intent(in) :: least, most
      integer, allocatable, intent(out) :: list(:)
      character(:), allocatable :: rest
      integer :: k, n
      logical :: ok

      allocate (list(0))
      n = scan(part%name, 'KMIJ') - 1
      if (allocated(self%error) .or. index(self%name, part%name(:n)) /= 1) return
      rest = self%name(n + 1:index(self%name(n + 1:)//'/', '/') + n - 1)
      call read_integer(rest, k, ok)
      if (ok .and. k >= least .and. k <= most) then
         list = [k]
      else
         call self%refuse(part, rest, 'a number from '//to_text(least)//' to '//to_text(most)// &
                          ' (give cyclic/n_sectors first)')
      end if
   end subroutine numbers

   subroutine fail(self, part, text)
      class(value_source), intent(inout) :: self
      type(part_type), intent(in) :: part
      character(*), intent(in) :: text

      associate (unused => part)
      end associate
      call fatal_error(self%error, self%name//' '//text, status_input)
   end subroutine fail

end module fw_part_values
