!> Parameters that a case cannot be differentiated by, or changed in, each with the reason, and
!> values that they cannot take: for every group that takes words of fw_parameters.
module fw_parameter_checks
   use fw_case, only: case_type
   use fw_contact_data, only: contact_type, memory_residual
   use fw_deviation, only: deviation_type, of_frequency
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_law_text, only: law_text
   use fw_laws, only: laws_of, pairs_are_rigid
   use fw_model, only: model_type
   use fw_normal_law, only: curved_pairs, exponential, pairs_with, power, table
   use fw_parameter_sweep, only: as_factor
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: body_mass, friction_coefficient, gap, harmonic_scale, is_of_elements, &
      is_of_matrices, is_of_sectors, is_per_pair, is_per_spring, mistuning_scale, mu_dynamic, &
      normal_coefficient, normal_load, normal_stiffness, not_negative, of_closing, of_pressed, &
      of_sliding, parameter_group, parameter_key, parameter_words, parameters, positive, &
      reference_force, residual_share, rotation_speed, slider_1, slider_2, static_scale, &
      tangential_stiffness, within_one
   use fw_read_mistuning, only: negative_mass
   use fw_solver_options, only: continuation_natural
   use fw_text, only: to_text
   use fw_values, only: number_text
   implicit none (type, external)
   private

   public :: check_parameter, check_parameter_sweep, check_scales, pairs_of

   character(*), parameter :: swept = 'sweep%parameter', derived = 'sensitivity%parameters'
   integer, parameter :: of_assembly(*) = [residual_share, slider_1, slider_2]

contains

   !> Refuse a parameter that the case does not have.
   subroutine check_parameter(case, number, asked_by, error)
      !> Read whole.
      type(case_type), intent(in) :: case
      !> As in `parameter_words`.
      integer, intent(in) :: number
      !> Group and key that ask for it, such as 'sensitivity%parameters'.
      character(*), intent(in) :: asked_by
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: reason
      character(24) :: group

      if (is_per_pair(number)) then
         call check_of_pairs(case%contact, number, reason)
      else if (is_per_spring(number)) then
         if (case%springs%n_springs == 0) reason = 'there are no springs: give group &spring'
      else if (is_of_elements(number)) then
         call parameter_group(number, group)
         if (case%elements%count_of(trim(group)) == 0) reason = 'there are no such elements: '// &
            'give group &'//trim(group)
      else if (is_of_matrices(number)) then
         call check_of_matrices(case, number, asked_by, reason)
      else if (is_of_sectors(number)) then
         call check_of_sectors(case, number, asked_by, reason)
      else
         call check_of_loads(case%model, number, reason)
      end if
      if (.not. (parameters(number)%has_slope .or. asked_by == swept)) then
         reason = 'its derivative is not known'
      end if
      if (.not. allocated(reason)) return
      ! What the reason says to give is one remedy, to ask for nothing is the other.
      reason = reason//trim(merge(', or leave it out', '; leave it out   ', &
                                  index(reason, ': give ') > 0))
      call fatal_error(error, asked_by//" = '"//trim(parameter_words(number))//"': "//reason, &
                       status_input)
   end subroutine check_parameter

   !> A factor of nothing; of waves the loads are not in these columns alone.
   subroutine check_of_loads(model, number, reason)
      type(model_type), intent(in) :: model
      integer, intent(in) :: number
      character(:), allocatable, intent(out) :: reason

      if (number == harmonic_scale) then
         if (.not. abs(model%harmonic_scale) > 0.0_wp) reason = 'load%harmonic_scale is 0'
         if (model%cyclic%has_sectors() .or. allocated(reason)) return
         if (.not. (acts(model%load_cosine) .or. acts(model%load_sine))) then
            if (.not. allocated(model%load_wave)) reason = 'there is no vibratory load'
         end if
      else if (number == static_scale) then
         if (.not. abs(model%static_scale) > 0.0_wp) reason = 'load%static_scale is 0'
         if (model%cyclic%has_sectors() .or. allocated(reason)) return
         if (.not. acts(model%load_static)) reason = 'there is no static load'
      end if
   end subroutine check_of_loads

   !> Whether a load is there at all: a parameter that scales nothing is a mistake.
   pure logical function acts(load)
      real(wp), allocatable, intent(in) :: load(:)

      acts = .false.
      if (allocated(load)) acts = any(abs(load) > 0.0_wp)
   end function acts

   !> What pairs do not have, or their law does not.
   subroutine check_of_pairs(contact, number, reason)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: number
      !> Not allocated where nothing speaks against it.
      character(:), allocatable, intent(out) :: reason
      character(24) :: key

      if (contact%n_pairs == 0) then
         reason = 'there are no contact pairs: give group &contact'
         return
      end if
      if (any(number == of_assembly)) call check_of_assembly(contact, number, reason)
      if (all(number /= [friction_coefficient, normal_load, gap, of_assembly])) then
         call parameter_key(number, key)
         if (all(pairs_are_rigid(contact)) .and. any(number == [tangential_stiffness, &
                                                                normal_stiffness])) then
            reason = 'contact%law = '//trim(law_text(contact))//' is rigid: its eps is a'// &
                     ' number of the method, on which exact solutions do not depend'
         else if (.not. contact%constants%is_of_law(laws_of(contact), key)) then
            reason = 'contact%law = '//trim(law_text(contact))//' has no '//trim(key)
         end if
      end if
      if (number == mu_dynamic .and. .not. (allocated(reason) .or. &
                                            contact%constants%has('mu_dynamic'))) then
         reason = 'friction does not weaken: contact%mu_dynamic is not given'
      end if
      if (number == friction_coefficient .and. any(pairs_with(contact, table))) then
         reason = "the pressure of normal_law = 'table' has no derivative by mu that is known: "// &
                  "use parallel pairs of 'penalty'"
      end if
      if (allocated(reason) .or. any(pairs_of(contact, number))) return
      select case (number)
      case (normal_coefficient); reason = "no pair has normal_law = 'power'"
      case (reference_force); reason = "no pair has normal_law = 'exponential'"
      case (normal_stiffness)
         if (any(curved_pairs(contact))) reason = "no pair has normal_law = 'unilateral'"
      case default ! by the dofs
      end select
      if (allocated(reason)) return
      select case (parameters(number)%pairs)
      case (of_sliding); reason = 'no pair has a tangential dof'
      case (of_closing); reason = 'no pair has a normal dof'
      case default; reason = 'every pair has a normal dof, whose motion presses it'
      end select
   end subroutine check_of_pairs

   !> What pairs have of their assembly where the case says so.
   subroutine check_of_assembly(contact, number, reason)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: number
      character(:), allocatable, intent(inout) :: reason
      character(24) :: key

      call parameter_key(number, key)
      select case (number)
      case (residual_share)
         if (contact%memory /= memory_residual) reason = "contact%memory is not 'residual'"
      case default
         if (.not. allocated(contact%slider_1) .and. number == slider_1 .or. &
             .not. allocated(contact%slider_2) .and. number == slider_2) then
            reason = 'contact%'//trim(key)//' is not given: give it (values of 0 serve)'
         end if
      end select
   end subroutine check_of_assembly

   !> Matrices of a sector are not the parameter's own, but of its waves.
   subroutine check_of_matrices(case, number, asked_by, reason)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      character(*), intent(in) :: asked_by
      character(:), allocatable, intent(out) :: reason

      if (number == body_mass .and. case%model%cyclic%is_cyclic) then
         call check_of_waves(case, asked_by, reason)
         if (allocated(reason)) return
      else if (case%model%cyclic%is_alone) then
         reason = 'matrices that are not symmetric, or structural_damping, are not served with '// &
                  'it yet: run value by value'
      else if (case%model%cyclic%is_cyclic) then
         reason = 'matrices of a cyclic structure (&cyclic) are not served yet'
      end if
      if (allocated(reason)) return
      if (number == body_mass .and. .not. allocated(case%bodies)) then
         reason = 'the model has no bodies (/body): make it with fretwear.damper'
      else if (number == body_mass .and. .not. are_alike(case)) then
         reason = 'the bodies of the model have several masses: give all the same by &body mass'
      else if (number == rotation_speed .and. .not. case%model%rotates) then
         reason = 'the model has no stiffness_rotation and no load static_rotation'
      else if (number == rotation_speed .and. case%contact%has_growth()) then
         reason = 'gaps or normal loads grow with it (gap_rotation, normal_load_rotation): run '// &
                  'value by value'
      end if
   end subroutine check_of_matrices

   !> Where the mass of bodies is no parameter of a structure whose nodal diameters are balanced.
   subroutine check_of_waves(case, asked_by, reason)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: asked_by
      character(:), allocatable, intent(out) :: reason

      if (case%model%cyclic%is_mistuned) then
         reason = 'the sectors of a mistuned disk are not served: run value by value (&body mass)'
      else if (allocated(case%model%cyclic%speed)) then
         reason = 'the load of the bodies follows the frequency (sweep%speed_order): give '// &
                  'model%rotation_speed'
      else if (case%model%cyclic%has_nodal() .and. asked_by /= derived) then
         reason = 'matrices of nodal diameters do not move: run value by value (&body mass)'
      end if
   end subroutine check_of_waves

   !> Whether one mass is that of all bodies.
   pure logical function are_alike(case)
      type(case_type), intent(in) :: case

      are_alike = all(abs(case%bodies%mass - case%bodies%mass(1)) <= 0.0_wp)
   end function are_alike

   !> What no sector differs by, and what goes from blade to blade.
   subroutine check_of_sectors(case, number, asked_by, reason)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      character(*), intent(in) :: asked_by
      character(:), allocatable, intent(out) :: reason
      real(wp), allocatable :: values(:)
      character(24) :: key

      call get_parameter(case, number, values)
      call parameter_key(number, key)
      if (.not. allocated(case%model%cyclic%deviation)) then
         reason = 'no sector differs: give &cyclic mistuned = .true. and group &mistuning '// &
                  '(values of 0 serve)'
      else if (size(values) == 0) then
         reason = 'mistuning%'//trim(key)//' is not given: give it (values of 0 serve)'
      else if (number /= mistuning_scale .and. asked_by /= derived) then
         reason = "values go from blade to blade: use 'mistuning%scale'"
      end if
   end subroutine check_of_sectors

   !> Scales at which a blade has no frequency, or a sector no mass.
   subroutine check_scales(case, ends, asked_by, error)
      type(case_type), intent(in) :: case
      !> Lowest and highest scale.
      real(wp), intent(in) :: ends(2)
      character(*), intent(in) :: asked_by
      type(error_type), allocatable, intent(out) :: error
      type(deviation_type) :: deviation
      integer :: j, k

      deviation = case%model%cyclic%deviation
      do k = 1, 2
         if (any(1.0_wp + ends(k)*deviation%values_of(of_frequency) <= 0.0_wp)) then
            call fatal_error(error, asked_by//" = 'mistuning%scale' comes to "// &
                             number_text(ends(k))//', where 1 + scale*frequency of a blade is '// &
                             'not above 0: must stay where it is', status_input)
            return
         end if
         if (.not. allocated(case%model%mass)) cycle
         call deviation%set_scale(ends(k))
         j = negative_mass(case%model%mass, deviation)
         if (j < 0) cycle
         call fatal_error(error, asked_by//" = 'mistuning%scale' comes to "// &
                          number_text(ends(k))//', where the mass matrix of sector '// &
                          to_text(j)//' is not positive: must leave mass to every motion', &
                          status_input)
         return
      end do
   end subroutine check_scales

   !> Pairs that a parameter says something of.
   function pairs_of(contact, number) result(counts)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: number
      logical :: counts(contact%n_pairs)
      character(24) :: key
      integer :: i

      associate (c => contact)
         select case (parameters(number)%pairs)
         case (of_sliding); counts = any(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1)
         case (of_closing); counts = c%side_1(3, :) /= 0 .or. c%side_2(3, :) /= 0
         case (of_pressed); counts = c%side_1(3, :) == 0 .and. c%side_2(3, :) == 0
         case default; counts = .false.
         end select
         select case (number)
         case (normal_stiffness); counts = counts .and. .not. curved_pairs(c)
         case (normal_coefficient); counts = counts .and. pairs_with(c, power)
         case (reference_force); counts = counts .and. pairs_with(c, exponential)
         case default ! of all of them
         end select
         if (.not. allocated(c%law_of)) return
         if (any(number == [friction_coefficient, normal_load, gap, of_assembly])) return
         ! A constant of some laws alone.
         call parameter_key(number, key)
         counts = counts .and. [(c%constants%is_taken(c%law_of(i), key), i=1, c%n_pairs)]
      end associate
   end function pairs_of

   !> A sweep of what is from -1 to 1, whatever it is a factor of.
   subroutine check_within_one(case, base, error)
      type(case_type), intent(in) :: case
      !> Values of the case (n).
      real(wp), intent(in) :: base(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: far

      far = maxval(abs(case%over%ends()))
      if (case%over%as == as_factor) far = far*maxval(abs(base))
      if (far <= 1.0_wp) return
      call fatal_error(error, 'sweep goes to '//number_text(far)//' of '// &
                       trim(parameter_words(case%over%number))//': must stay from -1 to 1', &
                       status_input)
   end subroutine check_within_one

   !> A sweep over another parameter than the frequency.
   subroutine check_parameter_sweep(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%over%is_wanted()) return
      call check_parameter(case, case%over%number, swept, error)
      if (allocated(error)) return
      if (.not. parameters(case%over%number)%has_slope .and. &
          case%sweep%continuation /= continuation_natural) then
         call fatal_error(error, swept//" = '"//trim(parameter_words(case%over%number))// &
                          "': its derivative is not known; use continuation = 'natural'", &
                          status_input)
         return
      end if
      call check_values(case, error)
   end subroutine check_parameter_sweep

   !> Values that the parameter can take: one for all pairs (springs), in its range.
   subroutine check_values(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: base(:)
      real(wp) :: lowest

      associate (over => case%over)
         call get_parameter(case, over%number, base)
         if (is_per_pair(over%number)) base = pack(base, pairs_of(case%contact, over%number))
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
         select case (parameters(over%number)%sign)
         case (not_negative); if (lowest < 0.0_wp) call refuse_lowest('at least 0')
         case (positive); if (.not. lowest > 0.0_wp) call refuse_lowest('above 0')
         case (within_one); call check_within_one(case, base, error)
         case default ! any
         end select
         if (over%number == mistuning_scale) call check_scales( &
            case, over%ends()*merge(base(1), 1.0_wp, over%as == as_factor), swept, error)
      end associate

   contains

      subroutine refuse_lowest(what)
         character(*), intent(in) :: what

         call fatal_error(error, 'sweep goes down to '//number_text(lowest)//' of '// &
                          trim(parameter_words(case%over%number))//': must be '//what, status_input)
      end subroutine refuse_lowest

   end subroutine check_values

end module fw_parameter_checks
