!> Parameters that a case cannot be differentiated by, or changed in, each with the reason: for
!> every group that takes words of fw_parameters.
module fw_parameter_checks
   use fw_case, only: case_type
   use fw_contact_data, only: contact_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_kinds, only: wp
   use fw_laws, only: is_rigid, law_words
   use fw_model, only: model_type
   use fw_parameters, only: friction_coefficient, gap, harmonic_scale, is_of_matrices, &
      is_per_pair, is_per_spring, normal_load, normal_stiffness, parameter_key, parameter_words, &
      rotation_speed, static_scale, tangential_stiffness
   implicit none (type, external)
   private

   public :: check_parameter

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

      if (is_per_pair(number)) then
         call check_of_pairs(case%contact, number, reason)
      else if (is_per_spring(number)) then
         if (case%springs%n_springs == 0) reason = 'there are no springs: give group &spring'
      else if (is_of_matrices(number)) then
         call check_of_matrices(case, number, reason)
      else
         call check_of_loads(case%model, number, reason)
      end if
      if (.not. allocated(reason)) return
      call fatal_error(error, asked_by//" = '"//trim(parameter_words(number))//"': "//reason// &
                       '; leave it out', status_input)
   end subroutine check_parameter

   !> A factor of nothing; of waves the loads are not in these columns alone.
   subroutine check_of_loads(model, number, reason)
      type(model_type), intent(in) :: model
      integer, intent(in) :: number
      character(:), allocatable, intent(out) :: reason

      if (number == harmonic_scale) then
         if (.not. abs(model%harmonic_scale) > 0.0_wp) reason = 'load%harmonic_scale is 0'
         if (model%cyclic%is_cyclic .or. allocated(reason)) return
         if (.not. (acts(model%load_cosine) .or. acts(model%load_sine))) then
            if (.not. allocated(model%load_wave)) reason = 'there is no vibratory load'
         end if
      else if (number == static_scale) then
         if (.not. abs(model%static_scale) > 0.0_wp) reason = 'load%static_scale is 0'
         if (model%cyclic%is_cyclic .or. allocated(reason)) return
         if (.not. acts(model%load_static)) reason = 'there is no static load'
      end if
   end subroutine check_of_loads

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
      logical :: slides(contact%n_pairs), closes(contact%n_pairs)
      character(24) :: key

      if (contact%n_pairs == 0) then
         reason = 'there are no contact pairs: give group &contact'
         return
      end if
      slides = any(contact%side_1(1:2, :) /= 0 .or. contact%side_2(1:2, :) /= 0, dim=1)
      closes = contact%side_1(3, :) /= 0 .or. contact%side_2(3, :) /= 0
      select case (number)
      case (friction_coefficient)
         if (.not. any(slides)) reason = 'no pair has a tangential dof'
      case (normal_load)
         if (all(closes)) reason = 'every pair has a normal dof, whose motion presses it'
      case (gap)
         if (.not. any(closes)) reason = 'no pair has a normal dof'
      case (tangential_stiffness, normal_stiffness)
         call parameter_key(number, key)
         if (is_rigid(contact%law)) then
            reason = "contact%law = '"//trim(law_words(contact%law))//"' is rigid: its eps is a"// &
                     ' number of the method, on which exact solutions do not depend'
         else if (.not. contact%constants%is_of_law(contact%law, key)) then
            reason = "contact%law = '"//trim(law_words(contact%law))//"' has no "//trim(key)
         else if (number == tangential_stiffness .and. .not. any(slides)) then
            reason = 'no pair has a tangential dof'
         else if (number == normal_stiffness .and. .not. any(closes)) then
            reason = 'no pair has a normal dof'
         end if
      case default ! pairs have no other parameter
         reason = 'it is none of the pairs'
      end select
   end subroutine check_of_pairs

   !> Matrices of a sector are not the parameter's own, but of its waves.
   subroutine check_of_matrices(case, number, reason)
      type(case_type), intent(in) :: case
      integer, intent(in) :: number
      character(:), allocatable, intent(out) :: reason

      if (case%model%cyclic%is_cyclic) then
         reason = 'matrices of a cyclic structure (&cyclic) are not served yet'
      else if (number == rotation_speed .and. .not. case%model%rotates) then
         reason = 'the model has no stiffness_rotation and no load static_rotation'
      end if
   end subroutine check_of_matrices

end module fw_parameter_checks
