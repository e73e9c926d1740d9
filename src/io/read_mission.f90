!> Group &mission: its keys, and what the changes of its blocks may say.
module fw_read_mission
   use fw_error, only: error_type
   use fw_mission_options, only: mission_options
   use fw_namelist, only: parse_override
   use fw_namelist_data, only: entry_type
   use fw_paths, only: resolve_path
   use fw_reader, only: reader_type
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: read_mission, split_change

   character(*), parameter :: group = 'mission'

   !> Groups that hold for all blocks; of &wear and &contact what may differ, and what may not.
   character(*), parameter :: common_groups(*) = [character(12) :: 'case', 'mission', 'output', &
      'pseudo_time', 'sensitivity', 'control', 'mode', 'resonance', 'time']
   character(*), parameter :: own_wear_keys(*) = [character(16) :: 'coefficient', &
      'follow_resonance', 'mu_final', 'mu_scale']
   character(*), parameter :: common_contact_keys(*) = [character(9) :: 'n_pairs', 'side_1', &
      'side_2', 'sector_2', 'area', 'law', 'worn', 'worn_step', 'memory']

contains

   !> The keys, checked; the files that changes name are added to the inputs.
   subroutine read_mission(reader, directory, mission, inputs)
      type(reader_type), intent(inout) :: reader
      !> That relative paths count from.
      character(*), intent(in) :: directory
      type(mission_options), intent(inout) :: mission
      type(string_type), allocatable, intent(inout) :: inputs(:)
      logical :: are_texts
      integer :: b

      call mission%bind_keys(reader, are_texts)
      if (reader%failed()) return
      if (mission%n_blocks == 0) then
         if (reader%has_group(group) .and. .not. reader%given(group, 'n_blocks')) then
            call reader%refuse(group, 'n_blocks', 'is missing: must be the number of blocks of '// &
                               'a flight, or 0 for no mission')
         end if
         return
      end if
      if (.not. are_texts) call reader%refuse(group, 'change', 'and name must be texts in quotes')
      call fill(reader, 'change', mission%n_blocks, mission%change)
      call fill(reader, 'name', mission%n_blocks, mission%name)
      if (reader%failed()) return
      do b = 1, mission%n_blocks
         call check_change(reader, directory, b, mission%change(b)%text, inputs)
      end do
   end subroutine read_mission

   !> One text for each block, or none at all.
   subroutine fill(reader, key, n_blocks, texts)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: key
      integer, intent(in) :: n_blocks
      type(string_type), allocatable, intent(inout) :: texts(:)
      integer :: b

      if (size(texts) == n_blocks) return
      if (size(texts) > 0) then
         call reader%refuse(group, key, 'has '//to_text(size(texts))//' texts: must be one for '// &
                            'each of n_blocks = '//to_text(n_blocks)//" blocks, '' for none")
         return
      end if
      do b = 1, n_blocks
         if (key == 'name') then
            call append(texts, 'block '//to_text(b))
         else
            call append(texts, '')
         end if
      end do
   end subroutine fill

   !> Refuse what holds for all blocks.
   subroutine check_change(reader, directory, block, text, inputs)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: directory
      integer, intent(in) :: block
      character(*), intent(in) :: text
      type(string_type), allocatable, intent(inout) :: inputs(:)
      type(string_type), allocatable :: items(:)
      type(entry_type) :: entry
      type(error_type), allocatable :: error
      character(:), allocatable :: place
      integer :: i

      place = 'of block '//to_text(block)//': '
      call split_change(text, items)
      do i = 1, size(items)
         call parse_override(items(i)%text, entry, error, '')
         if (allocated(error)) then
            call reader%refuse(group, 'change', place//"'"//items(i)%text//"' must have the "// &
                               "form group%key=value, such as load%harmonic_scale=0.5, and "// &
                               'several be parted by semicolons')
            return
         end if
         if (is_common(entry%group, entry%key)) then
            call reader%refuse(group, 'change', place//entry%group//'%'//entry%key// &
                               ' holds for all blocks: give it in &'//entry%group)
         else if (index(entry%key, 'file') > 0 .and. size(entry%values) > 0) then
            if (len(entry%values(1)%text) > 0) call append(inputs, resolve_path( &
               entry%values(1)%text, directory))
         end if
      end do
   end subroutine check_change

   !> Whether a key is the same in all blocks.
   pure logical function is_common(group, key)
      character(*), intent(in) :: group, key

      select case (group)
      case ('wear')
         is_common = all(own_wear_keys /= key)
      case ('contact')
         is_common = any(common_contact_keys == key)
      case default
         is_common = any(common_groups == group)
      end select
   end function is_common

   !> The parts of a change between semicolons, those within quotes left alone; blank ones are none.
   subroutine split_change(text, items)
      character(*), intent(in) :: text
      type(string_type), allocatable, intent(out) :: items(:)
      character :: quote
      integer :: first, k

      allocate (items(0))
      quote = ' '
      first = 1
      do k = 1, len(text) + 1
         if (k <= len(text)) then
            if (quote /= ' ') then
               if (text(k:k) == quote) quote = ' '
               cycle
            else if (text(k:k) == '"' .or. text(k:k) == "'") then
               quote = text(k:k)
               cycle
            else if (text(k:k) /= ';') then
               cycle
            end if
         end if
         if (len_trim(text(first:k - 1)) > 0) call append(items, trim(adjustl(text(first:k - 1))))
         first = k + 1
      end do
   end subroutine split_change

end module fw_read_mission
