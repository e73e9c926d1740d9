!> fw_run: read a case, run it, report. The only place that ends the program.
program fw_run_program
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use fw_blas, only: describe_blas, slow_kernel, text_length
   use fw_case, only: analyses, analysis_words, case_type
   use fw_cli, only: cli_options, get_arguments, parse_arguments
   use fw_error, only: error_type, fatal_error, status_ok, status_usage
   use fw_help, only: write_help
   use fw_signals, only: catch_interrupts
   use fw_key_text, only: write_keys
   use fw_remark_table, only: write_message_kinds, write_remark_kinds
   use fw_run_state, only: outcome_type
   use fw_progress, only: progress_type, new_progress
   use fw_solver_options, only: unit_hertz
   use fw_read_case, only: case_input, read_input
   use fw_reader_text, only: printable
   use fw_restart_trial, only: try_restart
   use fw_rules, only: write_rules
   use fw_parts, only: write_parts
   use fw_run, only: check_case, run_case
   use fw_run_modes, only: list_in_range
   use fw_text, only: string_type
   use fw_threads, only: thread_scope
   use fw_version, only: version
   implicit none (type, external)

   integer :: status

   call main(status)
   stop status, quiet=.true.

contains

   subroutine main(status)
      integer, intent(out) :: status
      type(string_type), allocatable :: arguments(:)
      type(cli_options) :: options
      type(error_type), allocatable :: error
      character(text_length) :: blas

      call get_arguments(arguments)
      call parse_arguments(arguments, options, error)
      status = status_ok
      if (.not. allocated(error)) then
         if (options%help) then
            call write_help(output_unit)
         else if (options%keys) then
            call show_keys(options, error)
         else if (options%rules) then
            call write_rules(output_unit)
         else if (options%parts) then
            call write_parts(output_unit)
         else if (options%remarks) then
            call write_remark_kinds(output_unit)
         else if (options%messages) then
            call write_message_kinds(output_unit)
         else if (options%version) then
            call describe_blas(blas)
            write (output_unit, '(a)') 'fw_run '//version, 'BLAS: '//trim(blas)
         else
            call run(options, status, error)
         end if
      end if
      if (allocated(error)) call report(error, status)
   end subroutine main

   !> The keys of all groups, or of one.
   subroutine show_keys(options, error)
      type(cli_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      if (allocated(options%input)) then
         call write_keys(output_unit, options%input, options%keys_as_json, error)
      else
         call write_keys(output_unit, '', options%keys_as_json, error)
      end if
   end subroutine show_keys

   !> Validate, then either show the effective input or compute.
   subroutine run(options, status, error)
      type(cli_options), intent(in) :: options
      integer, intent(inout) :: status
      type(error_type), allocatable, intent(out) :: error
      type(case_input) :: input
      type(case_type) :: case
      type(outcome_type) :: outcome
      type(progress_type) :: progress
      type(thread_scope) :: threads
      type(string_type), allocatable :: lines(:)
      integer :: i

      input%path = options%input
      input%overrides = options%overrides
      input%tries_files = .true.
      ! Damping and checks of a model must not depend on the threads of the BLAS either.
      call threads%enter(0)
      call read_input(input, case, error)
      call threads%leave()
      if (allocated(error)) return
      if (allocated(options%restart)) case%restart = options%restart
      call try_restart(case, error)
      if (allocated(error)) return
      if (options%check) then
         call check_case(case, error)
         if (allocated(error)) return
         write (output_unit, '(a)', advance='no') case%namelist
         call list_in_range(case, lines)
         do i = 1, size(lines)
            write (output_unit, '(a)') lines(i)%text
         end do
         return
      end if
      if (options%explain .and. .not. is_explained(case)) then
         call fatal_error(error, "--explain says why points of analysis = 'frf' or 'point' "// &
                          "were not found, but this case has analysis = '"// &
                          trim(analysis_words(case%analysis))//"'; leave --explain out", &
                          status_usage)
         return
      end if
      progress = new_progress(options%quiet, options%verbose, &
                              in_hertz=case%sweep%unit == unit_hertz, &
                              parameter_swept=case%over%number)
      call catch_interrupts()
      call run_case(case, progress, outcome, error, explains=options%explain)
      if (allocated(error)) return
      status = outcome%status
      if (options%quiet .or. .not. allocated(outcome%summary)) return
      do i = 1, size(outcome%summary)
         write (output_unit, '(a)') outcome%summary(i)%text
      end do
      call report_blas(options%verbose)
   end subroutine run

   !> Whether points of a case are such that a run can say why they were not found.
   pure logical function is_explained(case)
      type(case_type), intent(in) :: case

      associate (facts => analyses(case%analysis))
         is_explained = facts%is_response .and. .not. facts%is_population
      end associate
   end function is_explained

   !> The BLAS where it is asked for, and its remedy where it is slow.
   subroutine report_blas(verbose)
      logical, intent(in) :: verbose
      character(text_length) :: text, kernel, better
      logical :: is_slow

      call describe_blas(text)
      call slow_kernel(is_slow, kernel, better)
      if (verbose .or. is_slow) write (output_unit, '(a, t19, a)') 'BLAS', trim(text)
      if (is_slow) write (output_unit, '(a, t19, a)') 'slow BLAS', 'kernel '//trim(kernel)// &
         ' lacks vectors of this processor: set OPENBLAS_CORETYPE='//trim(better)// &
         ' in the environment, or install a newer OpenBLAS'
   end subroutine report_blas

   !> One line of the standard error for each line of the message.
   subroutine report(error, status)
      type(error_type), intent(inout) :: error
      integer, intent(out) :: status
      integer :: first, last

      status = error%status
      error%message = printable(error%message)
      first = 1
      do while (first <= len(error%message))
         last = index(error%message(first:), new_line('a'))
         last = merge(first + last - 2, len(error%message), last > 0)
         write (error_unit, '(a)') 'fw_run: error: '//error%message(first:last)
         first = last + 2
      end do
   end subroutine report

end program fw_run_program
