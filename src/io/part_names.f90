!> Names that are nearly those of parts of a model: what was meant by one that is none.
module fw_part_names
   use fw_parts, only: model_parts, part_type, put_name
   use fw_text, only: edit_distance, lower_case
   implicit none (type, external)
   private

   public :: hint_for, is_number, meant_part

contains

   !> ` (did you mean /damping?)`, or nothing: the nearest part of the same group, an attribute
   !> in the place of a dataset or the other way round, or a part of that name in another group.
   pure function hint_for(parts, word, pattern, is_attribute) result(hint)
      type(part_type), intent(in) :: parts(:)
      character(*), intent(in) :: word, pattern
      !> Whether the word is that of an attribute.
      logical, intent(in) :: is_attribute
      character(:), allocatable :: hint, row
      integer :: best, cost, i, last

      hint = ''
      best = huge(best)
      do i = 1, size(parts)
         call compare(word, trim(parts(i)%name), pattern, is_attribute, cost, last)
         if (cost >= best) cycle
         best = cost
         row = parts(i)%name(:last)
         hint = '/'//row
         if (index(row, '@') > 0) hint = 'attribute '//row(index(row, '@') + 1:)//' of /'// &
                                         row(:index(row, '@') - 1)
      end do
      if (len(hint) > 0) hint = ' (did you mean '//hint//'?)'
   end function hint_for

   !> How far a word in a group is from a row of the table, and how much of its path is meant.
   pure subroutine compare(word, row, pattern, is_attribute, cost, last)
      character(*), intent(in) :: word, row, pattern
      logical, intent(in) :: is_attribute
      !> Less is nearer; huge: another word.
      integer, intent(out) :: cost, last
      !> Of the other kind, in another group.
      integer, parameter :: kind_apart = 100, group_apart = 1000
      integer :: first, at
      logical :: row_is_attribute, in_group

      cost = huge(cost)
      last = len(row)
      at = index(row, '@')
      first = len(pattern) + merge(2, 1, len(pattern) > 0 .or. at == 1)
      in_group = len(pattern) == 0 .or. index(row, pattern//'/') == 1 .or. &
                 index(row, pattern//'@') == 1
      if (in_group) then
         ! A path in one word.
         if (scan(row(first:), '/@') > 0 .and. plain(word) == plain(row(first:))) cost = 0
         if (cost == 0) return
         last = first + scan(row(first:)//'/', '/@') - 2
         row_is_attribute = at == first - 1 .and. at > 0
         if (is_number(row(first:last))) return
         if (is_near(plain(word), plain(row(first:last)))) then
            cost = edit_distance(plain(word), plain(row(first:last)))
            if (row_is_attribute .eqv. is_attribute) return
            cost = cost + kind_apart
            ! What a generator leaves of itself is nothing that a case could lack.
            if (index(row, 'parameters') > 0) cost = huge(cost)
            return
         end if
         if (last == len(row)) return
         last = len(row)
      end if
      if (index(row, 'mesh/') > 0 .or. scan(row, '/@') < 2 .or. is_attribute .and. at == 0) return
      ! The parts of nodal diameters are called as those of a sector.
      if (index(row, 'nodal_diameter/') == 1 .and. index(pattern, 'nodal_diameter') /= 1) return
      if (plain(word) == plain(row(scan(row, '/@', back=.true.) + 1:))) cost = group_apart
   end subroutine compare

   !> Whether two names are the same but for a slip: a letter of four is wrong or left out, two are
   !> swapped, or the name stands with other words.
   pure logical function is_near(word, known)
      character(*), intent(in) :: word, known
      character(*), parameter :: matrices(*) = [character(9) :: 'mass', 'stiffness', 'damping', &
         'coriolis']

      is_near = edit_distance(word, known) <= max(1, min(len(word), len(known))/4)
      ! One of them or several: /bodies is meant for /body.
      if (len(word) > 4) is_near = is_near .or. singular(word) == known
      if (any(matrices == known)) is_near = is_near .or. index('_'//word//'_', '_'//known//'_') > 0
   end function is_near

   !> The word of one thing for that of several.
   pure function singular(word) result(text)
      character(*), intent(in) :: word
      character(:), allocatable :: text

      text = word
      if (word(len(word):) == 's') text = word(:len(word) - 1)
      if (word(len(word) - 2:) == 'ies') text = word(:len(word) - 3)//'y'
   end function singular

   !> Letters only: what people write in other ways is the same name.
   pure function plain(word) result(text)
      character(*), intent(in) :: word
      character(len(word)) :: text
      integer :: i

      text = lower_case(word)
      do i = 1, len(text)
         if (scan(text(i:i), '-. /@') > 0) text(i:i) = '_'
      end do
   end function plain

   !> Whether a name of the table stands for numbers.
   pure logical function is_number(known)
      character(*), intent(in) :: known

      is_number = index('KMIJ', trim(known)) > 0 .and. len_trim(known) == 1
   end function is_number

   !> ` (did you mean contact/mu?)`, or nothing, of the parts that a calling program gives.
   function meant_part(name) result(hint)
      character(*), intent(in) :: name
      character(:), allocatable :: hint, known
      type(part_type), allocatable :: parts(:)
      integer :: best, i

      parts = model_parts()
      hint = ''
      best = huge(best)
      do i = 1, size(parts)
         known = put_name(parts(i)%name)
         if (len(known) == 0) cycle
         if (.not. (is_near(plain(name), plain(known)) .or. &
                    plain(name) == plain(known(index(known, '/', back=.true.) + 1:)))) cycle
         if (edit_distance(plain(name), plain(known)) >= best) cycle
         best = edit_distance(plain(name), plain(known))
         hint = ' (did you mean '//known//'?)'
      end do
   end function meant_part

end module fw_part_names
