!> Values that a sweep over a parameter cannot take, each with what to do instead.
module fw_path_checks
   use fw_case, only: case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_parameter_checks, only: check_parameter
   use fw_parameter_sweep, only: as_factor
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: friction_coefficient, gap, harmonic_scale, is_of_matrices, &
      normal_load, normal_stiffness, parameter_words, spring_coefficient, static_scale, &
      tangential_stiffness
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: check_parameter_sweep

contains

   !> A sweep over another parameter than the frequency.
   subroutine check_parameter_sweep(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%over%is_wanted()) return
      call check_parameter(case, case%over%number, 'sweep%parameter', error)
      if (.not. allocated(error)) call check_values(case, error)
   end subroutine check_parameter_sweep

   !> Values that the parameter can take: one for all pairs (springs), in its range.
   subroutine check_values(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: base(:)
      logical, allocatable :: counts(:)
      real(wp) :: lowest

      associate (over => case%over)
         call get_parameter(case, over%number, base)
         counts = which_count(case, over%number)
         base = pack(base, counts)
         lowest = minval(over%ends())
         if (over%as == as_factor) then
            if (.not. any(abs(base) > 0.0_wp)) then
               call fatal_error(error, "sweep%as = 'factor': "// &
                                trim(parameter_words(over%number))//' is 0 in the case, and a '// &
                                "factor of it changes nothing; use 'value'", status_input)
               return
            end if
         else if (maxval(base) - minval(base) > 0.0_wp) then
            call fatal_error(error, 'sweep%parameter = '''// &
                             trim(parameter_words(over%number))//''': its values differ, from '// &
                             number_text(minval(base))//' to '//number_text(maxval(base))// &
                             ", and one value would replace them all; use sweep%as = 'factor'", &
                             status_input)
            return
         end if
         if (over%as == as_factor .and. is_of_matrices(over%number)) lowest = base(1)*lowest
         if ((any(over%number == [friction_coefficient, normal_load]) .or. &
              is_of_matrices(over%number)) .and. lowest < 0.0_wp) then
            call refuse_lowest('at least 0')
         else if (any(over%number == [tangential_stiffness, normal_stiffness]) .and. &
                  .not. lowest > 0.0_wp) then
            call refuse_lowest('above 0')
         end if
      end associate

   contains

      subroutine refuse_lowest(what)
         character(*), intent(in) :: what

         call fatal_error(error, 'sweep goes down to '//number_text(lowest)//' of '// &
                          trim(parameter_words(case%over%number))//': must be '//what, status_input)
      end subroutine refuse_lowest

   end subroutine check_values

   !> Pairs that a parameter is of; all springs, and the one value of loads and matrices.
   function which_count(case, number) result(counts)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      logical, allocatable :: counts(:)

      if (is_of_matrices(number)) then
         counts = [.true.]
         return
      end if
      select case (number)
      case (harmonic_scale, static_scale)
         counts = [.true.]
      case (spring_coefficient)
         allocate (counts(case%springs%n_springs), source=.true.)
      case default
         associate (c => case%contact)
            if (number == normal_load) then
               counts = c%side_1(3, :) == 0 .and. c%side_2(3, :) == 0
            else if (any(number == [gap, normal_stiffness])) then
               counts = c%side_1(3, :) /= 0 .or. c%side_2(3, :) /= 0
            else
               counts = any(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1)
            end if
         end associate
      end select
   end function which_count

end module fw_path_checks
