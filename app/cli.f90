!> The command line of fw_run as data.
module fw_cli
   use fw_error, only: error_type, fatal_error, status_usage
   use fw_paths, only: resolve_path
   use fw_text, only: string_type, nearest_word
   use fw_text_list, only: append
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: cli_options, get_arguments, parse_arguments

   type :: cli_options
      !> Path of the namelist.
      character(:), allocatable :: input
      !> Absolute path of the result to be continued.
      character(:), allocatable :: restart
      !> `group%key=value` each, in the order given.
      type(string_type), allocatable :: overrides(:)
      logical :: check = .false.
      !> Say why points were not found.
      logical :: explain = .false.
      !> Show the keys of the namelist, all or those of the group `input`, for a program or not.
      logical :: keys = .false., keys_as_json = .false.
      !> Show which keys do not go together.
      logical :: rules = .false.
      !> Show the parts of a model file and do nothing.
      logical :: parts = .false.
      !> Show what runs may remark and do nothing.
      logical :: remarks = .false.
      !> Show messages with what to do, and do nothing.
      logical :: messages = .false.
      logical :: quiet = .false.
      logical :: verbose = .false.
      logical :: help = .false.
      logical :: version = .false.
   end type cli_options

   character(*), parameter :: hint = '; try fw_run --help'

contains

   !> The arguments that the program was started with.
   subroutine get_arguments(arguments)
      type(string_type), allocatable, intent(out) :: arguments(:)
      integer :: i, length

      allocate (arguments(command_argument_count()))
      do i = 1, size(arguments)
         call get_command_argument(i, length=length)
         allocate (character(length) :: arguments(i)%text)
         call get_command_argument(i, value=arguments(i)%text)
      end do
   end subroutine get_arguments

   !> Options and the one namelist; `--` ends the options.
   subroutine parse_arguments(arguments, options, error)
      type(string_type), intent(in) :: arguments(:)
      type(cli_options), intent(out) :: options
      type(error_type), allocatable, intent(out) :: error
      logical :: options_ended
      integer :: i

      allocate (options%overrides(0))
      options_ended = .false.
      i = 1
      do while (i <= size(arguments))
         associate (word => arguments(i)%text)
            if (options_ended .or. len(word) < 2 .or. index(word, '-') /= 1) then
               call take_input(word, options, error)
            else if (word == '--') then
               options_ended = .true.
            else if (word(1:2) == '--') then
               call take_long(arguments, i, options, error)
            else
               call take_short(arguments, i, options, error)
            end if
         end associate
         if (allocated(error)) return
         i = i + 1
      end do
      if (options%help .or. options%version .or. options%keys .or. &
          options%rules .or. options%parts .or. options%remarks .or. options%messages) return
      if (options%quiet .and. options%verbose) then
         call fatal_error(error, '-q and -v exclude each other'//hint, status_usage)
      else if (.not. allocated(options%input)) then
         call fatal_error(error, 'no namelist is given: fw_run [options] case.nml'//hint, &
                          status_usage)
      end if
   end subroutine parse_arguments

   subroutine take_input(word, options, error)
      character(*), intent(in) :: word
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error

      if (len_trim(word) == 0) then
         call fatal_error(error, 'the name of the namelist is empty'//hint, status_usage)
      else if (allocated(options%input)) then
         call fatal_error(error, "one namelist at a time: '"//options%input//"' and '"//word// &
                          "' are given"//hint, status_usage)
      else
         options%input = word
      end if
   end subroutine take_input

   !> `--name`, `--name=value` or `--name value`.
   subroutine take_long(arguments, i, options, error)
      type(string_type), intent(in) :: arguments(:)
      !> Position of the option; moved to its value where that is an argument of its own.
      integer, intent(inout) :: i
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: name
      integer :: equals

      name = arguments(i)%text
      equals = index(name, '=')
      if (equals > 0) name = name(:equals - 1)
      select case (name)
      case ('--keys')
         options%keys = .true.
         options%keys_as_json = arguments(i)%text == '--keys=json'
         if (equals > 0 .and. .not. options%keys_as_json) then
            call fatal_error(error, '--keys may be followed by =json and by nothing else'//hint, &
                             status_usage)
         end if
      case ('--set', '--output', '--restart')
         if (equals > 0) then
            call take_value(name, arguments(i)%text(equals + 1:), options, error)
         else
            call take_next(name, arguments, i, options, error)
         end if
      case default
         if (equals > 0 .and. is_flag(name)) then
            call fatal_error(error, name//' takes no value'//hint, status_usage)
         else
            call set_flag(name, options, error)
         end if
      end select
   end subroutine take_long

   !> `-q`, several in one as in `-vo FILE`, or with the value attached as in `-oFILE`.
   subroutine take_short(arguments, i, options, error)
      type(string_type), intent(in) :: arguments(:)
      integer, intent(inout) :: i
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: word
      integer :: k

      word = arguments(i)%text
      do k = 2, len(word)
         if (word(k:k) /= 'o') then
            call set_flag('-'//word(k:k), options, error)
         else if (k < len(word)) then
            call take_value('-o', word(k + 1:), options, error)
         else
            call take_next('-o', arguments, i, options, error)
         end if
         if (word(k:k) == 'o' .or. allocated(error)) return
      end do
   end subroutine take_short

   subroutine take_next(name, arguments, i, options, error)
      character(*), intent(in) :: name
      type(string_type), intent(in) :: arguments(:)
      integer, intent(inout) :: i
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error

      i = i + 1
      if (i <= size(arguments)) then
         call take_value(name, arguments(i)%text, options, error)
      else
         call fatal_error(error, name//' lacks its value'//hint, status_usage)
      end if
   end subroutine take_next

   !> A result file named on the command line starts at the current directory, not at that of
   !> the namelist.
   subroutine take_value(name, value, options, error)
      character(*), intent(in) :: name, value
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: override

      override = value
      if (len_trim(value) == 0) then
         call fatal_error(error, name//' lacks its value'//hint, status_usage)
      else if (name == '--restart') then
         if (allocated(options%restart)) call fatal_error(error, 'one result can be continued '// &
                                                 'at a time: --restart is given twice'//hint, &
                                                          status_usage)
         options%restart = resolve_path(value, '')
         return
      else if (name /= '--set') then
         override = 'output%file='//quoted_text(resolve_path(value, ''))
      end if
      call append(options%overrides, override)
   end subroutine take_value

   subroutine set_flag(name, options, error)
      character(*), intent(in) :: name
      type(cli_options), intent(inout) :: options
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('--check')
         options%check = .true.
      case ('--explain')
         options%explain = .true.
      case ('--rules')
         options%rules = .true.
      case ('--parts')
         options%parts = .true.
      case ('--remarks')
         options%remarks = .true.
      case ('--messages')
         options%messages = .true.
      case ('-q', '--quiet')
         options%quiet = .true.
      case ('-v', '--verbose')
         options%verbose = .true.
      case ('-h', '--help')
         options%help = .true.
      case ('--version')
         options%version = .true.
      case default
         call fatal_error(error, "there is no option '"//name//"'"//near(name), status_usage)
      end select
   end subroutine set_flag

   pure logical function is_flag(name)
      character(*), intent(in) :: name

      is_flag = any(name == [character(10) :: '--check', '--explain', '--rules', '--parts', &
                             '--remarks', '--messages', '--quiet', '--verbose', '--help', &
                             '--version'])
   end function is_flag

   function near(name) result(text)
      character(*), intent(in) :: name
      character(:), allocatable :: text
      character(*), parameter :: names(*) = [character(10) :: '--set', '--output', '--restart', &
         '--keys', '--rules', '--parts', '--remarks', '--messages', '--check', '--explain', &
         '--quiet', '--verbose', '--help', '--version']
      type(string_type) :: options(size(names))
      integer :: i

      text = ''
      if (index(name, '--') == 1) then
         do i = 1, size(names)
            options(i)%text = trim(names(i))
         end do
         text = nearest_word(name, options)
      end if
      if (len(text) > 0) then
         text = '; did you mean '//text//'?'
      else
         text = hint
      end if
   end function near

end module fw_cli
