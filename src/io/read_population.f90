!> Group &population and the patterns of the model: what they must be to the rest of the case.
module fw_read_population
   use fw_case, only: analyses
   use fw_kinds, only: wp
   use fw_mistuning_parts, only: mistuning_parts
   use fw_population_options, only: population_options
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_population, take_patterns

contains

   !> The keys, of every case.
   subroutine read_population(reader, analysis, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: analysis
      !> Not allocated where the analysis is another one.
      type(population_options), allocatable, intent(out) :: options
      type(population_options), allocatable :: found

      allocate (found)
      call found%bind_keys(reader)
      if (analyses(analysis)%is_population) call move_alloc(found, options)
   end subroutine read_population

   !> Patterns in place of the blade frequencies, which are 0 from now on.
   subroutine take_patterns(reader, scale, n_sectors, is_mistuned, parts, options)
      type(reader_type), intent(inout) :: reader
      !> mistuning%scale.
      real(wp), intent(in) :: scale
      integer, intent(in) :: n_sectors
      logical, intent(in) :: is_mistuned
      !> Rows and patterns of the model.
      type(mistuning_parts), intent(inout) :: parts
      !> Takes the patterns.
      type(population_options), intent(inout) :: options
      character(*), parameter :: group = 'population'
      integer :: n, r, at(3)

      if (.not. is_mistuned) then
         call reader%refuse('cyclic', 'mistuned', "is missing: must be .true. with analysis = "// &
                            "'population', whose blades differ")
         return
      else if (.not. abs(scale) > 0.0_wp) then
         call reader%refuse('mistuning', 'scale', '= 0 makes every disk the tuned one: must be '// &
                            'another number')
         return
      end if
      r = 0
      if (allocated(parts%rows) .and. allocated(parts%row_omega)) r = size(parts%rows, 1)
      if (r == 0) then
         call reader%refuse(group, 'patterns', 'need rows of blade modes: must have '// &
                            'mistuning%rows and row_omega, or a model that has them')
         return
      end if
      if (allocated(options%patterns)) call unfold(reader, n_sectors, r, parts, options)
      if (reader%failed()) return
      if (.not. allocated(parts%patterns)) then
         call reader%refuse(group, 'patterns', 'is missing: must be blade frequencies, or '// &
                            'stand in /mistuning/patterns of the model')
         return
      end if
      n = size(parts%patterns, 3)
      if (n == 0 .or. options%n_patterns > n) then
         call reader%refuse(group, 'n_patterns', '= '//to_text(options%n_patterns)//', but '// &
                            'there are '//to_text(n)//' patterns: must be at least one, and '// &
                            'no more than there are')
         return
      end if
      if (size(parts%patterns, 1) /= r .or. size(parts%patterns, 2) /= n_sectors) then
         call reader%refuse(group, 'patterns', 'have '//to_text(size(parts%patterns, 2))//' x '// &
                            to_text(size(parts%patterns, 1))//' values each: must be '// &
                            to_text(n_sectors)//' x '//to_text(r)//', sectors by rows')
         return
      end if
      if (options%n_patterns > 0) n = options%n_patterns
      if (any(1.0_wp + scale*parts%patterns <= 0.0_wp)) then
         at = minloc(scale*parts%patterns)
         call reader%refuse(group, 'patterns', '= '// &
                            to_text(parts%patterns(at(1), at(2), at(3)))//' of sector '// &
                            to_text(at(2) - 1)//' in pattern '//to_text(at(3) - 1)// &
                            ', times scale = '//to_text(scale)//': must stay above -1')
         return
      end if
      options%blades%rows = parts%rows
      options%blades%row_omega = parts%row_omega
      options%blades%scale = scale
      options%blades%frequency = parts%patterns(:, :, :n)
      if (allocated(options%patterns)) deallocate (options%patterns)
      if (allocated(parts%frequency)) deallocate (parts%frequency)
      allocate (parts%frequency(r, n_sectors), source=0.0_wp)
   end subroutine take_patterns

   !> Patterns of the namelist, as they stand one behind the other.
   subroutine unfold(reader, n_sectors, r, parts, options)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_sectors
      !> Rows.
      integer, intent(in) :: r
      !> Their patterns are replaced.
      type(mistuning_parts), intent(inout) :: parts
      type(population_options), intent(in) :: options
      integer :: n, n_values

      n_values = size(options%patterns)
      n = options%n_patterns
      if (n == 0 .and. modulo(n_values, n_sectors) == 0 .and. r == 1) n = n_values/n_sectors
      if (n > 0 .and. n_values == n*n_sectors) then
         parts%patterns = reshape(spread(options%patterns, 1, r), [r, n_sectors, n])
      else if (n > 0 .and. n_values == n*n_sectors*r) then
         parts%patterns = reshape(options%patterns, [r, n_sectors, n])
      else
         call reader%refuse('population', 'patterns', 'has '//to_text(n_values)//' values with '// &
                            'n_patterns = '//to_text(options%n_patterns)//': must be '// &
                            'n_patterns times '//to_text(n_sectors)//', one for each sector, '// &
                            'or n_patterns times '//to_text(n_sectors*r)//', those of all rows '// &
                            'of each')
      end if
   end subroutine unfold

end module fw_read_population
