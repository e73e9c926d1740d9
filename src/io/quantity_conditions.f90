!> When the result of a case holds a quantity of a point.
module fw_quantity_conditions
   use fw_case, only: analyses, case_type
   use fw_kinds, only: wp
   use fw_parameters, only: harmonic_scale
   use fw_solver_options, only: continuation_arclength
   use fw_wear_options, only: mu_by_none
   implicit none (type, external)
   private

   public :: always, asks_stability, changes_friction, follows_branch, follows_frequency, &
             follows_parameter, &
             goes_over, has_levels, is_accurate, is_controlled, is_mission, is_mode, is_response, &
             scales_load, shows_contact, wears

contains

   pure logical function always(case)
      type(case_type), intent(in) :: case

      associate (unused => case)
      end associate
      always = .true.
   end function always

   !> Harmonic balance, which may fall back from one way of solution to another.
   pure logical function is_response(case)
      type(case_type), intent(in) :: case

      is_response = analyses(case%analysis)%is_response
   end function is_response

   pure logical function is_mode(case)
      type(case_type), intent(in) :: case

      is_mode = analyses(case%analysis)%is_free
   end function is_mode

   !> Only a branch turns back.
   pure logical function follows_branch(case)
      type(case_type), intent(in) :: case

      follows_branch = case%sweep%continuation == continuation_arclength
   end function follows_branch

   !> Along frequencies, or along another parameter.
   pure logical function follows_frequency(case)
      type(case_type), intent(in) :: case

      follows_frequency = follows_branch(case) .and. .not. case%over%is_wanted()
   end function follows_frequency

   pure logical function follows_parameter(case)
      type(case_type), intent(in) :: case

      follows_parameter = follows_branch(case) .and. case%over%is_wanted()
   end function follows_parameter

   !> A sweep over another parameter than the frequency.
   pure logical function goes_over(case)
      type(case_type), intent(in) :: case

      goes_over = case%over%is_wanted()
   end function goes_over

   pure logical function scales_load(case)
      type(case_type), intent(in) :: case

      scales_load = case%over%number == harmonic_scale .or. case%control%is_wanted()
   end function scales_load

   pure logical function is_controlled(case)
      type(case_type), intent(in) :: case

      is_controlled = case%control%is_wanted()
   end function is_controlled

   !> Whether harmonics differ from point to point.
   pure logical function has_levels(case)
      type(case_type), intent(in) :: case

      has_levels = case%harmonics%adaptive .or. is_accurate(case)
   end function has_levels

   !> Whether the harmonics follow from a wanted accuracy.
   pure logical function is_accurate(case)
      type(case_type), intent(in) :: case

      is_accurate = case%harmonics%accuracy > 0.0_wp .and. .not. case%harmonics%adaptive
   end function is_accurate

   pure logical function asks_stability(case)
      type(case_type), intent(in) :: case

      asks_stability = case%sweep%stability
   end function asks_stability

   !> Pairs that exist, and that the output has not been told to leave out.
   pure logical function shows_contact(case)
      type(case_type), intent(in) :: case

      shows_contact = case%output%contact .and. case%contact%n_pairs > 0
   end function shows_contact

   !> Wear over blocks.
   pure logical function is_mission(case)
      type(case_type), intent(in) :: case

      is_mission = wears(case) .and. case%mission%is_wanted()
   end function is_mission

   !> Wear that changes friction.
   pure logical function changes_friction(case)
      type(case_type), intent(in) :: case

      changes_friction = wears(case) .and. case%wear%mu_by /= mu_by_none
   end function changes_friction

   pure logical function wears(case)
      type(case_type), intent(in) :: case

      wears = analyses(case%analysis)%wears
   end function wears

end module fw_quantity_conditions
