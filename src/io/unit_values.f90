!> Values with units in a namelist, such as '30 N' or '5 um': they become numbers in the units of
!> the model before any key is read, so that no key needs to know of it.
!>
!> The units of keys are those of their declarations, where L, M, s and F are units of the model.
!> Those of a sweep or a track are units of what it goes over, those of frequencies what `unit` of
!> their group says, and those of springs follow from the power.
!>
!> What cannot be converted is recorded with its place, like every other problem of the input; the
!> reading ends there, because the keys would only say once more that a text is no number.
module fw_unit_values
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_namelist, only: parse_override
   use fw_namelist_data, only: add_entry, entry_type, last_entry, value_type
   use fw_reader, only: reader_type
   use fw_reader_text, only: shown
   use fw_records, only: record_list
   use fw_text, only: lower_case, to_text
   use fw_unit_table, only: is_same_kind, read_unit, unit_type
   use fw_values, only: number_text, read_real
   implicit none (type, external)
   private

   public :: has_units, needs_system, convert_units

   character(*), parameter :: example = "'mm-tonne-s-N'"

contains

   !> Whether some value may carry a unit; seldom, so that most cases need nothing of this.
   pure logical function has_units(reader) result(has)
      type(reader_type), intent(in) :: reader
      integer :: i

      has = .false.
      do i = 1, reader%namelist%n_entries
         ! A title such as '5 mm' is taken for one here, and left alone later.
         has = is_quantity(reader%namelist%entries(i))
         if (has) return
      end do
   end function has_units

   !> Whether an assignment has a value that may be a number with a unit.
   pure logical function is_quantity(entry)
      type(entry_type), intent(in) :: entry
      integer :: k, number_end, unit_start

      is_quantity = .false.
      do k = 1, size(entry%values)
         if (.not. (entry%values(k)%quoted .or. allocated(entry%raw))) cycle
         call split_quantity(entry%values(k)%text, number_end, unit_start)
         is_quantity = is_quantity .or. unit_start > 0
      end do
      ! Options need no quotes: the unit is a word of its own then.
      if (allocated(entry%raw)) is_quantity = is_quantity .or. scan(entry%raw, ' ') > 0
   end function is_quantity

   !> Whether a value can be converted only where the units of the model are known, for which a file
   !> may have to be opened.
   logical function needs_system(reader, keys) result(needs)
      type(reader_type), intent(in) :: reader
      type(record_list), intent(in) :: keys
      character(40) :: unit
      logical :: is_number
      integer :: i

      needs = .false.
      do i = 1, reader%namelist%n_entries
         if (.not. is_quantity(reader%namelist%entries(i))) cycle
         call find_unit(reader, keys, i, unit, is_number)
         needs = needs .or. (is_number .and. scan(unit, 'LMF') > 0)
      end do
   end function needs_system

   !> Refuse a system of units that is none: four units, one newton for one kilogram in one metre
   !> per second squared. `ok` is false too where nothing is said.
   subroutine check_system(text, system, ok, message)
      character(*), intent(in) :: text
      type(unit_type), intent(out) :: system(4)
      logical, intent(out) :: ok
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      ! Of length, mass and time in a length, a mass, a time and a force.
      integer, parameter :: powers(3, 4) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, -2], [3, 4])
      real(wp), parameter :: round_off = 1.0e-9_wp
      character(:), allocatable :: rest
      integer :: dash, k
      real(wp) :: ratio

      ok = .false.
      rest = text//'-'
      do k = 1, 4
         dash = index(rest, '-')
         if (dash == 0) return
         call read_unit(rest(:dash - 1), system(k), ok)
         if (ok) ok = all(system(k)%powers == powers(:, k))
         if (.not. ok) return
         rest = rest(dash + 1:)
      end do
      ok = len(rest) == 0
      if (.not. ok) return
      ! With kg, mm and N every frequency were off by a factor of 31.6 without a word.
      ratio = system(2)%factor*system(1)%factor/system(3)%factor**2/system(4)%factor
      if (abs(ratio - 1.0_wp) <= round_off) return
      ok = .false.
      message = "'"//text//"' is no consistent system of units: one mass times one length per "// &
                'square of one time is '//number_text(ratio)//' forces, must be 1, as with '// &
                example
   end subroutine check_system

   !> Every value with a unit as a number in that of its key; what cannot be so is recorded.
   subroutine convert_units(reader, keys, text)
      type(reader_type), intent(inout) :: reader
      !> All keys that there are.
      type(record_list), intent(in) :: keys
      !> System of units of the model, such as 'mm-tonne-s-N'; empty where it says nothing.
      character(*), intent(in) :: text
      type(unit_type) :: system(4)
      character(:), allocatable :: message
      character(40) :: unit
      integer :: i, last
      logical :: is_known, is_number

      call check_system(text, system, is_known, message)
      if (allocated(message)) then
         call reader%refuse('model', 'unit_system', '= '//message)
         return
      end if
      ! What is added here needs no conversion.
      last = reader%namelist%n_entries
      call take_hertz(reader)
      do i = 1, last
         if (.not. is_quantity(reader%namelist%entries(i))) cycle
         call find_unit(reader, keys, i, unit, is_number)
         if (is_number) call convert_entry(reader, i, trim(unit), text, system, &
                                           is_known)
      end do
   end subroutine convert_units

   !> The unit of the key of an assignment.
   subroutine find_unit(reader, keys, i_entry, unit, is_number)
      type(reader_type), intent(in) :: reader
      type(record_list), intent(in) :: keys
      integer, intent(in) :: i_entry
      ! Longest of a declaration: 20.
      character(40), intent(out) :: unit
      !> False for keys that are not known, which is told later, and for words and texts, which are
      !> what they are.
      logical, intent(out) :: is_number
      integer :: k

      unit = ''
      is_number = .false.
      associate (entry => reader%namelist%entries(i_entry))
         do k = 1, keys%n
            if (keys%records(k)%key%name /= entry%key) cycle
            if (keys%records(k)%group /= entry%group) cycle
            is_number = any(keys%records(k)%kind == [character(7) :: 'real', 'integer'])
            if (is_number) unit = unit_of(reader, entry, keys%records(k)%key%unit, keys)
            return
         end do
      end associate
   end subroutine find_unit

   !> Frequencies typed in hertz are those of a sweep in hertz, where it does not say.
   subroutine take_hertz(reader)
      type(reader_type), intent(inout) :: reader
      character(*), parameter :: keys(*) = [character(9) :: 'start', 'end', 'values', 'frequency']
      type(entry_type) :: new
      type(error_type), allocatable :: ignored
      integer :: i, k
      logical :: is_typed

      if (reader%given('sweep', 'unit')) return
      is_typed = .false.
      do i = 1, reader%namelist%n_entries
         associate (entry => reader%namelist%entries(i))
            if (entry%group /= 'sweep' .or. all(keys /= entry%key)) cycle
            do k = 1, size(entry%values)
               is_typed = is_typed .or. index(lower_case(entry%values(k)%text), 'hz') > 0
            end do
         end associate
      end do
      if (.not. is_typed) return
      ! Behind everything else, as the last option would be; numbers beside it are in hertz too.
      call parse_override("sweep%unit='Hz'", new, ignored)
      call add_entry(reader%namelist, new)
   end subroutine take_hertz

   !> The unit of a key: its own, that of the parameter it stands for, or the one that another key
   !> of the group says. Blank: none.
   character(40) function unit_of(reader, entry, declared, keys) result(unit)
      type(reader_type), intent(in) :: reader
      type(entry_type), intent(in) :: entry
      character(*), intent(in) :: declared
      type(record_list), intent(in) :: keys
      character(*), parameter :: hertz = 'Hz'
      character(:), allocatable :: parameter
      integer :: k, at

      unit = declared
      if (is_of_parameter(entry)) then
         parameter = lower_case(reader%text_of(entry%group, 'parameter'))
         if (parameter /= 'frequency' .and. (len(parameter) > 0 .or. entry%group == 'resonance')) &
            then
            unit = ''
            ! Factors of what the case has are plain numbers.
            if (lower_case(reader%text_of(entry%group, 'as')) == 'factor') return
            at = index(parameter, '%')
            do k = 1, keys%n
               if (keys%records(k)%group//'%'//trim(keys%records(k)%key%name) == parameter) then
                  unit = keys%records(k)%key%unit
               end if
            end do
         else if (entry%key == 'values') then
            ! Frequencies by another name.
            unit = 'unit'
         end if
      end if
      if (unit == 'unit') then
         unit = 'rad/s'
         if (lower_case(reader%text_of(entry%group, 'unit')) == lower_case(hertz)) unit = hertz
      end if
      ! F/L^power.
      at = index(unit, 'power')
      if (at > 0) unit(at:) = spring_power(reader)
      if (entry%group == 'contact') unit = pressing_unit(reader, entry%key, unit)
   end function unit_of

   !> The same of what presses pairs along a curve: F/L^e of an exponent e that is whole, and all of
   !> them per area where the case says so.
   character(40) function pressing_unit(reader, key, declared) result(unit)
      type(reader_type), intent(in) :: reader
      character(*), intent(in) :: key, declared
      integer, parameter :: largest = 9
      integer :: e

      unit = declared
      if (all(key /= [character(18) :: 'normal_coefficient', 'reference_force', 'force'])) return
      e = merge(2, 0, index(lower_case(reader%text_of('contact', 'normal_per_area')), 't') > 0)
      if (key == 'normal_coefficient') then
         unit = 'F/L^??'
         associate (exponent => number_of_text(reader%text_of('contact', 'normal_exponent')))
            if (exponent < 1 .or. exponent > largest) return
            e = e + exponent
         end associate
      end if
      unit = 'F'
      if (e > 0) unit = 'F/L^'//trim(to_text(e))
   end function pressing_unit

   !> A whole number; 0 for any other text.
   pure integer function number_of_text(text) result(number)
      character(*), intent(in) :: text
      integer :: status

      number = 0
      if (len_trim(text) == 0 .or. verify(trim(text), '0123456789.') > 0) return
      if (index(text, '.') > 0) then
         if (verify(trim(text(index(text, '.') + 1:)), '0') > 0) return
      end if
      read (text(:scan(trim(text)//'.', '.') - 1), *, iostat=status) number
      if (status /= 0) number = 0
   end function number_of_text

   !> Keys whose unit is that of the parameter that a sweep, or a track, goes over.
   pure logical function is_of_parameter(entry)
      type(entry_type), intent(in) :: entry

      is_of_parameter = (entry%group == 'sweep' .and. &
                         any(entry%key == [character(6) :: 'start', 'end', 'values'])) .or. &
                        (entry%group == 'resonance' .and. &
                         any(entry%key == [character(6) :: 'start', 'end']))
   end function is_of_parameter

   !> The power of the springs, where they all have one that the case says.
   character(8) function spring_power(reader) result(power)
      type(reader_type), intent(in) :: reader
      integer :: i

      ! Not one power, or that of springs in a file, which nobody has read yet.
      power = '?'
      i = last_entry(reader%namelist, 'spring', 'power')
      if (i > 0) then
         associate (values => reader%namelist%entries(i)%values)
            if (size(values) > 0) then
               if (all_alike(values)) power = values(1)%text
            end if
         end associate
      else if (reader%given('spring', 'side_1')) then
         ! Springs of the case itself, so that no file gives them another.
         power = '3'
      end if
   end function spring_power

   !> Whether values are written alike; with repeat counts it does not matter how often.
   pure logical function all_alike(values)
      type(value_type), intent(in) :: values(:)
      integer :: k

      all_alike = .true.
      do k = 2, size(values)
         all_alike = all_alike .and. values(k)%text == values(1)%text
      end do
   end function all_alike

   !> The values of one assignment.
   subroutine convert_entry(reader, i_entry, unit, text, system, is_known)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: i_entry
      character(*), intent(in) :: unit, text
      type(unit_type), intent(in) :: system(4)
      logical, intent(in) :: is_known
      character(:), allocatable :: message, number
      integer :: k, number_end, unit_start

      call join_words(reader%namelist%entries(i_entry))
      do k = 1, size(reader%namelist%entries(i_entry)%values)
         associate (entry => reader%namelist%entries(i_entry))
            if (.not. (entry%values(k)%quoted .or. allocated(entry%raw))) cycle
            call split_quantity(entry%values(k)%text, number_end, unit_start)
            if (unit_start == 0) cycle
            call convert(entry%values(k)%text, number_end, unit_start, unit, text, system, &
                         is_known, number, message)
         end associate
         if (allocated(message)) then
            call blame_value(reader, i_entry, k, message)
            return
         end if
         associate (value => reader%namelist%entries(i_entry)%values(k))
            ! As if it had been typed: what reads the key later sees a number.
            value%text = number
            value%quoted = .false.
         end associate
      end do
      call retype(reader%namelist%entries(i_entry))
   end subroutine convert_entry

   !> Record what is wrong with a value, with file and line, or option, before it.
   subroutine blame_value(reader, i_entry, k, message)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: i_entry, k
      character(*), intent(in) :: message

      associate (entry => reader%namelist%entries(i_entry))
         call reader%blame(i_entry, '&'//entry%group//' '//entry%key//' = '// &
                           shown(entry%values(k))//': '//message, entry%values(k)%line)
      end associate
   end subroutine blame_value

   !> An override needs no quotes: `30 N` is read as two words.
   subroutine join_words(entry)
      type(entry_type), intent(inout) :: entry
      type(value_type), allocatable :: values(:)
      type(value_type) :: new
      character(:), allocatable :: rest
      integer :: comma, number_end, unit_start
      logical :: has_unit

      if (.not. allocated(entry%raw)) return
      ! With quotes it was read as in a file.
      if (scan(entry%raw, '''"') > 0) return
      allocate (values(0))
      has_unit = .false.
      rest = entry%raw//','
      do while (len(rest) > 0)
         comma = index(rest, ',')
         new%text = trim(adjustl(rest(:comma - 1)))
         call split_quantity(new%text, number_end, unit_start)
         has_unit = has_unit .or. unit_start > 0
         values = [values, new]
         rest = rest(comma + 1:)
      end do
      if (has_unit) call move_alloc(values, entry%values)
   end subroutine join_words

   !> What messages quote of an override, from its values.
   subroutine retype(entry)
      type(entry_type), intent(inout) :: entry
      integer :: k

      if (.not. allocated(entry%raw)) return
      entry%raw = ''
      do k = 1, size(entry%values)
         if (k > 1) entry%raw = entry%raw//', '
         if (entry%values(k)%repeat > 1) entry%raw = entry%raw//to_text(entry%values(k)%repeat)//'*'
         entry%raw = entry%raw//shown(entry%values(k))
      end do
   end subroutine retype

   !> One value in the unit of its key. Where it cannot be, `message` says why and what would do,
   !> and `number` is not to be used.
   subroutine convert(value, number_end, unit_start, unit, text, system, is_known, number, message)
      character(*), intent(in) :: value
      integer, intent(in) :: number_end, unit_start
      character(*), intent(in) :: unit, text
      type(unit_type), intent(in) :: system(4)
      logical, intent(in) :: is_known
      character(:), allocatable, intent(out) :: number, message
      type(unit_type) :: given, wanted
      character(:), allocatable :: of_model
      real(wp) :: found
      logical :: ok

      if (len(unit) == 0) then
         message = 'the key has no unit: must be a number'
      else if (index(unit, '??') > 0) then
         message = 'normal_exponent beside it is no whole number: must be a number'
      else if (index(unit, '?') > 0) then
         message = 'the powers of the springs differ or are not given beside it: must be a number'
      end if
      if (allocated(message)) return
      of_model = ''
      ! Seconds are those of the model only in a unit of mechanics: a limit of time is in seconds.
      if (scan(unit, 'LMF') > 0) then
         if (.not. is_known) then
            message = unknown_system(text)
            return
         end if
         of_model = ', such as those of '//text
         call read_unit(unit, wanted, ok, system)
      else
         call read_unit(unit, wanted, ok)
      end if
      if (.not. ok) then
         message = 'a unit of '//unit//' is too far from 1 to be converted: must be a number'
         return
      end if
      call read_unit(value(unit_start:), given, ok)
      if (.not. ok) then
         message = value(unit_start:)//' is no unit that is known here: must be one of '//unit// &
                   of_model//', or a number'
      else if (.not. is_same_kind(given, wanted)) then
         message = 'is in '//value(unit_start:)//', must be in a unit of '//unit//of_model
      else
         call read_real(value(:number_end), found, ok)
         ! Of the smallest numbers too, whose logarithm is no finite one.
         if (ok) ok = log10(max(abs(found), tiny(1.0_wp))) + log10(given%factor/wanted%factor) < &
                      log10(huge(1.0_wp)) - 1.0_wp
         if (.not. ok) message = value(:number_end)//' is no number, or too large in '//unit
         if (ok) number = number_text(scaled(found, given%factor/wanted%factor))
      end if
   end subroutine convert

   !> Why lengths, forces and masses cannot be converted.
   function unknown_system(text) result(message)
      character(*), intent(in) :: text
      character(:), allocatable :: message

      message = 'the model does not say its units'
      if (len(text) > 0) message = "the units of the model, '"//text//"', are not known here"
      message = message//': give &model unit_system, such as '//example//' (length, mass, time '// &
                'and force), or the value without a unit'
   end function unknown_system

   !> Powers of ten, of which nearly all factors are, without a rounding of their own.
   pure real(wp) function scaled(number, factor)
      real(wp), intent(in) :: number, factor
      real(wp), parameter :: round_off = 8.0_wp*epsilon(1.0_wp)
      ! Larger powers of ten are no exact numbers.
      integer, parameter :: most = 22
      integer :: power

      scaled = number*factor
      power = nint(log10(factor))
      if (abs(power) > most) return
      if (abs(factor/10.0_wp**power - 1.0_wp) > round_off) return
      if (power >= 0) scaled = number*10.0_wp**power
      if (power < 0) scaled = number/10.0_wp**(-power)
   end function scaled

   !> Where the number of `30 N` ends and its unit begins; 0 where it is no such value. The blank
   !> between them may be missing: 5um, 30N.
   pure subroutine split_quantity(text, number_end, unit_start)
      character(*), intent(in) :: text
      integer, intent(out) :: number_end, unit_start
      integer :: at, digits

      number_end = 0
      unit_start = 0
      at = 1
      if (len(text) == 0) return
      if (scan(text(1:1), '+-') > 0) at = 2
      digits = run_of(text, at, '0123456789.')
      if (digits == 0) return
      number_end = at + digits - 1
      ! An exponent has digits: 5d are five days.
      at = number_end + 1
      if (at < len(text)) then
         if (scan(text(at:at), 'eEdD') > 0) then
            digits = merge(1, 0, scan(text(at + 1:at + 1), '+-') > 0)
            if (run_of(text, at + 1 + digits, '0123456789') > 0) then
               number_end = at + digits + run_of(text, at + 1 + digits, '0123456789')
            end if
         end if
      end if
      at = number_end + 1 + run_of(text, number_end + 1, ' ')
      if (at > len(text)) return
      ! A letter, a letter of another alphabet, or 1/s behind a blank.
      if (is_letter(text(at:at)) .or. &
          (text(at:min(at + 1, len(text))) == '1/' .and. at > number_end + 1)) unit_start = at
   end subroutine split_quantity

   !> How many characters from a place on are of a set.
   pure integer function run_of(text, from, set)
      character(*), intent(in) :: text, set
      integer, intent(in) :: from

      run_of = 0
      if (from > len(text)) return
      run_of = verify(text(from:), set) - 1
      if (run_of < 0) run_of = len(text) - from + 1
   end function run_of

   !> Of units: Latin letters, and the bytes of others, such as those of a degree sign.
   pure logical function is_letter(character)
      character(1), intent(in) :: character

      is_letter = (character >= 'a' .and. character <= 'z') .or. &
                  (character >= 'A' .and. character <= 'Z') .or. iachar(character) > 127
   end function is_letter

end module fw_unit_values
