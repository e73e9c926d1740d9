!> Analysis 'population': many disks that differ in their blade frequencies, of each the largest
!> amplitude over its blades and the sweep, in parts of that of the tuned disk.
!>
!> Patterns are of no order: each is solved as if it were the only one.
module fw_run_population
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_analysis, only: analysis, run_type
   use fw_blade_peaks, only: blade_peaks, blade_response
   use fw_all_sectors, only: all_sectors, new_all_sectors
   use fw_case, only: case_type
   use fw_cyclic_relative, only: cyclic_relative, new_cyclic_relative
   use fw_error, only: error_type, fatal_error, status_input, status_stopped
   use fw_frequency_response, only: new_strategy
   use fw_kinds, only: wp
   use fw_linear_blades, only: linear_response
   use fw_memory, only: require_memory
   use fw_model, only: model_type
   use fw_observer, only: observer_type
   use fw_point, only: point_type
   use fw_population_group, only: population_group
   use fw_problem, only: build_system
   use fw_response_quantity, only: of_first_harmonic
   use fw_sector_means, only: means_none
   use fw_size_options, only: sizes
   use fw_strategy, only: new_request, point_strategy
   use fw_sweep, only: sweep_places
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: population_analysis

   !> Many mistuned disks, each solved for its largest amplitude alone.
   type, extends(analysis) :: population_analysis
   contains
      procedure :: start
      procedure :: check
   end type population_analysis

   !> Disks solved by the balance, point after point.
   type, extends(blade_response) :: balanced_response
      class(case_type), pointer :: case => null()
      class(observer_type), pointer :: observer => null()
      !> The case of the pattern, and how its points are solved.
      class(case_type), allocatable :: one
      class(point_strategy), allocatable :: strategy
   contains
      procedure :: begin => begin_balanced
      procedure :: at => solve_balanced
   end type balanced_response

   !> Frequencies between the rows of a sweep that are kept for all disks, for each row.
   integer, parameter :: shared_per_row = 16

contains

   !> All at once: there are no rows of points.
   subroutine start(self, case, run, error)
      class(population_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      class(blade_response), allocatable, target :: response
      type(population_group) :: group

      associate (unused => self)
      end associate
      call require_quantities(case, error)
      if (allocated(error)) return
      call new_response(case, run, response, error)
      if (allocated(error)) return
      call solve_all(case, response, run, group, error)
      ! Patterns that were done by then are a result.
      call run%forgive_stop(error)
      if (.not. allocated(error)) call run%writer%add(group, error)
      if (.not. allocated(error)) call make_table(case, group, run%table)
   end subroutine start

   !> The tuned disk, without a solution.
   subroutine check(self, case, error)
      class(population_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      class(case_type), allocatable :: one
      class(point_strategy), allocatable, target :: strategy

      associate (unused => self)
      end associate
      call require_quantities(case, error)
      if (allocated(error)) return
      call new_case(case, 0, one)
      call new_strategy(one, strategy)
      call strategy%start(one, error)
   end subroutine check

   !> Something has to be looked at.
   subroutine require_quantities(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      if (case%model%n_observed() > 0) return
      call fatal_error(error, "case%analysis = 'population' without observed quantities: must "// &
                       'have output%observe, or /observe of the model', status_input)
   end subroutine require_quantities

   !> Who solves the disks.
   subroutine new_response(case, run, response, error)
      type(case_type), intent(in), target :: case
      type(run_type), intent(in) :: run
      class(blade_response), allocatable, intent(out) :: response
      type(error_type), allocatable, intent(out) :: error
      type(balanced_response), allocatable :: balanced
      type(linear_response), allocatable :: linear

      if (is_linear(case)) then
         allocate (linear)
         call set_sizes(linear)
         linear%is_cheap = .true.
         call build_linear(case, linear, error)
         call move_alloc(linear, response)
      else
         allocate (balanced)
         call set_sizes(balanced)
         balanced%case => case
         balanced%observer => run%observer
         call move_alloc(balanced, response)
      end if

   contains

      subroutine set_sizes(made)
         class(blade_response), intent(inout) :: made

         made%n_sectors = case%model%cyclic%n_sectors
         made%n_observed = case%model%n_observed()/made%n_sectors
      end subroutine set_sizes

   end subroutine new_response

   !> Whether the tuned disk serves all patterns: forces in proportion to the motion, loads that are
   !> those of every frequency, rows of all sectors that are factored at once.
   pure logical function is_linear(case)
      type(case_type), intent(in) :: case

      associate (cyclic => case%model%cyclic)
         is_linear = .not. case%has_joint() .and. &
                     .not. allocated(case%model%waves%table_scale) .and. &
                     case%population%quantity == of_first_harmonic .and. &
                     cyclic%n_sectors*size(cyclic%deviation%rows, 1) <= sizes%whole_sectors
      end associate
   end function is_linear

   !> The tuned disk, rows of the deviation among its coordinates.
   subroutine build_linear(case, linear, error)
      type(case_type), intent(in) :: case
      type(linear_response), intent(inout), target :: linear
      type(error_type), allocatable, intent(out) :: error
      class(case_type), allocatable :: one

      linear%base = case%model%cyclic%deviation
      linear%patterns = case%population%blades
      call new_case(case, 0, one)
      call build_modal(one, linear%base%rows, linear%modal, error)
      if (.not. allocated(error) .and. .not. allocated(linear%modal)) then
         one%model%cyclic%deviation = linear%base
         one%model%cyclic%deviation%part = 0.0_wp
         call build_system(one, linear%problem, linear%system, error)
      end if
      if (.not. allocated(error)) call reserve_linear(case, linear, error)
   end subroutine build_linear

   !> The tuned disk by the modes of its nodal diameters, the rows behind what is observed of it.
   !> Not allocated where modes without damping are in the range, or more than K, M and C acts.
   subroutine build_modal(case, rows, modal, error)
      !> Of the tuned disk.
      class(case_type), intent(in) :: case
      !> (n_rows, n_dof)
      real(wp), intent(in) :: rows(:, :)
      type(all_sectors), allocatable, intent(out) :: modal
      type(error_type), allocatable, intent(out) :: error
      type(model_type), allocatable :: model
      type(cyclic_relative) :: relative
      real(wp), allocatable :: observe(:, :)

      if (case%model%cyclic%has_nodal() .or. allocated(case%model%cyclic%speed)) return
      allocate (model)
      model = case%model
      associate (n => size(model%observe_matrix, 1))
         allocate (observe(n + size(rows, 1), size(rows, 2)))
         observe(:n, :) = model%observe_matrix
         observe(n + 1:, :) = rows
      end associate
      call move_alloc(observe, model%observe_matrix)
      call new_cyclic_relative(model, [integer ::], [integer ::], [integer ::], relative)
      allocate (modal)
      call new_all_sectors(model, relative, [1], case%sweep%range(), means_none, modal, error)
      if (allocated(error)) return
      if (modal%is_modal()) then
         call modal%drop_round_off()
      else
         deallocate (modal)
      end if
   end subroutine build_modal

   !> Room for the tuned disk at the frequencies that disks share: all rows of the sweep, most of
   !> what is looked at between them.
   subroutine reserve_linear(case, linear, error)
      type(case_type), intent(in) :: case
      type(linear_response), intent(inout) :: linear
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: n_reals, n, r

      n = linear%n_sectors
      r = size(linear%base%rows, 1)
      n_reals = 2.0_wp*(n*r)**2 + 2.0_wp*shared_per_row*n*case%sweep%n_points* &
                (r + 1.0_wp)*(r + linear%n_observed)
      call require_memory(n_reals, '&population with sweep%n_points = '// &
                          to_text(case%sweep%n_points)//' and '//to_text(nint(n*r))//' rows of '// &
                          'all sectors', 'take fewer points or rows', error)
      if (.not. allocated(error)) call linear%reserve(shared_per_row*case%sweep%n_points)
   end subroutine reserve_linear

   !> The tuned disk, then pattern after pattern.
   subroutine solve_all(case, response, run, group, error)
      type(case_type), intent(in) :: case
      class(blade_response), intent(inout), target :: response
      type(run_type), intent(inout), target :: run
      type(population_group), intent(inout) :: group
      type(error_type), allocatable, intent(out) :: error
      type(blade_peaks) :: peaks
      real(wp), allocatable :: rows(:)
      real(wp) :: none
      integer :: i, n_open

      none = ieee_value(1.0_wp, ieee_quiet_nan)
      associate (n => case%population%blades%count(), m => response%n_observed)
         allocate (group%amplitude(m, n), group%omega(m, n), group%amplification(m, n), source=none)
         allocate (group%sector(m, n), source=-1)
         allocate (group%tuned(m), source=none)
         allocate (group%converged(n), group%solved(n), source=0)
      end associate
      rows = sweep_places(case)
      n_open = 0
      do i = 0, case%population%blades%count()
         if (run%observer%is_stopping()) then
            call fatal_error(error, 'stopped between disks', status_stopped)
            return
         end if
         call response%begin(i, error)
         if (.not. allocated(error)) call peaks%find(response, rows, case%population%peaks, error)
         if (allocated(error)) return
         n_open = n_open + peaks%n_open
         run%state%n_points = run%state%n_points + peaks%n_solved
         run%state%n_converged = run%state%n_converged + peaks%n_converged
         if (i == 0) then
            where (peaks%sector >= 0) group%tuned = peaks%amplitude
            cycle
         end if
         group%converged(i) = peaks%n_converged
         group%solved(i) = peaks%n_solved
         group%sector(:, i) = peaks%sector
         where (peaks%sector >= 0)
            group%amplitude(:, i) = peaks%amplitude
            group%omega(:, i) = peaks%omega
         end where
         where (peaks%sector >= 0 .and. group%tuned > 0.0_wp) group%amplification(:, i) = &
            peaks%amplitude/group%tuned
      end do
      if (n_open > 0) call run%tell('population peaks', to_text(n_open)//' maxima were not '// &
                                    'found to the end: the largest amplitude that was solved '// &
                                    'stands for them; take more sweep%n_points')
   end subroutine solve_all

   !> Of a pattern, from 1, or of the tuned disk: no deviation, and pairs that are alike.
   subroutine new_case(case, pattern, one)
      type(case_type), intent(in) :: case
      integer, intent(in) :: pattern
      class(case_type), allocatable, intent(out) :: one

      allocate (one, source=case)
      one%output%contact = .false.
      if (pattern > 0) then
         call case%population%blades%add_pattern(pattern, one%model%cyclic%deviation)
      else
         deallocate (one%model%cyclic%deviation)
         call one%contact%level()
      end if
   end subroutine new_case

   !> Take the next disk: its own case, and a strategy that knows nothing of the last one.
   subroutine begin_balanced(self, pattern, error)
      class(balanced_response), intent(inout), target :: self
      integer, intent(in) :: pattern
      type(error_type), allocatable, intent(out) :: error

      if (allocated(self%strategy)) deallocate (self%strategy)
      if (allocated(self%one)) deallocate (self%one)
      call new_case(self%case, pattern, self%one)
      call new_strategy(self%one, self%strategy)
      call self%strategy%start(self%one, error)
   end subroutine begin_balanced

   !> From the solutions of the frequencies before.
   subroutine solve_balanced(self, omega, amplitude, converged, error)
      class(balanced_response), intent(inout), target :: self
      real(wp), intent(in) :: omega
      real(wp), intent(out) :: amplitude(:, :)
      logical, intent(out) :: converged
      type(error_type), allocatable, intent(out) :: error
      type(point_type) :: point

      amplitude = 0.0_wp
      converged = .false.
      call self%strategy%solve_in_time(self%one, new_request(self%one, omega, self%observer), &
                                       point, error)
      if (allocated(error)) return
      converged = point%converged
      if (.not. converged) return
      if (self%case%population%quantity == of_first_harmonic) then
         amplitude = reshape(norm2(point%coefficients(2:3, :), dim=1), shape(amplitude))
      else
         amplitude = reshape(point%amplitude, shape(amplitude))
      end if
   end subroutine solve_balanced

   !> What the disks come to.
   subroutine make_table(case, group, table)
      type(case_type), intent(in) :: case
      type(population_group), intent(in) :: group
      !> For the summary.
      type(string_type), allocatable, intent(out) :: table(:)
      character(120) :: line
      integer :: i, n

      allocate (table(0))
      n = size(group%solved)
      call append(table, 'disks             '//to_text(n)//', '//to_text(sum(group%converged))// &
                  ' of '//to_text(sum(group%solved))//' points solved')
      call append(table, '  tuned           amplification: mean     largest   of disk  sector')
      do i = 1, size(group%tuned)
         associate (factor => group%amplification(i, :), known => group%sector(i, :) >= 0)
            if (.not. any(known)) cycle
            associate (at => maxloc(factor, dim=1, mask=known))
               write (line, '(es13.5, es30.5, es13.5, i8, i8)') group%tuned(i), &
                  sum(factor, mask=known)/count(known), factor(at), at - 1, group%sector(i, at)
            end associate
            associate (name => case%model%observe_name(i)%text)
               ! Without its sector.
               call append(table, trim(line)//'  '// &
                           name(:max(0, index(name, '@', back=.true.) - 1)))
            end associate
         end associate
      end do
   end subroutine make_table

end module fw_run_population
