!> The parts of a model file: a row each, with what it is, its shape and its meaning. What reads,
!> refuses and lists parts goes by this table; the constants of contact laws are those that the laws
!> declare in their `bind_keys`.
module fw_parts
   use fw_contact_data, only: contact_type
   use fw_contact_keys, only: ask_laws
   use fw_key, only: key_type
   use fw_reader, only: reader_type
   implicit none (type, external)
   private

   public :: part_type, is_of_kind, law_constant_names, model_parts, names_to_put, part_to_put, &
             put_name, write_parts

   type :: part_type
      !> Path from the root. K stands for a nodal diameter, M for the number of a sector or of a
      !> signed nodal diameter; what follows a @ is an attribute of the group before it.
      character(40) :: name
      !> Of the numbers: complex ones have real and imaginary part in one more dimension.
      character(7) :: kind
      !> Extents as h5py shows them, in words; `one_or` before them: a scalar holds for all.
      character(20) :: shape
      !> Blank: may be absent.
      character(32) :: needed
      character(150) :: meaning
   end type part_type

   character(*), parameter :: with_pairs = 'with /contact', with_springs = 'with /spring', &
      with_mesh = 'with /mesh'

   type(part_type), parameter :: of_structure(*) = [ &
      part_type('@format', 'text', '', 'required', '"fretwear-model"'), &
      part_type('@format_version', 'integer', '', 'required', '1'), &
      part_type('@title', 'text', '', '', 'of the result, where the case has none'), &
      part_type('@unit_system', 'text', '', '', &
                'such as mm-tonne-s-N: units of the result and of values with units'), &
      part_type('@parameters', 'text', '', '', 'what python -m fretwear.sector made it from'), &
      part_type('@disk_parameters', 'text', '', '', 'what python -m fretwear.disk made it from'), &
      part_type('mass', 'real', 'dof dof', 'required', 'symmetric'), &
      part_type('stiffness', 'real', 'dof dof', 'required', 'symmetric'), &
      part_type('damping', 'real', 'dof dof', '', 'viscous, symmetric'), &
      part_type('stiffness_rotation', 'real', 'dof dof', '', &
                'added to the stiffness for each (rad/s)^2 of model%rotation_speed'), &
      part_type('coriolis', 'real', 'dof dof', '', &
                'skew: force of velocities for each rad/s of model%rotation_speed')]

   type(part_type), parameter :: of_pairs(*) = [ &
      part_type('contact/side_1', 'integer', 'pair 3', with_pairs, &
                'dof numbers of t1, t2, n, from 1: negative with the sign turned, 0 for none'), &
      part_type('contact/side_2', 'integer', 'pair 3', with_pairs, &
                'of the other side, 0: ground'), &
      part_type('contact/sector_2', 'integer', 'pair', '', &
                'sector of side 2, counted from that of side 1'), &
      part_type('contact/mu', 'real', 'one_or pair', '', 'friction coefficient'), &
      part_type('contact/gap', 'real', 'one_or pair', '', 'initial gap; negative: interference'), &
      part_type('contact/area', 'real', 'one_or pair', '', 'of a pair'), &
      part_type('contact/normal_load', 'real', 'one_or pair', '', &
                'constant compressive force of pairs without a normal dof')]

   type(part_type), parameter :: beside_pairs(*) = [ &
      part_type('contact@law', 'text', '', '', 'the law where the case names none'), &
      part_type('contact/position', 'real', 'pair 3', '', 'coordinates, for pictures'), &
      part_type('contact/patch', 'text', 'pair', '', 'name of the surface of each pair')]

   type(part_type), parameter :: of_springs(*) = [ &
      part_type('spring/side_1', 'integer', 'spring', with_springs, 'dof number from 1, signed'), &
      part_type('spring/side_2', 'integer', 'one_or spring', '', '0, the ground, without it'), &
      part_type('spring/sector_2', 'integer', 'one_or spring', '', &
                'sector of side 2, counted from that of side 1; 0 without it'), &
      part_type('spring/coefficient', 'real', 'one_or spring', with_springs, &
                'force = coefficient * elongation**power'), &
      part_type('spring/power', 'integer', 'one_or spring', '', '3 without it')]

   type(part_type), parameter :: of_loads(*) = [ &
      part_type('load/static', 'real', 'dof', '', 'constant load'), &
      part_type('load/cosine', 'real', 'dof', '', 'in phase with cos(omega t)'), &
      part_type('load/sine', 'real', 'dof', '', 'in phase with sin(omega t)'), &
      part_type('load/static_rotation', 'real', 'dof', '', &
                'constant load for each (rad/s)^2 of model%rotation_speed'), &
      part_type('load/harmonic', 'integer', 'load', '', 'harmonics 0, 1, .. of further loads'), &
      part_type('load/harmonic_cosine', 'real', 'load dof', '', 'their cosine parts'), &
      part_type('load/harmonic_sine', 'real', 'load dof', '', 'their sine parts'), &
      part_type('observe/name', 'text', 'quantity', 'with /observe', &
                'names, with one of the two that follow'), &
      part_type('observe/dof', 'integer', 'quantity', '', 'signed dof numbers'), &
      part_type('observe/matrix', 'real', 'quantity dof', '', 'a linear combination of dofs each')]

   type(part_type), parameter :: of_sectors(*) = [ &
      part_type('cyclic@n_sectors', 'integer', '', 'with /cyclic', 'makes the model a sector'), &
      part_type('cyclic@n_physical', 'integer', '', 'with /nodal_diameter', &
                'displacements in front of the coordinates of every nodal diameter, which take '// &
                'the place of matrices and interfaces of a sector'), &
      part_type('cyclic@phase', 'text', '', '', '"delay" (without it): matrices of nodal '// &
                'diameters are of u_right = exp(-2 pi i K/N) u_left; "advance": of the other '// &
                'sign'), &
      part_type('cyclic/left', 'integer', 'interface', '', 'dofs from 1 of one interface'), &
      part_type('cyclic/right', 'integer', 'interface', '', &
                'of the other, which moves as the left one of the next sector; negative: with '// &
                'the sign turned')]

   type(part_type), parameter :: of_diameters(*) = [ &
      part_type('nodal_diameter/K/mass', 'complex', 'order order', 'with its group', &
                'Hermitian; K = 0, 1, .. N/2 as far as harmonics need them, rigid laws take '// &
                'the mean of all that are there'), &
      part_type('nodal_diameter/K/stiffness', 'complex', 'order order', 'with its group', &
                'Hermitian'), &
      part_type('nodal_diameter/K/damping', 'complex', 'order order', '', 'Hermitian'), &
      part_type('nodal_diameter/K/stiffness_rotation', 'complex', 'order order', '', &
                'Hermitian'), &
      part_type('nodal_diameter/K/coriolis', 'complex', 'order order', '', &
                'skew-Hermitian, for each rad/s'), &
      part_type('nodal_diameter/K/load/static', 'complex', 'order', '', &
                'reduced load of sector 0; without it that of /load, on the displacements'), &
      part_type('nodal_diameter/K/load/cosine', 'complex', 'order', '', 'likewise'), &
      part_type('nodal_diameter/K/load/sine', 'complex', 'order', '', 'likewise'), &
      part_type('nodal_diameter/K/load/static_rotation', 'complex', 'order', '', 'likewise'), &
      part_type('nodal_diameter/K/observe/matrix', 'complex', 'quantity order', '', &
                'rows of the quantities of /observe/name'), &
      part_type('aero/sector/M', 'complex', 'motion motion', '', &
                'forces of the air by the motion of sector M, counted from the one that feels '// &
                'them'), &
      part_type('aero/nodal_diameter/M', 'complex', 'motion motion', '', &
                'in place of these: by signed nodal diameters'), &
      part_type('aero/modes', 'real', 'motion dof', '', &
                'rows of motion that they are of; without them every dof')]

   type(part_type), parameter :: of_mesh(*) = [ &
      part_type('mesh/points', 'real', 'point 3', with_mesh, 'positions, for fretwear export'), &
      part_type('mesh/cells', 'integer', 'cell 8', with_mesh, 'corners of the cells: points '// &
                'from 0 in the order of VTK, -1 behind the last one'), &
      part_type('mesh/body', 'integer', 'cell', with_mesh, 'body of each cell'), &
      part_type('mesh/kind', 'integer', 'cell', '', 'type of each cell by its number in VTK: '// &
                '5, 9, 10, 12, 13, 14; hexahedra (12) without it'), &
      part_type('mesh/facets', 'integer', 'facet 4', with_mesh, &
                'facets in contact, points in cyclic order'), &
      part_type('mesh/pair', 'integer', 'facet', with_mesh, 'pair of each facet, from 0'), &
      part_type('mesh/basis', 'real', '3_point dof', with_mesh, &
                'displacement x, y, z of point 0, then 1, .. per unit of each dof')]

contains

   !> All parts, in the order of the documents.
   function model_parts() result(parts)
      type(part_type), allocatable :: parts(:)

      parts = [of_structure, of_pairs, of_laws(), beside_pairs, of_springs, of_loads, of_sectors, &
               of_diameters, of_mesh]
   end function model_parts

   !> The name by which a calling program gives a part; empty of those that only files have.
   pure function put_name(name) result(text)
      !> Of a row of the table.
      character(*), intent(in) :: name
      character(:), allocatable :: text
      character(*), parameter :: of_files(*) = [character(17) :: '@format', '@format_version', &
         '@parameters', '@disk_parameters', 'contact@law', 'observe/name', 'observe/dof', &
         'observe/matrix', 'cyclic@n_physical', 'cyclic@phase']
      integer :: at

      text = ''
      if (any(of_files == name) .or. index(name, 'mesh/') == 1) return
      text = trim(name)
      at = index(name, '@')
      if (at == 1) text = trim(name(2:))
      if (at > 1) text(at:at) = '/'
   end function put_name

   !> The part that a calling program names; a blank one where there is none of that name.
   function part_to_put(name) result(part)
      character(*), intent(in) :: name
      type(part_type) :: part
      character(*), parameter :: numbered(*) = [character(20) :: 'nodal_diameter/', &
         'aero/sector/', 'aero/nodal_diameter/']
      type(part_type), allocatable :: parts(:)
      character(:), allocatable :: pattern
      integer :: i, n

      pattern = name
      do i = 1, size(numbered)
         n = len_trim(numbered(i))
         if (index(name, numbered(i)(:n)) /= 1) cycle
         pattern = name(:n)//merge('K', 'M', i == 1)// &
                   name(n + index(name(n + 1:)//'/', '/'):)
      end do
      part = part_type('', '', '', '', '')
      parts = model_parts()
      do i = 1, size(parts)
         if (put_name(parts(i)%name) == pattern .and. len(pattern) > 0) part = parts(i)
      end do
   end function part_to_put

   !> Whether a part is given as numbers of a kind: complex ones as pairs of reals.
   pure logical function is_of_kind(part, kind)
      type(part_type), intent(in) :: part
      character(*), intent(in) :: kind

      is_of_kind = part%kind == kind .or. (kind == 'real' .and. part%kind == 'complex')
   end function is_of_kind

   !> Names of the parts of a kind that calling programs give: `a, b, c`.
   function names_to_put(kind) result(text)
      !> Such as real.
      character(*), intent(in) :: kind
      character(:), allocatable :: text
      type(part_type), allocatable :: parts(:)
      integer :: i

      parts = model_parts()
      text = ''
      do i = 1, size(parts)
         if (len(put_name(parts(i)%name)) == 0) cycle
         if (.not. is_of_kind(parts(i), kind)) cycle
         if (len(text) > 0) text = text//', '
         text = text//put_name(parts(i)%name)
      end do
   end function names_to_put

   !> Keys of the constants of pairs that laws declare.
   function keys_of_laws() result(keys)
      type(key_type), allocatable :: keys(:)
      type(contact_type) :: contact
      type(reader_type) :: nobody

      call ask_laws(nobody, contact)
      call move_alloc(contact%constants%named, keys)
   end function keys_of_laws

   !> Their names.
   function law_constant_names() result(names)
      character(24), allocatable :: names(:)
      type(key_type), allocatable :: keys(:)

      keys = keys_of_laws()
      names = keys%name
   end function law_constant_names

   !> Constants of pairs that laws declare.
   function of_laws() result(parts)
      type(part_type), allocatable :: parts(:)
      type(key_type), allocatable :: keys(:)
      integer :: k

      keys = keys_of_laws()
      allocate (parts(size(keys)))
      do k = 1, size(keys)
         parts(k) = part_type('contact/'//keys(k)%name, 'real', 'one_or pair', '', &
                              trim(keys(k)%help)//'; '//trim(keys(k)%only))
      end do
   end function of_laws

   !> The table as Markdown.
   subroutine write_parts(unit)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      type(part_type), allocatable :: parts(:)
      integer :: i

      parts = model_parts()
      write (unit, '(a)') '| name | kind | shape | required | meaning |', '|---|---|---|---|---|'
      do i = 1, size(parts)
         write (unit, '(11a)') '| ', shown_name(parts(i)%name), ' | ', trim(parts(i)%kind), ' | ', &
            shown_shape(parts(i)), ' | ', trim(parts(i)%needed), ' | ', trim(parts(i)%meaning), &
            ' |'
      end do
   end subroutine write_parts

   !> `/contact/mu`, `/contact` attribute `law`.
   pure function shown_name(name) result(text)
      character(*), intent(in) :: name
      character(:), allocatable :: text
      integer :: at

      at = index(name, '@')
      text = '`/'//trim(name)//'`'
      if (at > 0) text = '`/'//name(:at - 1)//'` attribute `'//trim(name(at + 1:))//'`'
   end function shown_name

   !> `(pair, 3)`, `(pair) or scalar`; nothing of attributes.
   pure function shown_shape(part) result(text)
      type(part_type), intent(in) :: part
      character(:), allocatable :: text
      character(*), parameter :: scalar = 'one_or '
      character(:), allocatable :: words
      integer :: i

      text = ''
      if (part%shape == '') return
      words = trim(part%shape)
      if (index(words, scalar) == 1) words = words(len(scalar) + 1:)
      if (part%kind == 'complex') words = words//' 2'
      do i = 1, len(words)
         if (words(i:i) == ' ') then
            text = text//', '
         else
            text = text//merge(' ', words(i:i), words(i:i) == '_')
         end if
      end do
      text = '('//text//')'
      if (index(part%shape, scalar) == 1) text = text//' or scalar'
   end function shown_shape

end module fw_parts
