!> Groups &output and &control: the result file, what is observed, and amplitudes of that which are
!> given in place of the load.
module fw_read_output
   use fw_case, only: output_options
   use fw_control_options, only: control_options, of_first_harmonic
   use fw_key, only: key, key_visitor
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_raw_model, only: raw_model
   use fw_read_nodal, only: observe_nodal
   use fw_paths, only: resolve_path
   use fw_reader, only: reader_type
   use fw_reader_text, only: did_you_mean
   use fw_side, only: add_side
   use fw_text, only: string_type, to_text
   use fw_text_list, only: name_sectors
   use fw_values, only: read_integer, quoted_text
   implicit none (type, external)
   private

   public :: read_control, read_output, read_observed

contains

   !> Everything but `observe`. The path leaves absolute.
   subroutine read_output(reader, directory, options)
      type(reader_type), intent(inout) :: reader
      !> Of the namelist; relative files start there.
      character(*), intent(in) :: directory
      !> `file` holds its default on entry.
      type(output_options), intent(inout) :: options

      ! Whether somebody has named the file: the default is a name too.
      options%names_file = reader%given('output', 'file')
      call options%bind_keys(reader)
      if (len_trim(options%file) == 0) then
         call reader%refuse('output', 'file', "= '': must name a file")
      end if
      options%file = resolve_path(options%file, directory)
      call reader%amend('output', 'file', quoted_text(options%file))
   end subroutine read_output

   !> Key `observe`: dof numbers or names of the model file; all by default.
   subroutine read_observed(reader, raw, model)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(in) :: raw
      !> Its number of dofs is known.
      type(model_type), intent(inout) :: model
      type(string_type), allocatable :: chosen(:), names(:)
      logical, allocatable :: is_text(:)
      real(wp), allocatable :: rows(:, :), chosen_rows(:, :)
      integer :: i, most

      most = model%n_dof
      if (allocated(model%rows)) most = most + size(model%rows, 2)
      if (allocated(raw%observe_name)) most = most + size(raw%observe_name)
      call bind_observed(reader, most, chosen, is_text)
      if (reader%failed()) return
      ! Names of a file can be chosen, and dof numbers beside them.
      call list_default(raw, model%n_dof, names, rows)
      if (size(chosen) == 0) then
         call move_alloc(names, model%observe_name)
         call move_alloc(rows, chosen_rows)
      else
         allocate (model%observe_name(size(chosen)))
         allocate (chosen_rows(size(chosen), size(rows, 2)), source=0.0_wp)
         do i = 1, size(chosen)
            call choose(reader, chosen(i)%text, is_text(i), names, rows, model, &
                        model%observe_name(i)%text, chosen_rows(i, :))
            call refuse_repeated(reader, model%observe_name(:i))
            if (reader%failed()) return
         end do
      end if
      model%observe_matrix = chosen_rows(:, :model%n_dof)
      call observe_nodal(raw, chosen_rows(:, model%n_dof + 1:), model)
      if (model%cyclic%is_mistuned) call name_sectors(model%cyclic%n_sectors, model%observe_name)
   end subroutine read_observed

   !> The key of what is observed: numbers and names as they are given.
   subroutine bind_observed(keys, most, chosen, is_text)
      class(key_visitor), intent(inout) :: keys
      !> As many quantities there are.
      integer, intent(in) :: most
      type(string_type), allocatable, intent(out) :: chosen(:)
      !> Which of them are names.
      logical, allocatable, intent(out) :: is_text(:)

      call keys%bind_list(key('observe', 'dof number k is called uk, n_dof + k rowk', &
                              absent='all that the model file names, else every dof'), &
                          'dof numbers or names of observed quantities', most, chosen, is_text)
   end subroutine bind_observed

   !> What the model file observes, or every dof.
   subroutine list_default(raw, n_dof, names, rows)
      type(raw_model), intent(in) :: raw
      integer, intent(in) :: n_dof
      type(string_type), allocatable, intent(out) :: names(:)
      real(wp), allocatable, intent(out) :: rows(:, :)
      integer :: i, n

      if (allocated(raw%observe_matrix) .and. allocated(raw%observe_name)) then
         names = raw%observe_name
         rows = raw%observe_matrix
         return
      else if (allocated(raw%observe_name)) then
         ! Rows that stand with the nodal diameters: each is its own number there.
         names = raw%observe_name
         n = size(names)
         allocate (rows(n, n_dof + n), source=0.0_wp)
         do i = 1, n
            rows(i, n_dof + i) = 1.0_wp
         end do
         return
      end if
      allocate (names(n_dof))
      allocate (rows(n_dof, n_dof), source=0.0_wp)
      do i = 1, n_dof
         names(i)%text = 'u'//to_text(i)
         rows(i, i) = 1.0_wp
      end do
   end subroutine list_default

   !> One value of `observe`: a dof number, or a name.
   subroutine choose(reader, value, is_text, names, rows, model, name, row)
      type(reader_type), intent(inout) :: reader
      character(*), intent(in) :: value
      logical, intent(in) :: is_text
      type(string_type), intent(in) :: names(:)
      real(wp), intent(in) :: rows(:, :)
      type(model_type), intent(in) :: model
      character(:), allocatable, intent(out) :: name
      real(wp), intent(inout) :: row(:)
      integer :: dof, i, n_rows
      logical :: is_number, is_row

      name = value
      ! Names first: a model file may name a quantity by a number.
      do i = 1, size(names)
         if (names(i)%text /= value) cycle
         row = rows(i, :)
         return
      end do
      n_rows = 0
      if (allocated(model%rows)) n_rows = size(model%rows, 2)
      is_row = .false.
      if (index(value, 'row') == 1 .and. n_rows > 0) call read_integer(value(4:), dof, is_row)
      if (is_row) is_row = dof >= 1 .and. dof <= n_rows
      if (is_row) dof = model%n_dof + dof
      is_number = .false.
      if (.not. (is_row .or. is_text)) call read_integer(value, dof, is_number)
      if (is_row .or. is_number) then
         name = 'u'//to_text(dof)
         if (dof > model%n_dof) name = 'row'//to_text(dof - model%n_dof)
         if (dof >= 1 .and. dof <= model%n_dof + n_rows) then
            call add_side(dof, 1.0_wp, row(:model%n_dof), model%rows)
         else if (n_rows == 0) then
            call reader%refuse('output', 'observe', '= '//to_text(dof)// &
                               ': must be a dof from 1 to '//to_text(model%n_dof))
         else
            call reader%refuse('output', 'observe', '= '//to_text(dof)// &
                               ': must be a dof or a row, from 1 to '// &
                               to_text(model%n_dof + n_rows))
         end if
      else
         call reader%refuse('output', 'observe', '= '//quoted_text(value)// &
                            ': must be a dof number or a name of the model'// &
                            did_you_mean(value, names))
      end if
   end subroutine choose

   !> The last name must not be among those before it: results are looked up by name.
   subroutine refuse_repeated(reader, names)
      type(reader_type), intent(inout) :: reader
      type(string_type), intent(in) :: names(:)
      integer :: i, n

      n = size(names)
      do i = 1, n - 1
         if (names(i)%text == names(n)%text) then
            call reader%refuse('output', 'observe', 'names '//names(n)%text//' twice')
         end if
      end do
   end subroutine refuse_repeated

   !> Group &control.
   subroutine read_control(reader, model, options)
      type(reader_type), intent(inout) :: reader
      !> Its observed quantities are known, unless something failed before.
      type(model_type), intent(in) :: model
      type(control_options), intent(inout) :: options
      type(string_type), allocatable :: chosen(:)
      logical, allocatable :: is_text(:)
      character(*), parameter :: without = &
         'is given without amplitude: give it, or leave this out'
      integer :: i

      call options%bind_keys(reader)
      call reader%bind_list(key('observed', &
                                'the quantity that has it, by its name in output%observe', &
                                absent='the first one', only='amplitude'), 'an observed quantity', &
                            1, chosen, is_text)
      if (reader%failed()) return
      if (.not. options%is_wanted()) then
         ! The default of `of` stands in every case that is written out.
         if (options%of /= of_first_harmonic) call reader%refuse('control', 'of', without)
         if (reader%given('control', 'observed')) call reader%refuse('control', 'observed', without)
         return
      end if
      if (size(chosen) == 0 .or. .not. allocated(model%observe_name)) return
      associate (names => model%observe_name, word => chosen(1)%text)
         do i = 1, size(names)
            ! A dof number k is called uk.
            if (names(i)%text /= word .and. names(i)%text /= 'u'//word) cycle
            options%observed = i
            return
         end do
         call reader%refuse('control', 'observed', '= '//quoted_text(word)//': must be an '// &
                            'observed quantity'//did_you_mean(word, names))
      end associate
   end subroutine read_control

end module fw_read_output
