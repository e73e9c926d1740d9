!> Every quantity of a solution point, declared once: what it is called, its unit and dimensions,
!> when a result holds it (fw_quantity_conditions), and where its numbers are in a point. The rows
!> of the result file, their labels, what a caller may ask of a point and what a continued run
!> copies all follow from here.
!>
!> A new quantity is one line in `point_quantities` and its case in `values_of`.
module fw_point_quantities
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_case, only: case_type
   use fw_elements, only: element_kind
   use fw_hdf5, only: growing_integer, growing_logical, growing_real
   use fw_kinds, only: wp
   use fw_parameters, only: is_of_elements, is_of_sectors, is_per_element, is_per_pair, &
      is_per_spring, n_parameter_words, parameter_dataset, parameter_group, parameter_words
   use fw_patches, only: count_patches
   use fw_point, only: point_type
   use fw_quantity_conditions, only: always, asks_stability, changes_friction, follows_branch, &
      follows_frequency, follows_parameter, follows_speed, goes_over, has_dampers, has_endurance, &
      has_levels, has_stress, has_structural, has_tensor, is_accurate, is_controlled, is_mission, &
      is_mistuned, is_mode, is_response, moves_base, moves_obstacle, scales_load, shows_contact, &
      shows_user, wears
   use fw_response_rows, only: is_of_pairs, value_words
   use fw_sensitivity_options, only: of_itself
   use fw_text, only: string_type
   use fw_text_list, only: words_of
   implicit none (type, external)
   private

   public :: quantity_type, point_quantities, unknown_size

   !> Size of a dimension that only the numbers themselves tell.
   integer, parameter :: unknown_size = -1

   type :: quantity_type
      !> Name of the dataset, without the slash in front.
      character(64) :: name
      !> Kind of the elements: growing_real, growing_integer or growing_logical.
      integer :: kind_of = growing_real
      !> A unit, or the quantity (in angle brackets) whose unit is that of the model.
      character(16) :: unit
      !> Names of the dimensions in the order of h5py, separated by blanks. The first is 'point';
      !> where it is 'step', only points that know the quantity have a row.
      character(32) :: dimensions
      character(64) :: long_name
      !> What an integer reads as where it is not known.
      integer :: missing = 0
      !> Whether the integers are places, from 0, in the words for what gave a solution.
      logical :: is_served_by = .false.
      !> Whether an attribute names the parameter that the sweep goes over.
      logical :: names_parameter = .false.
      !> Whether the result of a case has it at all.
      procedure(is_wanted), pointer, nopass :: exists => null()
      !> Of derivatives: the quantity, and the parameter (0: deviation; `of_itself`: the value of
      !> the other one), which no name tells.
      integer :: sensitivity(2) = 0
   contains
      procedure :: row_shape
      procedure :: row
      procedure :: is_there
   end type quantity_type

   abstract interface
      !> Whether the result of a case holds the quantity.
      pure logical function is_wanted(case)
         import :: case_type
         implicit none (type, external)
         type(case_type), intent(in) :: case
      end function is_wanted
   end interface

contains

   !> The table. Rows of a file are created and appended in its order.
   subroutine point_quantities(list)
      type(quantity_type), allocatable, intent(out) :: list(:)
      ! More lines than the table has, so that it need not be moved while it grows.
      integer, parameter :: room = 200
      integer, parameter :: r = growing_real, i = growing_integer, l = growing_logical
      integer :: n

      allocate (list(room))
      n = 0
      call add('omega', r, 'rad/s', 'point', 'angular frequency of the excitation', always)
      call add('parameter', r, '', 'point', 'value of the parameter that the sweep goes over', &
               goes_over)
      list(n)%names_parameter = .true.
      call add('load/scale', r, '1', 'point', 'factor of the vibratory loads of the model', &
               scales_load)
      call add('base/coefficients', r, '<length>', 'point coefficient', &
               'Fourier coefficients 0, c1, s1, ... of the motion of the base', moves_base)
      call add('control/amplitude', r, '<length>', 'point', &
               'amplitude for which the load was found', is_controlled)
      call add('coefficients', r, '<length>', 'point coefficient observed', &
               'Fourier coefficients 0, c1, s1, ... of observed quantities', always)
      call add('amplitude', r, '<length>', 'point observed', 'largest magnitude over the period', &
               always)
      call add('blades/largest', r, '<length>', 'point quantity', &
               'largest amplitude of all sectors', is_mistuned)
      call add('blades/sector', i, '', 'point quantity', 'sector that has it, from 0', is_mistuned)
      list(n)%missing = -1
      call add('blades/content', r, '<length>', 'point quantity wave', &
               'amplitudes of the nodal diameters in the first harmonic', is_mistuned)
      call add('converged', l, '', 'point', 'whether the point converged', always)
      call add('iterations', i, '1', 'point', 'iterations of the solver', always)
      call add('residual', r, '1', 'point', 'residual over vibratory load', always)
      call add('seconds', r, 's', 'point', 'time spent on the point', always)
      call add('served_by', i, '', 'point', 'what gave the solution, an index into names', &
               is_response)
      ! What does not fit a line of the table is set behind it.
      list(n)%is_served_by = .true.
      call add('fold', l, '', 'point', 'whether the branch turns here', follows_branch)
      call add('tangent/omega', r, 'rad/s', 'point', 'direction of the branch, frequency', &
               follows_frequency)
      call add('tangent/parameter', r, '', 'point', 'direction of the branch, parameter', &
               follows_parameter)
      call add('tangent/coefficients', r, '<length>', 'point coefficient observed', &
               'direction of the branch, coefficients', follows_branch)
      call add('harmonics', i, '1', 'point', 'harmonics of the balance', has_levels)
      call add('instants', i, '1', 'point', 'instants of the period', is_accurate)
      call add('error_estimate', r, '1', 'point', 'bound of the relative error of the response', &
               is_accurate)
      call add('floquet/stable', i, '', 'point', &
               '1 stable, 0 unstable, -1 undecided or not known', asks_stability)
      list(n)%missing = -1
      call add('floquet/multipliers', r, '1', 'point multiplier part', &
               'Floquet multipliers, real and imaginary part', asks_stability)
      call add('floquet/error', r, '1', 'point multiplier', 'estimated error of each multiplier', &
               asks_stability)
      call add('contact/force', r, '<force>', 'point coefficient pair direction', &
               'Fourier coefficients of the contact forces t1, t2, n', shows_contact)
      call add('contact/fraction', r, '1', 'point pair state', &
               'share of the period in stick, slip, open', shows_contact)
      call add('contact/dissipation', r, '<energy>', 'point pair', 'friction energy per cycle', &
               shows_contact)
      call add('contact/obstacle_work', r, '<energy>', 'point pair', &
               'work per cycle of obstacles that move', moves_obstacle)
      call add('damper/dissipation', r, '<energy>', 'point dampers', 'energy that each damper '// &
               'takes per cycle', has_dampers)
      call add('structural/dissipation', r, '<energy>', 'point', &
               'work of hysteretic damping per cycle', has_structural)
      call add('speed', r, 'rad/s', 'point', 'rotation speed', follows_speed)
      call add('user/force', r, '', 'point coefficient law input', &
               'Fourier coefficients of the forces of user laws', shows_user)
      call add('user/work', r, '', 'point law', &
               'work per cycle that user laws take', shows_user)
      call add('history/observed', r, '<length>', 'point instant observed', &
               'observed quantities over one period', always)
      call add('history/force', r, '<force>', 'point instant pair direction', &
               'contact forces t1, t2, n over one period', always)
      call add('history/relative_displacement', r, '<length>', 'point instant pair direction', &
               'relative displacement t1, t2, n over one period', always)
      call add('mode/damping_ratio', r, '1', 'point', 'damping ratio of the mode, xi/(2 omega)', &
               is_mode)
      call add('mode/self_excitation', r, '1/s', 'point', &
               'self-excitation xi in proportion to mass', is_mode)
      call add('mode/modal_amplitude', r, '', 'point', &
               'modal amplitude sqrt(U^H M U) of the first harmonic', is_mode)
      call add('mode/first_harmonic', r, '<length>', 'point observed', &
               'amplitude of the first harmonic', is_mode)
      call add('wear/flight', i, '1', 'step', 'flight, the last one of a jump; 0 before', &
               is_mission)
      call add('wear/block', i, '1', 'step', 'block of the flight; 0 before', is_mission)
      call add('wear/cycles', r, '1', 'step', 'cycles of vibration', wears)
      call add('wear/depth', r, '<length>', 'step pair', 'wear depth', wears)
      call add('wear/rate', r, '<length>', 'step pair', 'wear depth per cycle', wears)
      call add('wear/mu', r, '1', 'step pair', 'friction coefficient at the depth', &
               changes_friction)
      call add('wear/energy', r, '<energy>', 'step pair', 'accumulated friction energy', wears)
      call add('wear/volume', r, '<volume>', 'step patch', 'worn volume of the patch', wears)
      call add('stress/amplitude', r, '<stress>', 'point stress', &
               'stress amplitude of the cycle', has_stress)
      call add('stress/mean', r, '<stress>', 'point stress', 'mean stress of the cycle', has_stress)
      call add('stress/utilisation', r, '1', 'point stress', 'share of what the point endures', &
               has_endurance)
      call add('stress/worst', i, '', 'point', 'point of the largest utilisation or amplitude', &
               has_stress)
      list(n)%missing = -1
      call add('stress/coefficients', r, '<stress>', 'point coefficient stress component', &
               'Fourier coefficients of xx, yy, zz, xy, yz, zx', has_tensor)
      call add_sensitivities()
      list = list(:n)

   contains

      !> Derivatives of every quantity by every parameter, and its deviation.
      subroutine add_sensitivities()
         character(32) :: name
         character(16) :: of
         integer :: p, q

         do q = 1, size(value_words)
            of = merge('         ', ' observed', is_of_pairs(q))
            do p = 1, n_parameter_words
               call parameter_dataset(p, name)
               call add('sensitivity/'//trim(value_words(q))//'/'//trim(name), r, '', &
                        'point'//trim(of)//trim(elements_of(p)), 'derivative of '// &
                        trim(value_words(q))//' by '//trim(parameter_words(p)), always)
               list(n)%sensitivity = [q, p]
            end do
            call add('sensitivity/deviation/'//trim(value_words(q)), r, '', &
                     'point'//trim(of), 'standard deviation of '//trim(value_words(q)), &
                     always)
            list(n)%sensitivity = [q, 0]
            call add('sensitivity/value/'//trim(value_words(q)), r, '', 'point'//trim(of), &
                     trim(value_words(q)), always)
            list(n)%sensitivity = [q, of_itself]
         end do
         do p = 1, n_parameter_words
            call parameter_dataset(p, name)
            call add('sensitivity/value/'//trim(name), r, '', 'point'//trim(elements_of(p)), &
                     trim(parameter_words(p)), always)
            list(n)%sensitivity = [of_itself, p]
         end do
      end subroutine add_sensitivities

      !> The dimension of the elements that a parameter has a value for each of.
      pure function elements_of(parameter) result(dimension)
         integer, intent(in) :: parameter
         character(24) :: dimension

         dimension = ''
         if (is_per_pair(parameter)) dimension = ' pair'
         if (is_per_spring(parameter)) dimension = ' spring'
         if (is_of_sectors(parameter) .and. is_per_element(parameter)) dimension = ' value'
         if (.not. is_of_elements(parameter)) return
         call parameter_group(parameter, dimension)
         dimension = ' '//dimension(:23)
      end function elements_of

      !> A line of the table.
      subroutine add(name, kind_of, unit, dimensions, long_name, exists)
         character(*), intent(in) :: name, unit, dimensions, long_name
         integer, intent(in) :: kind_of
         procedure(is_wanted) :: exists
         type(quantity_type) :: quantity
         type(quantity_type), allocatable :: longer(:)

         if (n == size(list)) then
            allocate (longer(2*n))
            longer(:n) = list
            call move_alloc(longer, list)
         end if
         n = n + 1
         quantity%name = name
         quantity%kind_of = kind_of
         quantity%unit = unit
         quantity%dimensions = dimensions
         quantity%long_name = long_name
         quantity%exists => exists
         list(n) = quantity
      end subroutine add

   end subroutine point_quantities

   !> Shape of a row in Fortran, the order of h5py reversed; unknown_size where only the numbers
   !> tell.
   function row_shape(self, case) result(sizes)
      class(quantity_type), intent(in) :: self
      type(case_type), intent(in) :: case
      integer, allocatable :: sizes(:)
      type(string_type), allocatable :: words(:)
      integer :: i, n

      ! The first word is the point itself, which is no dimension of a row.
      words = words_of(trim(self%dimensions), ' ')
      n = size(words)
      allocate (sizes(n - 1))
      do i = 2, n
         sizes(n - i + 1) = size_of(words(i)%text, case)
      end do
   end function row_shape

   !> How long a dimension is in the result of a case.
   pure integer function size_of(dimension, case) result(n)
      character(*), intent(in) :: dimension
      type(case_type), intent(in) :: case

      select case (dimension)
      case ('observed')
         n = case%model%n_observed()
      case ('quantity')
         n = case%model%n_observed()/case%model%cyclic%n_solved()
      case ('wave')
         n = case%model%cyclic%n_sectors
      case ('coefficient')
         n = 2*max(case%harmonics%n_harmonics, case%output%tail) + 1
      case ('pair')
         n = case%contact%n_pairs
      case ('spring')
         n = case%springs%n_springs
      case ('stress')
         n = case%stress%n_points*case%model%cyclic%n_solved()
      case ('component')
         n = 6
      case ('law')
         n = case%elements%extent_of('user', 2)
      case ('input')
         n = case%elements%extent_of('user', 1)
      case ('patch')
         n = count_patches(case%contact)
      case ('dampers')
         n = case%elements%count_of('damper')*case%model%cyclic%n_solved()
      case ('direction', 'state')
         n = 3
      case ('part')
         n = 2
      case default ! elements of a group; instants, multipliers
         n = case%elements%count_of(dimension)
         if (n == 0) n = unknown_size
      end select
   end function size_of

   !> The numbers of a point as a row of the result; not allocated where they are not known.
   !> Harmonics that the point does not carry are zero: coefficients run slowest.
   subroutine row(self, point, case, values, usual)
      class(quantity_type), intent(in) :: self
      type(point_type), intent(in) :: point
      type(case_type), intent(in) :: case
      real(wp), allocatable, intent(out) :: values(:)
      !> Numbers of a whole row, where that is known.
      integer, intent(in), optional :: usual
      real(wp), allocatable :: carried(:)
      integer :: n
      logical :: is_whole

      if (any(self%sensitivity /= 0)) then
         call find_sensitivity(point, self%sensitivity, carried)
      else if (index(self%name, 'blades/') == 1) then
         if (case%model%cyclic%is_mistuned) call blades_of( &
            point, trim(self%name), case%model%cyclic%n_sectors, carried)
      else
         call values_of(point, self%name, carried)
      end if
      if (.not. allocated(carried)) return
      n = size(carried)
      is_whole = .false.
      if (present(usual)) is_whole = n == usual
      if (is_whole) then
         call move_alloc(carried, values)
         return
      end if
      ! Points with fewer harmonics have shorter rows: those of a result are all alike.
      if (index(self%dimensions, 'coefficient') > 0) n = max(n, product(self%row_shape(case)))
      allocate (values(n), source=0.0_wp)
      values(:size(carried)) = carried
   end subroutine row

   !> What sectors do beside each other: the largest amplitude, the sector that has it, and of the
   !> first harmonics U_j = c - i s the waves abs(sum exp(2 pi i j k/N) U_j)/N of the signed nodal
   !> diameters k, from above -N/2 up to N/2.
   pure subroutine blades_of(point, name, n_sectors, values)
      type(point_type), intent(in) :: point
      character(*), intent(in) :: name
      integer, intent(in) :: n_sectors
      real(wp), allocatable, intent(out) :: values(:)
      complex(wp) :: turn(0:n_sectors - 1), wave
      integer :: i, j, k, n
      real(wp), parameter :: full = 8.0_wp*atan(1.0_wp)

      if (.not. (allocated(point%amplitude) .and. allocated(point%coefficients))) return
      n = size(point%amplitude)/n_sectors
      select case (name)
      case ('blades/largest')
         values = [(maxval(point%amplitude(i::n)), i=1, n)]
      case ('blades/sector')
         values = [(real(maxloc(point%amplitude(i::n), dim=1) - 1, wp), i=1, n)]
      case default
         if (size(point%coefficients, 1) < 3) return
         turn = [(exp(cmplx(0.0_wp, full*j/n_sectors, wp)), j=0, n_sectors - 1)]
         allocate (values(n*n_sectors))
         do i = 1, n
            do k = 1, n_sectors
               wave = (0.0_wp, 0.0_wp)
               do j = 0, n_sectors - 1
                  wave = wave + turn(modulo(j*(k - 1 - (n_sectors - 1)/2), n_sectors))* &
                         cmplx(point%coefficients(2, j*n + i), -point%coefficients(3, j*n + i), wp)
               end do
               values((i - 1)*n_sectors + k) = abs(wave)/n_sectors
            end do
         end do
      end select
   end subroutine blades_of

   !> Whether the result of a case has the quantity.
   pure logical function is_there(self, case)
      class(quantity_type), intent(in) :: self
      type(case_type), intent(in) :: case

      if (any(self%sensitivity /= 0)) then
         is_there = case%sensitivity%has(self%sensitivity(1), self%sensitivity(2))
      else
         is_there = self%exists(case)
      end if
   end function is_there

   !> The numbers of a quantity in a point, laid out as h5py shows them (the last index runs
   !> fastest); not allocated where they are not known. A flag is 1 or 0.
   subroutine values_of(point, name, values)
      type(point_type), intent(in) :: point
      character(*), intent(in) :: name
      real(wp), allocatable, intent(out) :: values(:)
      integer :: k

      ! Matrices are (.., n_observed) in memory, and h5py shows the observed quantity last: turned.
      ! Blocks by pair have the order of h5py reversed already: as they are.
      select case (name)
      case ('omega')
         values = [point%omega]
      case ('parameter')
         values = [point%place]
      case ('load/scale')
         values = [point%load_scale]
      case ('base/coefficients')
         if (allocated(point%base)) values = point%base
      case ('control/amplitude')
         values = [point%control]
      case ('coefficients')
         call by_rows(point%coefficients, values)
      case ('amplitude')
         if (allocated(point%amplitude)) values = point%amplitude
      case ('converged')
         values = [flag(point%converged)]
      case ('iterations')
         values = [real(point%iterations, wp)]
      case ('residual')
         values = [point%residual]
      case ('seconds')
         values = [point%seconds]
      case ('served_by')
         values = [real(point%served_by, wp)]
      case ('fold')
         values = [flag(point%fold)]
      case ('tangent/omega')
         values = [point%tangent_omega]
      case ('tangent/parameter')
         values = [point%tangent_parameter]
      case ('tangent/coefficients')
         call by_rows(point%tangent, values)
      case ('harmonics')
         values = [real(point%n_harmonics, wp)]
      case ('instants')
         values = [real(point%n_time, wp)]
      case ('error_estimate')
         if (point%converged .and. point%error_estimate < huge(1.0_wp)) then
            values = [point%error_estimate]
         end if
      case ('floquet/stable')
         if (allocated(point%multipliers)) values = [real(point%verdict, wp)]
      case ('floquet/multipliers')
         if (.not. allocated(point%multipliers)) return
         values = [(real(point%multipliers(k), wp), aimag(point%multipliers(k)), &
                    k=1, size(point%multipliers))]
      case ('floquet/error')
         if (.not. allocated(point%multiplier_error)) return
         values = point%multiplier_error
         where (.not. values < huge(1.0_wp)) values = ieee_value(1.0_wp, ieee_quiet_nan)
      case ('contact/force')
         if (allocated(point%force)) values = reshape(point%force, [size(point%force)])
      case ('contact/fraction')
         if (allocated(point%fraction)) values = reshape(point%fraction, [size(point%fraction)])
      case ('contact/dissipation')
         if (allocated(point%dissipation)) values = point%dissipation
      case ('contact/obstacle_work')
         if (allocated(point%obstacle_work)) values = point%obstacle_work
      case ('damper/dissipation')
         if (.not. allocated(point%work_of)) return
         k = element_kind('damper')
         if (allocated(point%work_of(k)%values)) values = point%work_of(k)%values
      case ('structural/dissipation')
         values = [point%structural_work]
      case ('speed')
         values = [point%speed]
      case ('user/force')
         if (.not. allocated(point%work_of)) return
         k = element_kind('user')
         associate (found => point%work_of(k))
            if (allocated(found%force)) values = reshape(found%force, [size(found%force)])
         end associate
      case ('user/work')
         if (.not. allocated(point%work_of)) return
         k = element_kind('user')
         if (allocated(point%work_of(k)%values)) values = point%work_of(k)%values
      case ('history/observed')
         call by_rows(point%history, values)
      case ('history/force')
         if (allocated(point%force_history)) then
            values = reshape(point%force_history, [size(point%force_history)])
         end if
      case ('history/relative_displacement')
         if (allocated(point%slip_history)) then
            values = reshape(point%slip_history, [size(point%slip_history)])
         end if
      case ('mode/damping_ratio')
         if (allocated(point%first_harmonic)) values = [0.5_wp*point%self_excitation/point%omega]
      case ('mode/self_excitation')
         if (allocated(point%first_harmonic)) values = [point%self_excitation]
      case ('mode/modal_amplitude')
         if (allocated(point%first_harmonic)) values = [point%modal_amplitude]
      case ('mode/first_harmonic')
         if (allocated(point%first_harmonic)) values = point%first_harmonic
      case ('wear/flight')
         if (allocated(point%depth)) values = [real(point%flight, wp)]
      case ('wear/block')
         if (allocated(point%depth)) values = [real(point%block, wp)]
      case ('wear/cycles')
         if (allocated(point%depth)) values = [point%cycles]
      case ('wear/depth')
         if (allocated(point%depth)) values = point%depth
      case ('wear/rate')
         if (allocated(point%wear_rate)) values = point%wear_rate
      case ('wear/mu')
         if (allocated(point%worn_mu)) values = point%worn_mu
      case ('wear/energy')
         if (allocated(point%wear_energy)) values = point%wear_energy
      case ('wear/volume')
         if (allocated(point%wear_volume)) values = point%wear_volume
      case ('stress/amplitude')
         if (allocated(point%stress)) values = point%stress%amplitude
      case ('stress/mean')
         if (allocated(point%stress)) values = point%stress%mean
      case ('stress/utilisation')
         if (allocated(point%stress)) values = point%stress%utilisation
      case ('stress/worst')
         if (allocated(point%stress)) values = [real(point%stress%worst, wp)]
      case ('stress/coefficients')
         if (allocated(point%stress)) call by_rows(point%stress%coefficients, values)
      case default ! derivatives, which find_sensitivity knows
      end select
   end subroutine values_of

   !> The elements of a matrix with the second index running fastest; nothing of none.
   pure subroutine by_rows(array, values)
      real(wp), allocatable, intent(in) :: array(:, :)
      real(wp), allocatable, intent(out) :: values(:)

      if (allocated(array)) values = reshape(transpose(array), [size(array)])
   end subroutine by_rows

   !> Truth as a number: rows are reals until they are written.
   pure real(wp) function flag(is_true)
      logical, intent(in) :: is_true

      flag = merge(1.0_wp, 0.0_wp, is_true)
   end function flag

   !> The block of a quantity and a parameter, where the point has it.
   pure subroutine find_sensitivity(point, place, values)
      type(point_type), intent(in) :: point
      integer, intent(in) :: place(2)
      real(wp), allocatable, intent(out) :: values(:)
      integer :: k

      if (.not. allocated(point%sensitivity)) return
      do k = 1, size(point%sensitivity)
         if (point%sensitivity(k)%quantity /= place(1)) cycle
         if (point%sensitivity(k)%parameter == place(2)) values = point%sensitivity(k)%values
      end do
   end subroutine find_sensitivity

end module fw_point_quantities
