!> When the result of a case holds a quantity of a point.
module fw_quantity_conditions
   use fw_case, only: analyses, case_type
   use fw_kinds, only: wp
   use fw_parameters, only: harmonic_scale, loss_factor
   use fw_solver_options, only: continuation_arclength
   use fw_wear_options, only: mu_by_none
   implicit none (type, external)
   private

   public :: always, asks_stability, changes_friction, follows_branch, follows_frequency, &
             follows_parameter, follows_speed, goes_over, has_dampers, has_endurance, has_levels, &
             has_stress, has_structural, has_tensor, is_accurate, is_controlled, is_mission, &
             is_mistuned, is_mode, is_response, moves_base, moves_obstacle, scales_load, &
             shows_contact, &
             shows_user, wears

contains

   !> Rows of stress are there and wanted.
   pure logical function has_stress(case)
      type(case_type), intent(in) :: case

      has_stress = case%stress%is_wanted()
   end function has_stress

   !> All sectors of a disk, which may differ.
   pure logical function is_mistuned(case)
      type(case_type), intent(in) :: case

      is_mistuned = case%model%cyclic%has_sectors() .and. case%model%cyclic%is_mistuned
   end function is_mistuned

   !> Their components too.
   pure logical function has_tensor(case)
      type(case_type), intent(in) :: case

      has_tensor = case%stress%writes_tensor()
   end function has_tensor

   !> The strength of its points is known.
   pure logical function has_endurance(case)
      type(case_type), intent(in) :: case

      has_endurance = case%stress%is_judged()
   end function has_endurance

   !> Of every case.
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

   !> Supports or the ground move.
   pure logical function moves_base(case)
      type(case_type), intent(in) :: case

      moves_base = allocated(case%model%base_parts)
   end function moves_base

   !> Gaps that have harmonics, or a side 2 that slides.
   pure logical function moves_obstacle(case)
      type(case_type), intent(in) :: case

      moves_obstacle = case%output%contact .and. case%contact%n_pairs > 0 .and. &
                       case%contact%moves_obstacle()
   end function moves_obstacle

   !> Elements with laws of a user, which are shown as contact is.
   pure logical function shows_user(case)
      type(case_type), intent(in) :: case

      shows_user = case%output%contact .and. case%elements%extent_of('user', 2) > 0
   end function shows_user

   !> A nonlinear mode.
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

   !> The points go over a parameter, not over the frequency.
   pure logical function follows_parameter(case)
      type(case_type), intent(in) :: case

      follows_parameter = follows_branch(case) .and. case%over%is_wanted()
   end function follows_parameter

   !> Where the rotation speed follows the frequency.
   pure logical function follows_speed(case)
      type(case_type), intent(in) :: case

      follows_speed = case%sweep%speed_order > 0.0_wp
   end function follows_speed

   !> Hysteretic damping of one sector or of a structure that is none, and that moves by itself:
   !> beside a base the motion that is solved for is not the one that strains it.
   pure logical function has_structural(case)
      type(case_type), intent(in) :: case

      associate (cyclic => case%model%cyclic)
         has_structural = .not. (cyclic%is_mistuned .or. moves_base(case)) .and. &
                          (case%model%loss_factor > 0.0_wp .or. allocated(cyclic%structural) .or. &
                           cyclic%loss_factor > 0.0_wp .or. case%varied == loss_factor)
      end associate
   end function has_structural

   !> A sweep over another parameter than the frequency.
   pure logical function goes_over(case)
      type(case_type), intent(in) :: case

      goes_over = case%over%is_wanted()
   end function goes_over

   !> Points have a factor of their load.
   pure logical function scales_load(case)
      type(case_type), intent(in) :: case

      scales_load = case%over%number == harmonic_scale .or. case%control%is_wanted()
   end function scales_load

   !> Amplitudes are given in place of the load.
   pure logical function is_controlled(case)
      type(case_type), intent(in) :: case

      is_controlled = case%control%is_wanted()
   end function is_controlled

   !> Dampers, and forces of the joint are wanted.
   pure logical function has_dampers(case)
      type(case_type), intent(in) :: case

      has_dampers = case%output%contact .and. case%elements%count_of('damper') > 0
   end function has_dampers

   !> Whether harmonics differ from point to point.
   pure logical function has_levels(case)
      type(case_type), intent(in) :: case

      has_levels = is_accurate(case)
   end function has_levels

   !> Whether the harmonics follow from a wanted accuracy.
   pure logical function is_accurate(case)
      type(case_type), intent(in) :: case

      is_accurate = case%harmonics%accuracy > 0.0_wp
   end function is_accurate

   !> Floquet multipliers are found.
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

   !> The joint wears.
   pure logical function wears(case)
      type(case_type), intent(in) :: case

      wears = analyses(case%analysis)%wears
   end function wears

end module fw_quantity_conditions
