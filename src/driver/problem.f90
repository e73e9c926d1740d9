!> From a case to the system that is solved: joint, harmonics, instants, condensation.
module fw_problem
   use fw_kinds, only: wp
   use fw_balance_problem, only: balance_problem, new_balance_problem, problem_origin
   use fw_balance_state, only: balance_state, new_balance_state
   use fw_case, only: analyses, case_type
   use fw_all_sectors, only: all_sectors, new_all_sectors
   use fw_cyclic_structure, only: cyclic_structure, new_cyclic_structure
   use fw_error, only: error_type, fatal_error, status_input
   use fw_case_forces, only: new_forces
   use fw_force_list, only: force_list
   use fw_fourier, only: fourier_type, new_fourier, fft_pays
   use fw_harmonics_options, only: harmonics_options, method_hbm, method_hdhb, method_tcm, &
      method_tcm_least_squares, parity_all, parity_odd, sampling_auto, sampling_events
   use fw_held_bodies, only: pairs_of_bodies
   use fw_joint, only: joint_type, new_joint, turn_joint
   use fw_memory, only: require_memory
   use fw_moved_parameter, only: moved_parameter
   use fw_moved_structure, only: meets_modes, move_structure, put_fullest
   use fw_parameter_sweep, only: as_factor
   use fw_parameters, only: gap, harmonic_scale, is_of_matrices, slider_1, slider_2
   use fw_plain_structure, only: new_plain_structure, plain_structure
   use fw_reduction, only: held_basis
   use fw_sector_means, only: means_none, means_split
   use fw_solver_options, only: continuation_arclength, linear_lu, solver_powell
   use fw_structure_operator, only: structure_operator, structure_state
   use fw_text, only: to_text
   use fw_threads, only: coordinates_for_threads
   use fw_wear_options, only: follow_range
   implicit none (type, external)
   private

   public :: build_system, threads_for

   !> Instants at least where the events decide and instants only isolate them.
   integer, parameter :: fewest_for_events = 8
   !> Pairs up to which events serve an accuracy in two tangential directions.
   integer, parameter :: few_pairs = 16

contains

   !> Threads of a run: one where so few relative coordinates are not worth sharing, whatever is
   !> allowed.
   pure integer function threads_for(case) result(n)
      type(case_type), intent(in) :: case

      n = case%threads
      if ((3*case%contact%n_pairs + case%springs%n_springs + case%elements%n_elements())* &
          case%model%cyclic%n_solved() < coordinates_for_threads) n = 1
   end function threads_for

   !> Build the problem of a case, and a state of it at the first frequency of its sweep.
   subroutine build_system(case, problem, system, error, keep_all, of_level, forces, held)
      type(case_type), intent(in) :: case
      !> Has to stay where it is as long as the system lives.
      type(balance_problem), intent(out), target :: problem
      type(balance_state), intent(out) :: system
      type(error_type), allocatable, intent(out) :: error
      !> Condense nothing (pseudo-time flows live on the whole structure).
      logical, intent(in), optional :: keep_all
      !> Harmonics instead of those of the case.
      type(harmonics_options), intent(in), optional :: of_level
      !> Laws of another problem of the case, with the stiffness that its structure gave them.
      type(force_list), intent(in), optional :: forces
      !> Modes of the structure with its contact held: taken where they are known, else found and
      !> left for other problems of the case.
      type(held_basis), intent(inout), optional :: held
      class(structure_state), allocatable :: stand
      class(case_type), allocatable :: fullest

      if (is_of_matrices(case%varied)) then
         allocate (fullest, source=case)
         call put_fullest(fullest, error)
         if (allocated(error)) return
         call build_problem(fullest, problem, stand, error, keep_all, of_level, forces, held)
      else
         call build_problem(case, problem, stand, error, keep_all, of_level, forces, held)
      end if
      if (allocated(error)) return
      call new_balance_state(problem, system, stand)
      if (allocated(fullest) .and. .not. case%over%is_wanted()) then
         call move_structure(case%model, case%sweep%start, .false., system, error)
         if (allocated(error)) return
      end if
      call let_move(case, system, error)
   end subroutine build_system

   !> Give the state the parameter that the case goes over, and its first value; that of a given
   !> amplitude is the load, whatever the response goes along.
   subroutine let_move(case, system, error)
      type(case_type), intent(in) :: case
      type(balance_state), intent(inout) :: system
      type(error_type), allocatable, intent(out) :: error
      type(moved_parameter), allocatable :: mover, load

      if (case%over%is_wanted()) then
         allocate (mover)
         call mover%take(case%body_type, case%over%number, case%over%as == as_factor)
         mover%first = case%sweep%start
         mover%filter_harmonics = case%harmonics%filter_harmonics
         if (is_of_matrices(case%over%number)) call mover%apply(system, case%over%start, error)
         if (allocated(error)) return
         ! Along a branch the residual is to have the slope that is known of it: with the eps of the
         ! first value.
         mover%holds_eps = case%sweep%continuation == continuation_arclength
      end if
      if (case%control%is_wanted()) then
         allocate (load)
         call load%take(case%body_type, harmonic_scale, .false.)
         call move_alloc(load, system%moved%mover)
         if (allocated(mover)) then
            allocate (system%along)
            call move_alloc(mover, system%along%mover)
            call system%set_place(case%over%start, error)
            if (allocated(error)) return
         end if
         call system%set_parameter(case%model%harmonic_scale, error)
      else if (allocated(mover)) then
         call move_alloc(mover, system%moved%mover)
         call system%set_parameter(case%over%start, error)
      end if
   end subroutine let_move

   !> What all workers share. The first state is made along the way: the stiffness of rigid laws
   !> is chosen by the structure at the first frequency.
   subroutine build_problem(case, problem, stand, error, keep_all, of_level, forces, held)
      type(case_type), intent(in) :: case
      type(balance_problem), intent(out) :: problem
      !> Its structure at the first frequency.
      class(structure_state), allocatable, intent(out) :: stand
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: keep_all
      type(harmonics_options), intent(in), optional :: of_level
      type(force_list), intent(in), optional :: forces
      type(held_basis), intent(inout), optional :: held
      type(harmonics_options) :: harmonics
      logical :: skip_idle
      type(joint_type) :: joint
      type(fourier_type) :: fourier
      class(structure_operator), allocatable :: structure
      type(force_list) :: laws
      type(held_basis) :: basis
      real(wp) :: range(2)
      logical :: keeps_all

      harmonics = case%harmonics
      if (present(of_level)) harmonics = of_level
      ! A perturbation moves what no load moves.
      skip_idle = case%solver%skips .and. .not. case%sweep%stability .and. &
                  .not. analyses(case%analysis)%is_free
      ! A gap that closes into an interference does so too, and a slider that leaves 0.
      if (any(case%over%number == [gap, slider_1, slider_2])) skip_idle = .false.
      call new_joint(case%model, case%contact, case%springs, case%elements, skip_idle, joint, &
                     error)
      if (allocated(error)) return
      ! No load moves a mode, and none has to.
      if (analyses(case%analysis)%is_free) joint%idle = .false.
      if (present(forces)) then
         laws = forces
      else
         call new_forces(case%contact, case%springs, case%elements, joint%row, joint%spring_row, &
                         joint%element_row, locates_events(case, harmonics, joint), &
                         harmonics%filter_harmonics, laws)
      end if
      call choose_harmonics(case, harmonics, joint, laws, fourier, error)
      if (allocated(error)) return
      if (fft_pays(fourier%n_coefficients)) fourier%fft_rows = 3*case%contact%n_pairs
      range = case%sweep%start
      if (analyses(case%analysis)%is_sweep) range = case%sweep%range()
      if (analyses(case%analysis)%wears .and. case%wear%follow_resonance) then
         range = follow_range*range
      end if
      if (analyses(case%analysis)%is_resonance) then
         ! As far as the resonance may go.
         range = case%sweep%range()
         range = range + 0.5_wp*(range(2) - range(1))*[-1.0_wp, 1.0_wp]
         range(1) = max(range(1), 0.1_wp*minval(case%sweep%range()))
      end if
      call turn_joint(case%model, case%contact, fourier%harmonic, joint, error)
      if (allocated(error)) return
      keeps_all = .false.
      if (present(keep_all)) keeps_all = keep_all
      if (is_of_matrices(case%varied) .and. .not. keeps_all) then
         call meets_modes(case, joint, fourier%harmonic, range, keeps_all, error)
         if (allocated(error)) return
      end if
      if (is_of_matrices(case%varied)) then
         if (present(held)) basis = held
         call new_structure(case, joint, laws, fourier, range, structure, error, keeps_all, basis)
         if (present(held)) held = basis
      else
         call new_structure(case, joint, laws, fourier, range, structure, error, keeps_all, held)
      end if
      if (allocated(error)) return
      call structure%new_state(stand)
      call structure%at(stand, case%sweep%start, 0.0_wp, error)
      if (allocated(error)) return
      call new_balance_problem(joint, structure, fourier, laws, case%contact%depth, problem)
      if (allocated(case%bodies)) call pairs_of_bodies(case, problem%body_of_pair)
      problem%origin = problem_origin(range=range, keeps_all=keeps_all, basis=basis, &
                                      borrows_laws=present(forces))
      problem%load_size = norm2([case%model%load_cosine, case%model%load_sine])
      problem%reduced = case%solver%skips
      problem%solves_values = harmonics%method == method_hdhb
      if (.not. present(forces)) call problem%scale_forces(stand, range(2))
   end subroutine build_problem

   !> The structure of a case, condensed.
   subroutine new_structure(case, joint, forces, fourier, range, structure, error, keep_all, &
                            held)
      type(case_type), intent(in) :: case
      type(joint_type), intent(in) :: joint
      type(force_list), intent(in) :: forces
      type(fourier_type), intent(in) :: fourier
      !> Lowest and highest frequency [rad/s].
      real(wp), intent(in) :: range(2)
      class(structure_operator), allocatable, intent(out) :: structure
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in) :: keep_all
      !> Of plain structures, see build_system.
      type(held_basis), intent(inout), optional :: held
      type(plain_structure), allocatable :: plain
      type(cyclic_structure), allocatable :: cyclic
      type(all_sectors), allocatable :: all
      integer :: means

      if (.not. case%model%cyclic%is_cyclic) then
         allocate (plain)
         ! Of matrices that change none or all: coordinates are to be the same.
         call new_plain_structure(case%model, joint%relative, fourier%harmonic, range, plain, &
                                  error, keep_all, held=held, &
                                  keep_none=is_of_matrices(case%varied))
         call move_alloc(plain, structure)
         return
      end if
      associate (p => forces%entry(forces%pairs)%law%prediction)
         means = means_none
         ! Also what mass a pair has: friction that is ripple on it is no solution.
         if (p%takes_balance) means = means_split
      end associate
      if (case%model%cyclic%is_mistuned) then
         allocate (all)
         call new_all_sectors(case%model, joint%cyclic, fourier%harmonic, range, means, all, &
                              error, joint%tuned, keep_all=analyses(case%analysis)%is_free)
         call move_alloc(all, structure)
         return
      end if
      allocate (cyclic)
      call new_cyclic_structure(case%model, joint%cyclic, fourier%harmonic, range, means, cyclic, &
                                error, of_mode=analyses(case%analysis)%is_free, &
                                keep_all=is_of_matrices(case%varied) .and. keep_all, &
                                keep_none=is_of_matrices(case%varied))
      call move_alloc(cyclic, structure)
   end subroutine new_structure

   !> Only odd harmonics where the symmetry is exact, and keeps so at the instants: their number
   !> must be even.
   subroutine choose_harmonics(case, harmonics, joint, forces, fourier, error)
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics
      type(joint_type), intent(in) :: joint
      type(force_list), intent(in) :: forces
      type(fourier_type), intent(out) :: fourier
      type(error_type), allocatable, intent(out) :: error
      logical :: odd_only
      integer :: n_time

      n_time = harmonics%n_time
      if (n_time == 0) n_time = automatic_n_time(harmonics, joint, forces)
      ! Only the projection keeps the symmetry of the instants; collocation at an odd number of
      ! them does not.
      odd_only = joint%half_wave_symmetric .and. modulo(n_time, 2) == 0 .and. &
                 harmonics%method == method_hbm
      select case (harmonics%parity)
      case (parity_all)
         odd_only = .false.
      case (parity_odd)
         if (harmonics%method /= method_hbm) then
            call fatal_error(error, '&harmonics parity = ''odd'' needs method = ''hbm''', &
               status_input)
            return
         end if
         if (.not. joint%half_wave_symmetric) then
            call fatal_error(error, '&harmonics parity = ''odd'': the response has even '// &
                             'harmonics, because of a static load, a load of an even '// &
                             'harmonic, a normal dof, a moving side or an even power '// &
                             'of a force; use '// &
                             '''auto'' or ''all''', status_input)
            return
         end if
         if (modulo(n_time, 2) == 1) then
            call fatal_error(error, '&harmonics parity = ''odd'' needs an even n_time: with '// &
                             to_text(n_time)//' instants the symmetry is not kept', status_input)
            return
         end if
         odd_only = .true.
      case default ! by what the model keeps
      end select
      call check_memory(case, harmonics, n_time, error)
      if (allocated(error)) return
      fourier = new_fourier(harmonics%n_harmonics, n_time, odd_only)
      select case (harmonics%method)
      case (method_tcm)
         call fourier%collocate(fourier%n_coefficients)
      case (method_tcm_least_squares)
         call fourier%collocate(least_squares_points(harmonics, fourier))
      case default ! the equations are those of the harmonics
      end select
   end subroutine choose_harmonics

   !> Room for what grows with the square of the harmonics: transforms, derivatives of the
   !> histories and of the pairs, and the Jacobian where it is asked for.
   subroutine check_memory(case, harmonics, n_time, error)
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics
      integer, intent(in) :: n_time
      type(error_type), allocatable, intent(out) :: error
      !> Copies of the transforms, and derivatives of the three components with their scratch.
      real(wp), parameter :: transforms = 4.0_wp, derivatives = 6.0_wp
      real(wp) :: nc, n_pairs, n_reals

      nc = 2.0_wp*harmonics%n_harmonics + 1.0_wp
      n_pairs = real(case%contact%n_pairs, wp)
      n_reals = transforms*nc*n_time + nc*case%model%n_dof
      if (case%contact%n_pairs > 0) then
         n_reals = n_reals + derivatives*nc*n_time + (3.0_wp*nc)**2*n_pairs + 12.0_wp*n_pairs*n_time
         if (case%solver%linear == linear_lu .or. case%solver%kind == solver_powell) then
            n_reals = n_reals + (3.0_wp*nc*n_pairs)**2
         end if
      end if
      call require_memory(n_reals, '&harmonics n_harmonics = '// &
                          to_text(harmonics%n_harmonics)//' with '//to_text(n_time)// &
                          ' instants', 'take fewer harmonics or instants', error)
   end subroutine check_memory

   !> Instants of the equations in the least-squares variant: twice the unknowns, where the user
   !> leaves the choice.
   pure integer function least_squares_points(harmonics, fourier) result(n_points)
      type(harmonics_options), intent(in) :: harmonics
      type(fourier_type), intent(in) :: fourier

      n_points = harmonics%n_collocation
      if (n_points == 0) n_points = 2*fourier%n_coefficients
      n_points = min(max(n_points, fourier%n_coefficients), fourier%n_time)
   end function least_squares_points

   !> Instants per period where the input leaves the choice: what the laws need.
   pure integer function automatic_n_time(harmonics, joint, forces) result(n_time)
      type(harmonics_options), intent(in) :: harmonics
      type(joint_type), intent(in) :: joint
      type(force_list), intent(in) :: forces
      integer :: h

      h = harmonics%n_harmonics
      n_time = 2*h + 1
      if (harmonics%method == method_hdhb) return
      n_time = max(2*h + 2, forces%least_instants(h, separates=any(joint%row(3, :) > 0)))
      if (forces%entry(forces%pairs)%law%facts%follows_events) then
         n_time = max(n_time, least_events(harmonics))
      end if
      n_time = nint(n_time*2.0_wp**harmonics%doublings)
      n_time = n_time + modulo(n_time, 2)
   end function automatic_n_time

   !> Whether events are located. Left to the program, they are where that is exact (one tangential
   !> direction) and nothing asks for instants: as fast as sampling, faster from 7 harmonics on, and
   !> more accurate (measured by `make bench-precision`). With an accuracy to keep, also for few
   !> pairs with two directions: for one or 16, fewer instants make up for what each costs; for 48
   !> not.
   pure logical function locates_events(case, harmonics, joint)
      type(case_type), intent(in) :: case
      type(harmonics_options), intent(in) :: harmonics
      type(joint_type), intent(in) :: joint

      locates_events = harmonics%sampling == sampling_events .and. case%contact%n_pairs > 0
      if (harmonics%sampling /= sampling_auto .or. case%contact%n_pairs == 0) return
      if (harmonics%accuracy > 0.0_wp) then
         locates_events = .not. is_planar(joint) .or. case%contact%n_pairs <= few_pairs
         return
      end if
      if (analyses(case%analysis)%finds_frequency) then
         ! Instants put corners into curves whose derivatives are followed.
         locates_events = harmonics%n_time == 0
         return
      end if
      locates_events = harmonics%method == method_hbm .and. harmonics%n_time == 0 .and. &
                       (analyses(case%analysis)%is_response .or. &
                        analyses(case%analysis)%wears) .and. &
                       .not. case%output%histories .and. .not. case%sweep%stability .and. &
                       .not. is_planar(joint)
   end function locates_events

   !> Whether a pair moves in two tangential directions.
   pure logical function is_planar(joint)
      type(joint_type), intent(in) :: joint

      is_planar = any(all(joint%row(1:2, :) > 0, dim=1))
   end function is_planar

   !> Instants that isolate the events, twice the 2H+1 of a collocation, which then lie evenly.
   pure integer function least_events(harmonics) result(n_time)
      type(harmonics_options), intent(in) :: harmonics
      integer :: n_points

      n_time = max(fewest_for_events, 2*(2*harmonics%n_harmonics + 1))
      n_points = harmonics%n_collocation
      if (harmonics%method /= method_tcm_least_squares .or. n_points == 0) return
      n_time = n_points*((n_time + n_points - 1)/n_points)
   end function least_events

end module fw_problem
