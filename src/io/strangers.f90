!> What stands in a model file and nothing reads: left out without a word, it would make another
!> model of the same file. In groups that are read everything has to be a part; beside them, and
!> beside the mesh, a name near to that of a part is refused, and what is left is remarked, so that
!> a file may hold data of its own.
module fw_strangers
   use fw_error, only: error_type, fatal_error
   use fw_hdf5, only: hdf5_file
   use fw_hdf5_members, only: kind_of, list_attributes, list_members
   use fw_part_names, only: hint_for, is_number
   use fw_parts, only: model_parts, part_type
   use fw_speed_parts, only: most_speeds
   use fw_text, only: lower_case, string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: find_strangers

   !> Names that other programs give to forces that are none here, and what to do.
   type :: not_offered_type
      character(20) :: name
      character(150) :: words
   end type not_offered_type

   character(*), parameter :: of_air = 'forces of the air do not depend on frequency here: '// &
      'give those of the frequency that matters as /aero/sector/M or /aero/nodal_diameter/K'
   character(*), parameter :: of_damping = 'give the matrix as /structural_damping, or '// &
      'model%loss_factor in the case'

   type(not_offered_type), parameter :: not_offered(*) = [ &
      not_offered_type('aero/frequency', of_air), &
      not_offered_type('aero/matrix', of_air), &
      not_offered_type('hysteretic_damping', of_damping), &
      not_offered_type('gyroscopic', 'give the matrix for each rad/s as /coriolis')]

   !> Attributes that programs write by themselves, or people as labels: no part of a model. A star
   !> stands for any ending.
   character(*), parameter :: labels(*) = [character(16) :: 'CLASS', 'TITLE', 'VERSION', 'NAME', &
      'FLAVOR', 'DIMENSION_*', 'REFERENCE_LIST', 'MATLAB_*', 'H5PATH', '_Netcdf4*', '_NCProp*', &
      '_FillValue', 'PYTABLES_*', 'units', 'unit', 'long_name', 'description', 'comment']

   !> Groups in which data of one's own may stand.
   character(*), parameter :: open_groups(*) = [character(4) :: '', 'mesh']

   !> One model file.
   type :: search_type
      type(hdf5_file) :: file
      type(part_type), allocatable :: parts(:)
      integer :: n_sectors = 1
      !> What nothing reads.
      type(string_type), allocatable :: unread(:)
   contains
      procedure :: walk
      procedure :: judge
      procedure :: judge_attributes
      procedure :: names_in
      procedure :: is_meant
   end type search_type

contains

   !> Refuse what is no part where parts are read, or has nearly the name of one; list the rest.
   subroutine find_strangers(file, n_sectors, unread, error)
      type(hdf5_file), intent(in) :: file
      !> 1 of a structure that is no sector.
      integer, intent(in) :: n_sectors
      type(string_type), allocatable, intent(out) :: unread(:)
      type(error_type), allocatable, intent(out) :: error
      type(search_type) :: search

      search%file = file
      search%n_sectors = max(1, n_sectors)
      search%parts = model_parts()
      allocate (search%unread(0))
      call search%walk('', '', error)
      call move_alloc(search%unread, unread)
   end subroutine find_strangers

   !> Every member and attribute of a group, and of the groups in it that are read.
   recursive subroutine walk(self, group, pattern, error)
      class(search_type), intent(inout) :: self
      !> Its path, and that of the table, without a slash before or behind.
      character(*), intent(in) :: group, pattern
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: members(:), known(:)
      integer, allocatable :: place(:)
      integer :: i, k

      call self%judge_attributes(group, pattern, error)
      if (allocated(error)) return
      call list_members(self%file, '/'//group, members)
      call self%names_in(pattern, known)
      allocate (place(size(members)), source=0)
      do i = 1, size(members)
         do k = 1, size(known)
            if (self%is_meant(members(i)%text, known(k)%text)) place(i) = k
         end do
         if (place(i) > 0) cycle
         call refuse_or_note(self, group, pattern, members(i)%text, known, error)
         if (allocated(error)) return
      end do
      ! What is in them may be wrong for the want of a part that has another name here.
      do i = 1, size(members)
         if (place(i) == 0) cycle
         call self%judge(joined(group, members(i)%text), joined(pattern, known(place(i))%text), &
                         error)
         if (allocated(error)) return
      end do
   end subroutine walk

   !> A name that the table knows: whether the right kind of object bears it.
   recursive subroutine judge(self, name, pattern, error)
      class(search_type), intent(inout) :: self
      character(*), intent(in) :: name, pattern
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: expected
      character(7) :: found

      found = kind_of(self%file, '/'//name)
      expected = 'group'
      if (any(self%parts%name == pattern)) expected = 'dataset'
      if (found /= expected) then
         call fatal_error(error, self%file%path//': /'//name//' is a '// &
                          trim(merge('link to nothing', found//'        ', found == 'link'))// &
                          ', expected a '//expected, self%file%status)
      else if (found == 'group') then
         call self%walk(name, pattern, error)
      else
         call self%judge_attributes(name, pattern, error)
      end if
   end subroutine judge

   !> Attributes of a group that is read, or of a dataset, which has none that are read.
   subroutine judge_attributes(self, object, pattern, error)
      class(search_type), intent(inout) :: self
      character(*), intent(in) :: object, pattern
      type(error_type), allocatable, intent(out) :: error
      type(string_type), allocatable :: names(:)
      character(:), allocatable :: hint
      integer :: i

      call list_attributes(self%file, '/'//object, names)
      do i = 1, size(names)
         if (any(self%parts%name == pattern//'@'//names(i)%text)) cycle
         if (is_label(names(i)%text)) cycle
         hint = hint_for(self%parts, names(i)%text, pattern, is_attribute=.true.)
         if (len(hint) > 0 .or. is_closed(self, pattern)) then
            call fatal_error(error, self%file%path//': attribute '//names(i)%text//' of /'// &
                             object//' is nothing that is read'//hint//'; expected there:'// &
                             attributes_of(self, pattern), self%file%status)
            return
         end if
         call append(self%unread, 'attribute '//names(i)%text//' of /'//object)
      end do
   end subroutine judge_attributes

   !> Names of the attributes that are read.
   pure function attributes_of(self, pattern) result(text)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: pattern
      character(:), allocatable :: text
      integer :: i

      text = ''
      do i = 1, size(self%parts)
         if (index(self%parts(i)%name, pattern//'@') /= 1) cycle
         text = text//trim(merge(', ', '  ', len(text) > 0))//' '// &
                trim(self%parts(i)%name(len(pattern) + 2:))
      end do
      if (len(text) == 0) text = ' none'
   end function attributes_of

   !> A member that is no part: refused, or noted where it can be data of one's own.
   subroutine refuse_or_note(self, group, pattern, member, known, error)
      class(search_type), intent(inout) :: self
      character(*), intent(in) :: group, pattern, member
      !> Names of the parts there.
      type(string_type), intent(in) :: known(:)
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: hint, name
      integer :: k

      name = joined(group, member)
      k = findloc(not_offered%name == joined(pattern, lower_case(member)), .true., dim=1)
      if (k > 0) then
         call refuse(self, name, 'is there, but '//trim(not_offered(k)%words), error)
         return
      end if
      hint = hint_for(self%parts, member, pattern, is_attribute=.false.)
      if (len(hint) == 0 .and. .not. is_closed(self, pattern)) then
         call append(self%unread, '/'//name)
         return
      end if
      hint = 'is nothing that is read'//hint//'; expected there:'
      do k = 1, size(known)
         hint = hint//trim(merge(', ', '  ', k > 1))//' '//shown(self, known(k)%text)
      end do
      call refuse(self, name, hint, error)
   end subroutine refuse_or_note

   !> Whether a group is read in whole, or is a dataset of these: not where data of one's own is.
   pure logical function is_closed(self, pattern)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: pattern

      is_closed = .not. (any(open_groups == pattern) .or. any(self%parts%name == pattern))
   end function is_closed

   !> What stands in a group of the table, groups and datasets, once each.
   pure subroutine names_in(self, pattern, names)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: pattern
      type(string_type), allocatable, intent(out) :: names(:)
      character(:), allocatable :: rest
      integer :: i, k, last

      allocate (names(0))
      do i = 1, size(self%parts)
         if (len(pattern) > 0 .and. index(self%parts(i)%name, pattern//'/') /= 1) cycle
         rest = trim(self%parts(i)%name(merge(len(pattern) + 2, 1, len(pattern) > 0):))
         last = scan(rest//'/', '/@') - 1
         ! Attributes of the group itself.
         if (last == 0) cycle
         do k = size(names), 1, -1
            if (names(k)%text == rest(:last)) exit
         end do
         if (k == 0) call append(names, rest(:last))
      end do
   end subroutine names_in

   !> Whether a member bears a name of the table, or a number that this stands for.
   pure logical function is_meant(self, member, known)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: member, known
      integer :: k, range(2)

      is_meant = member == known
      if (.not. is_number(known)) return
      is_meant = .false.
      range = numbers(self, known)
      do k = range(1), range(2)
         is_meant = is_meant .or. member == to_text(k)
      end do
   end function is_meant

   !> First and last number that a name of the table stands for. Nodal diameters above N/2 are the
   !> conjugates of others: what a file says of them would not count. J: sectors, I: speeds.
   pure function numbers(self, known) result(range)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: known
      integer :: range(2)

      range = [1 - self%n_sectors, self%n_sectors - 1]
      ! A number beyond these would be read by nobody.
      select case (known)
      case ('K'); range = [0, self%n_sectors/2]
      case ('J'); range = [0, self%n_sectors - 1]
      case ('I'); range = [0, most_speeds - 1]
      case default ! sectors before and behind another
      end select
   end function numbers

   !> A name of the table as messages have it.
   pure function shown(self, known) result(text)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: known
      character(:), allocatable :: text
      integer :: range(2)

      text = known
      if (is_number(known)) then
         range = numbers(self, known)
         text = 'a number from '//to_text(range(1))//' to '//to_text(range(2))
      end if
   end function shown

   !> Whether an attribute is a label.
   pure logical function is_label(name)
      character(*), intent(in) :: name
      integer :: i, star

      is_label = any(labels == name)
      do i = 1, size(labels)
         star = index(labels(i), '*')
         if (star > 0) is_label = is_label .or. index(name, labels(i)(:star - 1)) == 1
      end do
   end function is_label

   pure function joined(group, name) result(path)
      character(*), intent(in) :: group, name
      character(:), allocatable :: path

      path = name
      if (len(group) > 0) path = group//'/'//name
   end function joined

   !> An error: `text` continues "<file>: dataset /name ".
   subroutine refuse(self, name, text, error)
      class(search_type), intent(in) :: self
      character(*), intent(in) :: name, text
      type(error_type), allocatable, intent(out) :: error

      call fatal_error(error, self%file%path//': '//trim(kind_of(self%file, '/'//name))//' /'// &
                       name//' '//text, self%file%status)
   end subroutine refuse

end module fw_strangers
