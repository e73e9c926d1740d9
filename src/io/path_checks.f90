!> What sweeps over a parameter and responses of a given amplitude do not go with, each with what to
!> use instead.
module fw_path_checks
   use fw_case, only: case_type, analysis_frf, analysis_point
   use fw_contact_data, only: memory_carried
   use fw_control_options, only: of_first_harmonic
   use fw_error, only: error_type, fatal_error, status_input
   use fw_harmonics_options, only: method_hdhb
   use fw_kinds, only: wp
   use fw_parameter_checks, only: check_parameter
   use fw_parameter_sweep, only: as_factor
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: friction_coefficient, gap, harmonic_scale, is_of_matrices, &
                            normal_load, normal_stiffness, parameter_words, spring_coefficient, &
                            static_scale, tangential_stiffness
   use fw_solver_options, only: jacobian_analytic
   use fw_solver_options, only: solver_newton
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: check_parameter_sweep, check_control

contains

   !> A sweep over another parameter than the frequency.
   subroutine check_parameter_sweep(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: asks = 'sweep%parameter'
      character(:), allocatable :: with, name

      if (.not. case%over%is_wanted()) return
      call check_parameter(case, case%over%number, asks, error)
      if (.not. allocated(error)) call check_values(case, error)
      if (allocated(error)) return
      name = "'"//trim(parameter_words(case%over%number))//"'"
      if (case%sensitivity%is_wanted()) then
         with = 'sensitivity%parameters: derivatives are those at the values of the case'
      else if (case%output%tail > 0) then
         with = 'output%tail: take more n_harmonics'
      else if (case%sweep%refine) then
         with = 'sweep%refine: no maxima are looked for'
      end if
      if (allocated(with)) call fatal_error(error, asks//' = '//name//' does not go with '// &
                                            with//'; leave one of the two out', status_input)
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

   !> A response of a given amplitude.
   subroutine check_control(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: asks = 'control%amplitude'
      character(:), allocatable :: with

      if (.not. case%control%is_wanted()) return
      ! The factor of the load is an unknown of its own: what follows solves without such a border,
      ! or for a load that the case gives.
      if (all(case%analysis /= [analysis_frf, analysis_point])) then
         with = "case%analysis: use 'frf' or 'point'"
      else if (case%over%number == harmonic_scale) then
         with = "sweep%parameter = 'load%harmonic_scale': the load is found for each "// &
                'amplitude; sweep frequencies, or another parameter'
      else if (case%over%number == static_scale .and. product(case%over%ends()) <= 0.0_wp) then
         with = "sweep%parameter = 'load%static_scale' through 0: sweep on one side of it"
      else if (case%solver%kind /= solver_newton) then
         with = "solver%kind: use 'newton'"
      else if (case%solver%jacobian /= jacobian_analytic) then
         with = "solver%jacobian: use 'analytic'"
      else if (case%harmonics%method == method_hdhb) then
         with = "harmonics%method = 'hdhb': use 'hbm'"
      else if (case%harmonics%adaptive) then
         with = 'harmonics%adaptive: give n_harmonics'
      else if (case%harmonics%accuracy > 0.0_wp) then
         with = 'harmonics%accuracy: give n_harmonics'
      else if (case%contact%memory == memory_carried .and. case%contact%n_pairs > 0) then
         with = "contact%memory = 'carried': use 'assembly'"
      else if (case%sweep%refine) then
         with = 'sweep%refine: no maxima are looked for'
      else if (case%output%tail > 0) then
         with = 'output%tail: take more n_harmonics'
      end if
      if (allocated(with)) then
         call fatal_error(error, asks//' does not go with '//with//'; or leave &control out', &
                          status_input)
         return
      end if
      call check_loads(case, error)
   end subroutine check_control

   !> What is to be scaled has to be there, and to drive what is controlled. (Loads of sectors are
   !> known by their waves only: a load that does not drive it shows at the first point.)
   subroutine check_loads(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      logical :: first, others

      if (.not. abs(case%model%harmonic_scale) > 0.0_wp) then
         call fatal_error(error, 'control%amplitude needs a vibratory load to scale, and '// &
                          'load%harmonic_scale is 0: give another', status_input)
         return
      end if
      if (case%model%cyclic%is_cyclic) return
      first = any(abs(case%model%load_cosine) > 0.0_wp) .or. &
              any(abs(case%model%load_sine) > 0.0_wp)
      others = .false.
      if (allocated(case%model%load_wave)) then
         others = any(abs(case%model%load_wave) > 0.0_wp)
         if (allocated(case%model%waves%harmonic)) first = first .or. &
            (others .and. any(case%model%waves%harmonic == 1))
      end if
      if (.not. (first .or. others)) then
         call fatal_error(error, 'control%amplitude needs a vibratory load to scale, and there '// &
                          'is none: set load%cosine or load%sine', status_input)
      else if (.not. first .and. case%control%of == of_first_harmonic) then
         call fatal_error(error, "control%of = 'first_harmonic' needs a load in harmonic 1, "// &
                          "and there is none: use 'largest'", status_input)
      end if
   end subroutine check_loads

end module fw_path_checks
