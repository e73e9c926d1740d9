!> Sound keys that cannot be run together: the rules (fw_rules), and what needs their numbers.
!>
!> Ranges of single keys are checked where the keys are declared, and what needs the model where it
!> is built. The first fault is told: others may follow from it.
module fw_combinations
   use fw_case, only: analyses, case_type
   use fw_error, only: error_type, fatal_error, status_input
   use fw_held_bodies, only: check_bodies
   use fw_kinds, only: wp
   use fw_memory, only: require_memory
   use fw_parameter_checks, only: check_parameter_sweep
   use fw_rules, only: apply_rules
   use fw_solver_options, only: scheme_implicit_euler
   use fw_text, only: to_text
   use fw_wear_options, only: mu_by_depth, wear_explicit, wear_pseudo_time
   implicit none (type, external)
   private

   public :: check_combinations, is_linear_euler

   !> Accuracy that may be asked for, as a multiple of the tolerance of the iterations.
   real(wp), parameter :: least_to_tolerance = 100.0_wp

contains

   !> Refuse what is valid key by key but cannot be run together.
   subroutine check_combinations(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      call apply_rules(case, error)
      if (.not. allocated(error)) call check_piece(case, error)
      if (.not. allocated(error)) call check_parameter_sweep(case, error)
      if (.not. allocated(error)) call check_accuracy(case, error)
      if (.not. allocated(error)) call check_loads(case, error)
      if (.not. allocated(error)) call require_sectors(case, error)
      if (.not. allocated(error)) call check_order(case, error)
      if (.not. allocated(error)) call check_friction(case, error)
      if (.not. allocated(error)) call check_bodies(case, error)
   end subroutine check_combinations

   !> A load of a harmonic that is left out would not act.
   subroutine check_loads(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%model%waves%grows_at_rest() .and. .not. case%sweep%start > 0.0_wp .and. &
          analyses(case%analysis)%has_points .and. .not. allocated(case%sweep%frequencies)) then
         call fatal_error(error, '&sweep start = 0: a velocity or an acceleration of &base is '// &
                          "no motion at the frequency 0: must be above 0, or take motion = "// &
                          "'displacement'", status_input)
         return
      end if
      call check_table(case, error)
      if (allocated(error)) return
      associate (highest => case%model%waves%highest())
         if (.not. analyses(case%analysis)%has_points) return
         if (case%contact%highest_gap() > case%harmonics%n_harmonics) then
            call fatal_error(error, 'harmonics%n_harmonics = '// &
                             to_text(case%harmonics%n_harmonics)//', but a gap (contact%'// &
                             'gap_harmonic, gap_order or /contact/gap_harmonic of the model '// &
                             'file) moves in harmonic '//to_text(case%contact%highest_gap())// &
                             ': must be at least '//to_text(case%contact%highest_gap()), &
                             status_input)
            return
         end if
         if (highest <= case%harmonics%n_harmonics) return
         call fatal_error(error, 'harmonics%n_harmonics = '// &
                          to_text(case%harmonics%n_harmonics)//', but &load (or /load/harmonic '// &
                          'of the model file) acts in harmonic '//to_text(highest)//': must be '// &
                          'at least '//to_text(highest), status_input)
      end associate
   end subroutine check_loads

   !> Beyond its ends the table of the load says nothing.
   subroutine check_table(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: range(2)

      associate (table => case%model%waves)
         if (.not. (allocated(table%table_scale) .and. analyses(case%analysis)%has_points)) return
         if (analyses(case%analysis)%finds_frequency .or. &
             (analyses(case%analysis)%wears .and. case%wear%follow_resonance)) then
            call fatal_error(error, '&load n_table does not go with an analysis that finds its '// &
                             "frequency: use 'frf' or 'point'", status_input)
            return
         end if
         range = case%sweep%start
         if (case%sweep%end > 0.0_wp .or. allocated(case%sweep%frequencies)) then
            range = case%sweep%range()
         end if
         if (range(1) >= table%table_frequency(1) .and. &
             range(2) <= table%table_frequency(size(table%table_frequency))) return
         call fatal_error(error, '&load table_frequency has points from '// &
                          to_text(table%table_frequency(1))//' to '// &
                          to_text(table%table_frequency(size(table%table_frequency)))// &
                          ' rad/s, but the sweep goes from '//to_text(range(1))//' to '// &
                          to_text(range(2))//' rad/s: must hold all of it', status_input)
      end associate
   end subroutine check_table

   !> Room for the blocks of all nodal diameters, complex ones and factors of the preconditioner in
   !> single precision: asked for before any of them is begun.
   subroutine require_sectors(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: n_slots, blocks

      if (.not. (case%model%cyclic%is_cyclic .and. case%model%cyclic%is_mistuned)) return
      associate (n => case%model%cyclic%n_sectors)
         ! Relative coordinates of a sector at most; few modes are kept beside.
         n_slots = (3.0_wp*case%contact%n_pairs + case%springs%n_springs)/n + &
                   case%elements%n_elements()
         blocks = 3.0_wp*n_slots**2*n*(case%harmonics%n_harmonics + 1.0_wp)
         call require_memory(blocks, '&cyclic mistuned = .true. with n_sectors = '// &
                             to_text(n)//', '//to_text(case%contact%n_pairs/n)//' pairs in '// &
                             'each and &harmonics n_harmonics = '// &
                             to_text(case%harmonics%n_harmonics), 'take fewer harmonics or '// &
                             'pairs, or the tuned wave (mistuned = .false.)', error)
      end associate
   end subroutine require_sectors

   !> What sets the steps has to be something that the scheme has.
   subroutine check_order(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (.not. analyses(case%analysis)%wears) return
      if (case%wear%scheme == wear_explicit .and. case%wear%order > 2) then
         call fatal_error(error, 'wear%order = '//to_text(case%wear%order)// &
                          ": scheme = 'explicit' has orders 1 and 2, 'implicit' 1 to 4", &
                          status_input)
      else if (case%wear%scheme == wear_pseudo_time .and. case%wear%order > 0) then
         call fatal_error(error, 'wear%order = '//to_text(case%wear%order)// &
                          ": with scheme = 'pseudo_time' pseudo_time%scheme sets the order; "// &
                          'leave wear%order out', status_input)
      end if
   end subroutine check_order

   !> Friction that grows from nothing with the depth: the forces have no part by which it grows.
   subroutine check_friction(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (case%wear%mu_by /= mu_by_depth) return
      do i = 1, case%contact%n_pairs
         if (case%contact%mu(i) > 0.0_wp .or. case%wear%mu_final(i) <= 0.0_wp) cycle
         call fatal_error(error, "wear%mu_by = 'depth': contact%mu = 0 of pair "//to_text(i)// &
                          ' cannot grow to wear%mu_final = '//to_text(case%wear%mu_final(i))// &
                          ': give it a small one, such as 1e-3 of mu_final', status_input)
         return
      end do
   end subroutine check_friction

   !> A piece of a sweep lies within it.
   subroutine check_piece(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: n_points

      if (.not. case%sweep%is_piece()) return
      n_points = case%sweep%n_points
      if (case%sweep%first_point > n_points) then
         call fatal_error(error, 'first point of a piece = '// &
                          to_text(case%sweep%first_point)//': must be one of the '// &
                          to_text(n_points)//' points of the sweep', status_input)
      else if (case%sweep%last_point > n_points .or. &
               (case%sweep%last_point > 0 .and. &
                case%sweep%last_point < case%sweep%first_point)) then
         call fatal_error(error, 'last point of a piece = '//to_text(case%sweep%last_point)// &
                          ': must be from its first = '//to_text(case%sweep%first_point)// &
                          ' to '//to_text(n_points)//', or 0', status_input)
      end if
   end subroutine check_piece

   !> The estimate sees no error below that of the iterations.
   subroutine check_accuracy(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%harmonics%accuracy <= 0.0_wp) return
      if (case%harmonics%accuracy >= least_to_tolerance*case%solver%tolerance) return
      call fatal_error(error, 'harmonics%accuracy must be at least 100 times '// &
                       'solver%tolerance: lower the tolerance', status_input)
   end subroutine check_accuracy

   !> Whether wear steps are linearly implicit Euler steps in pseudo-time.
   pure logical function is_linear_euler(case)
      type(case_type), intent(in) :: case

      is_linear_euler = case%wear%scheme == wear_pseudo_time .and. &
                        case%pseudo_time%scheme == scheme_implicit_euler
   end function is_linear_euler

end module fw_combinations
