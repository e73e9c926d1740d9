!> The wear of a case as twice its harmonics see it: whether a pair that slips does so because too
!> few harmonics say so, which is worn away before anybody can tell.
module fw_finer_wear
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_level, only: level_type
   use fw_newton, only: solver_report
   use fw_recovery, only: carry_solution
   use fw_reduction, only: held_basis
   use fw_restart_rows, only: n_notes
   use fw_summary, only: summary_type
   use fw_text, only: to_text
   use fw_wear_march, only: steady_reached, wear_march
   use fw_wear_options, only: wear_energy
   use fw_wear_step, only: new_wear_stepper, wear_state, wear_stepper
   use fw_wear_system, only: new_wear_system, wear_system
   implicit none (type, external)
   private

   public :: finer_wear

   !> Rate of a pair, as a part of the largest, that matters.
   real(wp), parameter :: matters = 1.0e-3_wp
   !> Part of the rate of a pair that twice the harmonics leave, below which the pair slips for want
   !> of harmonics: where few are enough it changes by some hundredths.
   real(wp), parameter :: hardly = 0.5_wp
   !> Relative residual of linear solutions from the solution with fewer harmonics.
   real(wp), parameter :: guess_forcing = 1.0e-2_wp
   !> Residual of the finer solutions, of which rates are asked to a factor of two.
   real(wp), parameter :: finer_tolerance = 1.0e-5_wp
   !> States that are looked at: each costs a solution with twice the harmonics.
   integer, parameter :: most_states = 24

   type :: finer_wear
      !> The level with 2H+1 harmonics, at one address, and its wear.
      class(level_type), pointer, private :: level => null()
      type(wear_system), private :: system
      type(wear_stepper), private :: stepper
      !> Modes of the structure that the case itself found.
      type(held_basis) :: held
      integer, private :: n_states = 0
      !> What was found: the first pair that slips only with H harmonics, the cycle, whether there
      !> is such a state (1); of a steady state, whether a pair still wears.
      integer, private :: pair = 0, n_found = 0
      real(wp), private :: cycles = 0.0_wp
      logical, private :: still_wears = .false.
   contains
      procedure :: look
      procedure :: look_at_end
      procedure :: notes
      procedure :: take_notes
      procedure :: remark
      procedure :: finish
   end type finer_wear

contains

   !> Whether the pairs that are named slip at a state with twice the harmonics too.
   subroutine look(self, case, march, system, state, slipping)
      class(finer_wear), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(wear_march), intent(in) :: march
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      logical, intent(in) :: slipping(:)
      real(wp) :: rate(size(slipping))
      logical :: known
      integer :: i

      ! One is enough to be said.
      if (.not. any(slipping) .or. self%n_states >= most_states .or. self%n_found > 0) return
      call solve(self, case, march, system, state, rate, known)
      if (.not. known) return
      i = findloc(slipping .and. state%rate > matters*maxval(state%rate) .and. &
                  rate < hardly*state%rate, .true., dim=1)
      if (i == 0) return
      self%n_found = 1
      self%pair = i
      self%cycles = state%cycles
   end subroutine look

   !> Whether a steady state is one with twice the harmonics too.
   subroutine look_at_end(self, case, march, system, state)
      class(finer_wear), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(wear_march), intent(in) :: march
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      real(wp) :: rate(size(state%rate))
      logical :: known

      if (march%steady /= steady_reached .or. march%n_steps == 0) return
      call solve(self, case, march, system, state, rate, known)
      if (known) self%still_wears = maxval(rate) > matters*march%largest_rate
   end subroutine look_at_end

   !> Rates of the finer balance at the depths of a state.
   subroutine solve(self, case, march, system, state, rate, known)
      class(finer_wear), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(wear_march), intent(in) :: march
      type(wear_system), intent(in) :: system
      type(wear_state), intent(in) :: state
      real(wp), intent(out) :: rate(:)
      !> False where it did not converge.
      logical, intent(out) :: known
      type(wear_state) :: finer
      type(solver_report) :: report
      type(error_type), allocatable :: error
      integer :: n

      known = .false.
      rate = 0.0_wp
      if (.not. associated(self%level)) call build(self, case, march, error)
      if (allocated(error)) return
      self%n_states = self%n_states + 1
      call self%system%set_parameter(system%vibration%frequency(), error)
      if (allocated(error)) return
      n = self%system%n_vibration()
      allocate (finer%x(self%system%n))
      call carry_solution(system%vibration, state%x(:system%n_vibration()), &
                          self%level%system, finer%x(:n))
      finer%x(n + 1:) = state%x(system%n_vibration() + 1:)
      call self%stepper%settle(self%system, finer, report, tolerance=finer_tolerance)
      known = report%converged
      if (known) rate = finer%rate
   end subroutine solve

   !> A level with more than twice the harmonics, made when it is first asked for.
   subroutine build(self, case, march, error)
      class(finer_wear), intent(inout) :: self
      type(case_type), intent(in) :: case
      class(wear_march), intent(in) :: march
      type(error_type), allocatable, intent(out) :: error

      allocate (self%level)
      call self%level%build(case, 2*case%harmonics%n_harmonics + 1, error, held=self%held)
      if (allocated(error)) then
         ! Not looked for, then: no state is known.
         self%n_states = most_states
         return
      end if
      call self%level%system%set_frequency(case%sweep%start, error)
      if (allocated(error)) return
      call new_wear_system(self%level%system, case%contact, case%wear%coefficient, &
                           case%wear%law == wear_energy, self%system)
      self%stepper = new_wear_stepper(march%options, march%stepper%pseudo_scheme, &
                                      self%level%solver%method%newton)
      ! The guess is that of other harmonics: first steps from there need not be exact.
      self%stepper%newton%loosest = guess_forcing
   end subroutine build

   !> What a run that is continued has to know.
   pure function notes(self)
      class(finer_wear), intent(in) :: self
      real(wp) :: notes(n_notes)

      notes = [real(self%n_states, wp), real(self%n_found, wp), real(self%pair, wp), self%cycles]
   end function notes

   !> What a resumed run knew already, in the order in which `notes` gives it.
   pure subroutine take_notes(self, notes)
      class(finer_wear), intent(inout) :: self
      real(wp), intent(in) :: notes(n_notes)

      self%n_states = nint(notes(1))
      self%n_found = nint(notes(2))
      self%pair = nint(notes(3))
      self%cycles = notes(4)
   end subroutine take_notes

   !> Say what was found.
   subroutine remark(self, case, summary)
      class(finer_wear), intent(in) :: self
      type(case_type), intent(in) :: case
      type(summary_type), intent(inout) :: summary
      character(:), allocatable :: orders

      orders = to_text(case%harmonics%n_harmonics)//' harmonics, and with '// &
               to_text(2*case%harmonics%n_harmonics + 1)
      if (self%n_found > 0) call summary%remarks%add('too few harmonics', 'pair '// &
         to_text(self%pair)//' slips at cycle '//to_text(self%cycles)//' with '//orders// &
         ' it sticks, or slips by less than half of it: what it wears is not given back; raise '// &
         'harmonics%n_harmonics')
      if (self%still_wears) call summary%remarks%add('steady state not confirmed', &
         'nothing wears any more with '//orders//' a pair still does; raise '// &
         'harmonics%n_harmonics')
   end subroutine remark

   !> Give the memory back.
   subroutine finish(self)
      class(finer_wear), intent(inout) :: self

      if (associated(self%level)) deallocate (self%level)
   end subroutine finish

end module fw_finer_wear
