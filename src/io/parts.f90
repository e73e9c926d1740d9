!> The list of the parts of a model, as `bind_parts` of fw_raw_model declares them: what refuses and
!> lists parts goes by it. The constants of contact laws are those that the laws declare in their
!> `bind_keys`.
module fw_parts
   use fw_contact_data, only: contact_type
   use fw_contact_keys, only: ask_laws
   use fw_key, only: key_type
   use fw_part, only: part_source, part_type
   use fw_raw_model, only: raw_model
   use fw_reader, only: reader_type
   implicit none (type, external)
   private

   public :: is_of_kind, keys_of_laws, model_parts, names_to_put, part_type, put_name, &
             write_parts

   !> Writes down what there is.
   type, extends(part_source) :: part_list
      type(part_type), allocatable :: parts(:)
   contains
      procedure :: seek => add_part
      procedure :: numbers => any_number
      procedure :: note => add_note
   end type part_list

contains

   !> All parts, in the order of the documents.
   function model_parts() result(parts)
      type(part_type), allocatable :: parts(:)
      type(part_list) :: list
      type(raw_model) :: nothing

      allocate (list%parts(0))
      list%constants = keys_of_laws()
      call nothing%bind_parts(list)
      call move_alloc(list%parts, parts)
   end function model_parts

   subroutine add_part(self, part, found)
      class(part_list), intent(inout) :: self
      type(part_type), intent(in) :: part
      logical, intent(out) :: found

      self%parts = [self%parts, part]
      found = .false.
   end subroutine add_part

   subroutine add_note(self, kind, part)
      class(part_list), intent(inout) :: self
      character(*), intent(in) :: kind
      type(part_type), intent(in) :: part

      self%parts = [self%parts, part]
      self%parts(size(self%parts))%kind = kind
   end subroutine add_note

   !> One stands for all.
   subroutine any_number(self, part, least, most, list)
      class(part_list), intent(inout) :: self
      type(part_type), intent(in) :: part
      integer, intent(in) :: least, most
      integer, allocatable, intent(out) :: list(:)

      associate (unused => self, of => part, neither => most)
      end associate
      list = [max(0, least)]
   end subroutine any_number

   !> The name by which a calling program gives a part; empty of those that only files have.
   pure function put_name(name) result(text)
      !> Of a row of the table.
      character(*), intent(in) :: name
      character(:), allocatable :: text
      character(*), parameter :: of_files(*) = [character(17) :: '@format', '@format_version', &
         '@parameters', '@disk_parameters', 'contact@law', 'observe/name', 'observe/dof', &
         'observe/matrix', 'cyclic@n_physical', 'cyclic@phase']
      integer :: at

      text = ''
      if (any(of_files == name) .or. index(name, 'mesh/') == 1) return
      text = trim(name)
      at = index(name, '@')
      if (at == 1) text = trim(name(2:))
      if (at > 1) text(at:at) = '/'
   end function put_name

   !> Whether a part is given as numbers of a kind: complex ones as pairs of reals.
   pure logical function is_of_kind(part, kind)
      type(part_type), intent(in) :: part
      character(*), intent(in) :: kind

      is_of_kind = part%kind == kind .or. (kind == 'real' .and. part%kind == 'complex')
   end function is_of_kind

   !> Names of the parts of a kind that calling programs give: `a, b, c`. Of a name in a group that
   !> there is, those of that group; else the others, and each group once, as `group/...`.
   function names_to_put(kind, name) result(text)
      !> Kind: such as real. Name: what a program gave, 'group/part' or 'part'.
      character(*), intent(in) :: kind, name
      character(:), allocatable :: text, group, before, row
      type(part_type), allocatable :: parts(:)
      logical :: is_known
      integer :: i

      parts = model_parts()
      group = group_of(name)
      is_known = len(group) > 0 .and. any([(is_wanted(parts(i)) .and. &
                                            index(parts(i)%name, group) == 1, i=1, size(parts))])
      text = ''
      before = ''
      do i = 1, size(parts)
         if (.not. is_wanted(parts(i))) cycle
         row = put_name(parts(i)%name)
         if (is_known .and. index(row, group) /= 1) cycle
         if (.not. is_known .and. len(group_of(row)) > 0) then
            if (group_of(row) == before) cycle
            before = group_of(row)
            row = before//'...'
         end if
         if (len(text) > 0) text = text//', '
         text = text//row
      end do

   contains

      pure logical function is_wanted(part)
         type(part_type), intent(in) :: part

         is_wanted = len(put_name(part%name)) > 0 .and. is_of_kind(part, kind)
      end function is_wanted

   end function names_to_put

   !> `group/` of `group/part`, nothing of a part that stands alone. Messages that would list every
   !> part were cut before they came to those that were meant.
   pure function group_of(name) result(group)
      character(*), intent(in) :: name
      character(:), allocatable :: group

      group = name(:index(name, '/'))
   end function group_of

   !> Keys of the constants of pairs that laws declare.
   function keys_of_laws() result(keys)
      type(key_type), allocatable :: keys(:)
      type(contact_type) :: contact
      type(reader_type) :: nobody

      call ask_laws(nobody, contact)
      call move_alloc(contact%constants%named, keys)
   end function keys_of_laws

   !> The table as Markdown.
   subroutine write_parts(unit)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      type(part_type), allocatable :: parts(:)
      integer :: i

      parts = model_parts()
      write (unit, '(a)') '| name | kind | shape | required | meaning |', '|---|---|---|---|---|'
      do i = 1, size(parts)
         write (unit, '(11a)') '| ', shown_name(parts(i)%name), ' | ', trim(parts(i)%kind), ' | ', &
            shown_shape(parts(i)), ' | ', trim(parts(i)%needed), ' | ', trim(parts(i)%meaning), &
            ' |'
      end do
   end subroutine write_parts

   !> `/contact/mu`, `/contact` attribute `law`.
   pure function shown_name(name) result(text)
      character(*), intent(in) :: name
      character(:), allocatable :: text
      integer :: at

      at = index(name, '@')
      text = '`/'//trim(name)//'`'
      if (at > 0) text = '`/'//name(:at - 1)//'` attribute `'//trim(name(at + 1:))//'`'
   end function shown_name

   !> `(pair, 3)`, `(pair) or scalar`; nothing of attributes.
   pure function shown_shape(part) result(text)
      type(part_type), intent(in) :: part
      character(:), allocatable :: text
      character(*), parameter :: scalar = 'one_or '
      character(:), allocatable :: words
      integer :: i

      text = ''
      if (part%shape == '') return
      words = trim(part%shape)
      if (index(words, scalar) == 1) words = words(len(scalar) + 1:)
      if (part%kind == 'complex') words = words//' 2'
      do i = 1, len(words)
         if (words(i:i) == ' ') then
            text = text//', '
         else
            text = text//merge(' ', words(i:i), words(i:i) == '_')
         end if
      end do
      text = '('//text//')'
      if (index(part%shape, scalar) == 1) text = text//' or scalar'
   end function shown_shape

end module fw_parts
