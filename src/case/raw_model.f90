!> What a model consists of before anything is put together, whatever its source, and the table of
!> its parts: a row each, bound to the component that holds it.
module fw_raw_model
   use fw_base_motion, only: base_motion
   use fw_contact_data, only: contact_type, spring_type
   use fw_cyclic_parts, only: cyclic_parts
   use fw_elements, only: element_list
   use fw_kinds, only: wp
   use fw_law_text, only: all_laws
   use fw_laws, only: law_words
   use fw_loose_bodies, only: loose_bodies
   use fw_mistuning_parts, only: mistuning_parts
   use fw_speed_growth, only: speed_growth
   use fw_speed_parts, only: speed_parts
   use fw_stress_parts, only: stress_parts
   use fw_normal_law, only: normal_words
   use fw_part_keys, only: part_keys
   use fw_side, only: add_side
   use fw_part, only: by_columns, either_way, part, part_source, part_type
   use fw_text, only: string_type, to_text
   implicit none (type, external)
   private

   public :: raw_model

   !> A component is not allocated where the model has none.
   type :: raw_model
      character(:), allocatable :: title, unit_system
      !> Paths of the files it was read from.
      type(string_type), allocatable :: files(:)
      !> What stands in the file and nothing reads.
      type(string_type), allocatable :: unread(:)
      !> Structure (n_dof, n_dof), not checked for symmetry.
      real(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      !> Stiffness per square of the rotation speed (n_dof, n_dof) [force/length/(rad/s)**2].
      real(wp), allocatable :: stiffness_rotation(:, :)
      !> Contact pairs, with what the model says of them: dofs are not checked for their range,
      !> `constants` offers those of laws.
      type(contact_type) :: contact
      !> Nonlinear springs, with what the model says of them.
      type(spring_type) :: springs
      !> Other elements, likewise.
      type(element_list) :: elements
      !> Loads (n_dof) [force]; the last per square of the rotation speed.
      real(wp), allocatable :: load_static(:), load_cosine(:), load_sine(:)
      real(wp), allocatable :: load_static_rotation(:)
      !> Displacements that are combinations of dofs (n_dof, n_rows).
      real(wp), allocatable :: rows(:, :)
      !> Observed quantities: rows of linear combinations of the dofs (n_observed, n_dof).
      type(string_type), allocatable :: observe_name(:)
      real(wp), allocatable :: observe_matrix(:, :)
      !> What makes the model a sector of a cyclic structure.
      type(cyclic_parts) :: cyclic
      !> Harmonics that loads act in (m), and their cosine and sine parts (n_dof, m) [force].
      integer, allocatable :: load_harmonic(:)
      real(wp), allocatable :: harmonic_cosine(:, :), harmonic_sine(:, :)
      !> Frequencies [rad/s], and what multiplies all vibratory loads there (n_table).
      real(wp), allocatable :: table_frequency(:), table_scale(:)
      !> Up to which frequency the model was reduced [Hz], and the estimated error there; one number
      !> each.
      real(wp), allocatable :: reduction_frequency(:), reduction_error(:)
      !> Coriolis matrix per rotation speed, skew (n_dof, n_dof) [force/length/(rad/s)^2].
      real(wp), allocatable :: coriolis(:, :)
      !> Matrices at several speeds in place of those, and what grows with the speed by either
      !> (`find_growth`).
      type(speed_parts) :: speeds
      type(speed_growth) :: growth
      type(stress_parts) :: stress
      !> How sectors differ from the tuned one.
      type(mistuning_parts), allocatable :: mistuning
      !> Bodies that no spring holds.
      type(loose_bodies), allocatable :: bodies
      !> Hysteretic damping, symmetric (n_dof, n_dof) [force/length].
      real(wp), allocatable :: structural_damping(:, :)
      !> Of any shape (n_dof, n_dof): stiffness per rotation speed, stiffness and damping.
      real(wp), allocatable :: circulatory(:, :), stiffness_unsymmetric(:, :), &
         damping_unsymmetric(:, :)
      !> Motion of the supports or of the ground: of the model which, of the case how.
      type(base_motion) :: base
   contains
      procedure :: order
      procedure :: bind_parts
      procedure :: find_growth
   end type raw_model

   character(*), parameter :: always = 'required', with_pairs = 'with /contact', &
      with_springs = 'with /spring', with_mesh = 'with /mesh', without_speeds = 'without /speed'

contains

   !> Number of dofs: of matrices of nodal diameters, the displacements in front.
   pure integer function order(self)
      class(raw_model), intent(in) :: self

      order = self%cyclic%n_physical
      if (allocated(self%stiffness)) order = size(self%stiffness, 1)
   end function order

   !> All parts, in the order of the documents: the first that has an extent gives it to those that
   !> follow, the mass n_dof, side 1 of the pairs n_pairs.
   subroutine bind_parts(self, to)
      class(raw_model), intent(inout) :: self
      class(part_source), intent(inout) :: to

      call bind_structure(self, to)
      call self%speeds%bind_parts(to)
      call to%bind(part('row/matrix', 'combination dof', 'displacements that are combinations '// &
                        'of dofs, which sides may name by n_dof + 1, ..', storage=by_columns), &
                   self%rows)
      call bind_pairs(self%contact, to)
      call bind_springs(self%springs, to)
      call bind_elements(self%elements, to)
      call bind_loads(self, to)
      call bind_base(self, to)
      call bind_observed(self, to)
      call self%cyclic%bind_parts(to)
      if (.not. allocated(self%mistuning)) allocate (self%mistuning)
      call self%mistuning%bind_parts(self%cyclic%n_sectors, to)
      if (.not. allocated(self%bodies)) allocate (self%bodies)
      call self%bodies%bind_parts(to)
      call self%stress%bind_parts(to)
      call note_mesh(to)
   end subroutine bind_parts

   !> What grows with the rotation speed, from matrices per square of it or from those at several
   !> speeds; a message where these do not fit. Once, when all parts are there.
   subroutine find_growth(self, message)
      class(raw_model), intent(inout) :: self
      character(:), allocatable, intent(out) :: message

      ! Either says all that grows: a power by both would be counted twice.
      if (allocated(self%speeds%value) .or. allocated(self%speeds%at)) then
         if (allocated(self%stiffness_rotation) .or. allocated(self%load_static_rotation)) then
            message = 'speed/value beside stiffness_rotation or load/static_rotation: must be '// &
                      'one of both'
         else if (allocated(self%cyclic%nodal)) then
            message = 'speed/value beside matrices of nodal diameters: give these at one speed'
         else
            call self%speeds%interpolate(self%stiffness, self%growth, message)
         end if
         return
      end if
      ! Nodal diameters have matrices per square of the speed of their own.
      if (allocated(self%cyclic%nodal)) return
      if (allocated(self%stiffness_rotation)) then
         self%growth%stiffness = reshape(self%stiffness_rotation, &
                                         [shape(self%stiffness_rotation), 1])
         deallocate (self%stiffness_rotation)
      end if
      if (allocated(self%load_static_rotation)) then
         self%growth%load = reshape(self%load_static_rotation, &
                                    [size(self%load_static_rotation), 1])
      end if
   end subroutine find_growth

   !> Format, title and units, then the matrices.
   subroutine bind_structure(self, to)
      class(raw_model), intent(inout) :: self
      class(part_source), intent(inout) :: to

      call to%note('text', part('@format', '', '"fretwear-model"', always))
      call to%note('integer', part('@format_version', '', '1', always))
      call to%bind(part('@title', '', 'of the result, where the case has none'), self%title)
      call to%bind(part('@unit_system', '', 'such as mm-tonne-s-N: units of the result and of '// &
                        'values with units'), self%unit_system)
      call to%note('text', part('@parameters', '', 'what python -m fretwear.sector made it from'))
      call to%note('text', part('@disk_parameters', '', 'what python -m fretwear.disk made '// &
                                'it from'))
      call to%bind(part('mass', 'dof dof', 'symmetric', always, either_way), self%mass)
      call to%bind(part('stiffness', 'dof dof', 'symmetric', without_speeds, either_way), &
                   self%stiffness)
      call to%bind(part('damping', 'dof dof', 'viscous, symmetric', storage=either_way), &
                   self%damping)
      call to%bind(part('stiffness_rotation', 'dof dof', 'added to the stiffness for each '// &
                        '(rad/s)^2 of model%rotation_speed', storage=either_way), &
                   self%stiffness_rotation)
      call to%bind(part('coriolis', 'dof dof', 'skew: force of velocities for each rad/s of '// &
                        'model%rotation_speed'), self%coriolis)
      call to%bind(part('structural_damping', 'dof dof', 'hysteretic, symmetric: i times it in '// &
                        'harmonics above 0', storage=either_way), self%structural_damping)
      call to%bind(part('circulatory', 'dof dof', 'any: stiffness for each rad/s of '// &
                        'model%rotation_speed; row i is the force on dof i'), self%circulatory)
      call to%bind(part('stiffness_unsymmetric', 'dof dof', 'any: added to the stiffness'), &
                   self%stiffness_unsymmetric)
      call to%bind(part('damping_unsymmetric', 'dof dof', 'any: added to the damping'), &
                   self%damping_unsymmetric)
      call to%bind(part('reduction/frequency', '1', 'up to which the model was reduced to an '// &
                        'accuracy [Hz]'), self%reduction_frequency)
      call to%bind(part('reduction/error', '1', 'estimated error of the stiffness of the joint '// &
                        'there, relative'), self%reduction_error)
   end subroutine bind_structure

   !> Contact pairs and the constants of all laws.
   subroutine bind_pairs(pairs, to)
      type(contact_type), intent(inout) :: pairs
      class(part_source), intent(inout) :: to
      character(*), parameter :: each = 'one_or pair'
      real(wp), allocatable :: values(:)
      type(string_type), allocatable :: words(:)
      type(part_type) :: laws
      integer :: k

      call to%bind(part('contact/side_1', 'pair 3', 'dof numbers of t1, t2, n, from 1: '// &
                        'negative with the sign turned, 0 for none', with_pairs), pairs%side_1)
      call to%bind(part('contact/side_2', 'pair 3', 'of the other side, 0: ground', with_pairs), &
                   pairs%side_2)
      call to%bind(part('contact/sector_2', 'pair', 'sector of side 2, counted from that of '// &
                        'side 1'), pairs%sector_2)
      call to%bind(part('contact/mu', each, 'friction coefficient'), pairs%mu)
      call to%bind(part('contact/gap', each, 'initial gap; negative: interference'), pairs%gap)
      call to%bind(part('contact/gap_harmonic', 'gap', 'harmonics 0, 1, .. that an obstacle '// &
                        'adds to the gaps'), pairs%gap_harmonic)
      call to%bind(part('contact/gap_cosine', 'gap pair', 'their cosine parts, which open', &
                        storage=by_columns), pairs%gap_cosine)
      call to%bind(part('contact/gap_sine', 'gap pair', 'their sine parts', storage=by_columns), &
                   pairs%gap_sine)
      call to%bind(part('contact/area', each, 'of a pair'), pairs%area)
      call to%bind(part('contact/slider_1', each, 'displacement along t1 where an assembled '// &
                        'pair is unstrained'), pairs%slider_1)
      call to%bind(part('contact/slider_2', each, 'the same along t2'), pairs%slider_2)
      call to%bind(part('contact/residual', each, 'residual traction of pairs that never slip, '// &
                        '-1 to 1'), pairs%residual)
      call to%bind(part('contact/normal_load', each, 'constant compressive force of pairs '// &
                        'without a normal dof'), pairs%normal_load)
      call to%bind(part('contact/gap_rotation', each, 'added to the gap, for each square of '// &
                        'the rotation speed'), pairs%gap_rotation)
      call to%bind(part('contact/normal_load_rotation', each, 'added to normal_load, for each '// &
                        'square of the rotation speed'), pairs%normal_load_rotation)
      do k = 1, size(to%constants)
         associate (key => to%constants(k))
            if (allocated(values)) deallocate (values)
            call to%bind(part('contact/'//key%name, each, trim(key%help)//'; '//key%only), values)
            if (allocated(values)) call pairs%constants%offer(trim(key%name), values)
         end associate
      end do
      call to%note('text', part('contact@law', '', 'the law where the case names none'))
      laws = part('contact/law', 'pair', 'in its place the law of each pair')
      call to%bind(laws, words)
      if (allocated(words)) call take_laws(laws, words, to, pairs)
      call to%note('text', part('contact@sliding', '', 'how friction follows speed_1, speed_2'))
      call bind_normal_laws(pairs, to)
      call to%bind(part('contact/position', 'pair 3', 'coordinates, for pictures', &
                        storage=by_columns), pairs%position)
      call to%bind(part('contact/patch', 'pair', 'name of the surface of each pair'), pairs%patch)
   end subroutine bind_pairs

   !> The law of each pair by its word.
   subroutine take_laws(laws, words, to, pairs)
      type(part_type), intent(in) :: laws
      type(string_type), intent(in) :: words(:)
      class(part_source), intent(inout) :: to
      type(contact_type), intent(inout) :: pairs
      integer :: numbers(size(words))
      integer :: i

      do i = 1, size(words)
         numbers(i) = findloc(law_words == words(i)%text, .true., dim=1)
         if (numbers(i) > 0) cycle
         call to%refuse(laws, '"'//words(i)%text//'"', trim(all_laws()))
         return
      end do
      if (size(words) == 0) return
      pairs%law = numbers(1)
      pairs%law_is_of_model = .true.
      if (any(numbers /= numbers(1))) pairs%law_of = numbers
   end subroutine take_laws

   !> How pairs press, and the table of those that have one.
   subroutine bind_normal_laws(pairs, to)
      type(contact_type), intent(inout) :: pairs
      class(part_source), intent(inout) :: to
      real(wp), allocatable :: table(:, :)
      type(string_type), allocatable :: words(:)
      type(part_type) :: laws
      integer :: i

      call to%note('text', part('contact@normal_law', '', 'the normal law of all pairs'))
      laws = part('contact/normal_law', 'pair', 'in its place that of each pair')
      call to%bind(laws, words)
      if (allocated(words)) then
         allocate (pairs%normal_law(size(words)), source=0)
         do i = 1, size(words)
            pairs%normal_law(i) = findloc(normal_words == words(i)%text, .true., dim=1)
            if (pairs%normal_law(i) > 0) cycle
            call to%refuse(laws, '"'//words(i)%text//'"', "'unilateral', 'power', "// &
                           "'exponential', 'table'")
            return
         end do
      end if
      call to%bind(part('contact/table', 'row 2', "overclosure and force of normal_law = "// &
                        "'table'"), table)
      if (.not. allocated(table)) return
      pairs%n_table = size(table, 1)
      pairs%overclosure = table(:, 1)
      pairs%table_force = table(:, 2)
   end subroutine bind_normal_laws

   !> Nonlinear springs.
   subroutine bind_springs(springs, to)
      type(spring_type), intent(inout) :: springs
      class(part_source), intent(inout) :: to
      character(*), parameter :: each = 'one_or spring'

      call to%bind(part('spring/side_1', 'spring', 'dof number from 1, signed', with_springs), &
                   springs%side_1)
      call to%bind(part('spring/side_2', each, '0, the ground, without it'), springs%side_2)
      call to%bind(part('spring/sector_2', each, 'sector of side 2, counted from that of side '// &
                        '1; 0 without it'), springs%sector_2)
      call to%bind(part('spring/coefficient', each, 'force = coefficient * elongation**power', &
                        with_springs), springs%coefficient)
      call to%bind(part('spring/power', each, '3 without it'), springs%power)
   end subroutine bind_springs

   !> The arrays of a group are the parts of its keys.
   subroutine bind_elements(elements, to)
      type(element_list), intent(inout) :: elements
      class(part_source), intent(inout), target :: to
      type(part_keys) :: keys
      integer :: k

      if (.not. allocated(elements%slot)) call elements%start()
      keys%to => to
      do k = 1, size(elements%slot)
         if (.not. elements%slot(k)%group%is_in_models()) cycle
         call keys%open(elements%slot(k)%group%name(), '')
         call elements%slot(k)%group%bind_keys(keys)
      end do
   end subroutine bind_elements

   !> Static and vibratory loads, and tables of them.
   subroutine bind_loads(self, to)
      class(raw_model), intent(inout) :: self
      class(part_source), intent(inout) :: to
      integer, allocatable :: found(:)
      real(wp), allocatable :: table(:, :)
      type(part_type) :: harmonics

      call to%bind(part('load/table', 'table 2', 'frequency [rad/s], and what multiplies all '// &
                        'vibratory loads there', storage=by_columns), table)
      if (allocated(table)) then
         self%table_frequency = table(1, :)
         self%table_scale = table(2, :)
      end if
      call to%bind(part('load/static', 'dof', 'constant load'), self%load_static)
      call to%bind(part('load/cosine', 'dof', 'in phase with cos(omega t)'), self%load_cosine)
      call to%bind(part('load/sine', 'dof', 'in phase with sin(omega t)'), self%load_sine)
      call to%bind(part('load/static_rotation', 'dof', 'constant load for each (rad/s)^2 of '// &
                        'model%rotation_speed'), self%load_static_rotation)
      harmonics = part('load/harmonic', 'load', 'harmonics 0, 1, .. of further loads')
      call to%bind(harmonics, found)
      if (allocated(found)) then
         if (any(found < 0)) then
            call to%refuse(harmonics, to_text(minval(found)), '0, 1, ..')
         else
            call move_alloc(found, self%load_harmonic)
         end if
      end if
      ! Loads of no harmonics have no rows.
      if (to%extent_of('load') == 0) return
      call to%bind(part('load/harmonic_cosine', 'load dof', 'their cosine parts', &
                        storage=by_columns), self%harmonic_cosine)
      call to%bind(part('load/harmonic_sine', 'load dof', 'their sine parts', &
                        storage=by_columns), self%harmonic_sine)
   end subroutine bind_loads

   !> Names and rows of observed quantities.
   subroutine bind_observed(self, to)
      class(raw_model), intent(inout) :: self
      class(part_source), intent(inout) :: to
      integer, allocatable :: dof(:)
      type(part_type) :: dofs
      integer :: i, n, n_rows

      call to%bind(part('observe/name', 'quantity', 'names, with one of the two that follow', &
                        'with /observe'), self%observe_name)
      dofs = part('observe/dof', 'quantity', 'signed numbers of dofs, or n_dof and a row')
      call to%bind(dofs, dof)
      call to%bind(part('observe/matrix', 'quantity dof', 'a linear combination of dofs each'), &
                   self%observe_matrix)
      if (.not. allocated(dof) .or. allocated(self%observe_matrix)) return
      n = self%order()
      n_rows = 0
      if (allocated(self%rows)) n_rows = size(self%rows, 2)
      allocate (self%observe_matrix(size(dof), n), source=0.0_wp)
      do i = 1, size(dof)
         if (dof(i) == 0 .or. abs(dof(i)) > n + n_rows) then
            call to%refuse(dofs, to_text(dof(i))//' at index '//to_text(i - 1), &
                           '1 to '//to_text(n + n_rows)//' or its negative')
            return
         end if
         ! A negative number observes the dof with its sign turned.
         call add_side(dof(i), 1.0_wp, self%observe_matrix(i, :), self%rows)
      end do
   end subroutine bind_observed

   !> What group &base moves.
   subroutine bind_base(self, to)
      class(raw_model), intent(inout) :: self
      class(part_source), intent(inout) :: to

      call to%bind(part('base/dof', 'support', 'supports that &base moves, signed dof numbers'), &
                   self%base%dof)
      call to%bind(part('base/direction', 'dof', 'in their place motion of all dofs with the '// &
                        'ground'), self%base%direction)
   end subroutine bind_base

   !> What pictures are made of.
   subroutine note_mesh(to)
      class(part_source), intent(inout) :: to

      call to%note('real', part('mesh/points', 'point 3', 'positions, for fretwear export', &
                                with_mesh))
      call to%note('integer', part('mesh/cells', 'cell 8', 'corners of the cells: points from '// &
                                   '0 in the order of VTK, -1 behind the last one', with_mesh))
      call to%note('integer', part('mesh/body', 'cell', 'body of each cell', with_mesh))
      call to%note('integer', part('mesh/kind', 'cell', 'type of each cell by its number in '// &
                                   'VTK: 5, 9, 10, 12, 13, 14; hexahedra (12) without it'))
      call to%note('integer', part('mesh/facets', 'facet 4', 'facets in contact, points in '// &
                                   'cyclic order', with_mesh))
      call to%note('integer', part('mesh/pair', 'facet', 'pair of each facet, from 0', with_mesh))
      call to%note('real', part('mesh/basis', '3_point dof', 'displacement x, y, z of point 0, '// &
                                'then 1, .. per unit of each dof', with_mesh))
   end subroutine note_mesh

end module fw_raw_model
