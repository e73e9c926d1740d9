!> The linear structure of a case whose model holds complex matrices of every nodal diameter:
!> checks, rotation, damping, loads and observed quantities of each.
module fw_read_nodal
   use fw_cyclic_data, only: nodal_matrices
   use fw_cyclic_parts, only: nodal_parts
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_raw_model, only: raw_model
   use fw_model_keys, only: model_options
   use fw_reader, only: reader_type
   use fw_sector, only: damp_modes
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: find_nodal_stress, finish_nodal, observe_nodal

   !> Entries of a Hermitian matrix may differ by this share of the largest one, and as much may be
   !> left of imaginary parts where they must vanish.
   real(wp), parameter :: tolerance = 1.0e-10_wp

contains

   !> Check the parts of every nodal diameter and put them together.
   subroutine finish_nodal(reader, options, raw, static, model, error)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(inout) :: raw
      !> Static loads beside those of the file (n_physical).
      real(wp), intent(in) :: static(:)
      type(model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      integer :: k, n

      if (reader%failed()) return
      n = raw%cyclic%n_physical
      model%n_dof = n
      allocate (model%cyclic%nodal(size(raw%cyclic%nodal)))
      do k = 0, size(raw%cyclic%nodal) - 1
         associate (parts => raw%cyclic%nodal(k + 1))
            if (.not. allocated(parts%mass)) cycle
            call check_diameter(reader, parts, k, raw%cyclic%n_sectors)
            if (reader%failed()) return
            call put_together(reader, options, raw, parts, nodal)
            if (options%modal_damping > 0.0_wp) then
               call damp_modes(model, k, options%modal_damping, nodal, error)
               if (allocated(error)) return
            end if
            call add_waves(options, static, model, nodal)
            if (allocated(parts%stress)) nodal%stress = transpose(reshape( &
               parts%stress, [size(parts%stress, 1), 6*size(parts%stress, 3)]))
            model%cyclic%nodal(k + 1) = nodal
         end associate
      end do
      call stand_in(options, raw, model)
      model%cyclic%loss_factor = options%loss_factor
      ! It is in the damping of each; the mass of bodies changes it.
      model%cyclic%modal_damping = options%modal_damping
   end subroutine finish_nodal

   !> Rows of stress of every nodal diameter, or of none; what is asked for by displacements alone
   !> finds rows of zeros there.
   subroutine find_nodal_stress(reader, raw)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(inout) :: raw
      integer :: k, n_points

      if (.not. allocated(raw%cyclic%nodal)) return
      n_points = 0
      do k = 1, size(raw%cyclic%nodal)
         associate (parts => raw%cyclic%nodal(k))
            if (allocated(parts%mass) .and. allocated(parts%stress)) n_points = &
               size(parts%stress, 3)
         end associate
      end do
      if (n_points == 0) return
      if (allocated(raw%stress%matrix)) then
         call reader%refuse_model('stress/matrix beside that of nodal diameters: must be one '// &
                                  'of both')
         return
      end if
      do k = 1, size(raw%cyclic%nodal)
         associate (parts => raw%cyclic%nodal(k))
            if (.not. allocated(parts%mass) .or. allocated(parts%stress)) cycle
            call reader%refuse_model('no nodal_diameter/'//to_text(k - 1)//'/stress/matrix, '// &
                                     'which other nodal diameters have')
            return
         end associate
      end do
      allocate (raw%stress%matrix(raw%cyclic%n_physical, 6, n_points), source=0.0_wp)
   end subroutine find_nodal_stress

   !> Loads of other harmonics, on the displacements in front.
   pure subroutine add_waves(options, static, model, nodal)
      type(model_options), intent(in) :: options
      real(wp), intent(in) :: static(:)
      type(model_type), intent(in) :: model
      type(nodal_matrices), intent(inout) :: nodal
      complex(wp), allocatable :: load(:, :)
      integer :: n

      n = size(static)
      nodal%load(:n, 1) = nodal%load(:n, 1) + options%static_scale*static
      nodal%waves = model%waves
      if (nodal%waves%n_waves() == 0) return
      allocate (load(size(nodal%load, 1), nodal%waves%n_columns()), source=(0.0_wp, 0.0_wp))
      load(:, :3) = nodal%load
      load(:n, 4:) = model%load_wave
      call move_alloc(load, nodal%load)
   end subroutine add_waves

   !> Hermitian, and real where waves stand.
   subroutine check_diameter(reader, parts, k, n_sectors)
      type(reader_type), intent(inout) :: reader
      type(nodal_parts), intent(in) :: parts
      integer, intent(in) :: k, n_sectors

      call check_one('mass', parts%mass)
      call check_one('stiffness', parts%stiffness)
      call check_one('damping', parts%damping)
      call check_one('stiffness_rotation', parts%stiffness_rotation)
      call check_one('coriolis', parts%coriolis, is_skew=.true.)

   contains

      subroutine check_one(name, matrix, is_skew)
         character(*), intent(in) :: name
         complex(wp), allocatable, intent(in) :: matrix(:, :)
         logical, intent(in), optional :: is_skew
         real(wp) :: largest, way
         character(14) :: kind_of

         if (.not. allocated(matrix)) return
         way = merge(-1.0_wp, 1.0_wp, present(is_skew))
         kind_of = merge('skew-Hermitian', 'Hermitian     ', present(is_skew))
         largest = maxval(abs(matrix))
         if (.not. largest <= huge(1.0_wp)) then
            call reader%refuse_model('a '//name//' of nodal diameter '//to_text(k)//' with an '// &
                                     'entry that is not finite')
         else if (any(abs(matrix - way*conjg(transpose(matrix))) > tolerance*largest)) then
            call reader%refuse_model('a '//name//' of nodal diameter '//to_text(k)//' that is '// &
                                     'not '//trim(kind_of)//': entries must be conjugates of '// &
                                     'each other, negative ones where it is skew')
         else if ((k == 0 .or. 2*k == n_sectors) .and. &
                  any(abs(aimag(matrix)) > tolerance*largest)) then
            call reader%refuse_model('a '//name//' of nodal diameter '//to_text(k)//' that is '// &
                                     'not real: all sectors move alike or in antiphase there')
         end if
      end subroutine check_one

   end subroutine check_diameter

   !> Rotation, damping and loads of a nodal diameter.
   subroutine put_together(reader, options, raw, parts, nodal)
      type(reader_type), intent(inout) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(nodal_parts), intent(in) :: parts
      type(nodal_matrices), intent(out) :: nodal

      nodal%mass = hermitian(parts%mass)
      nodal%stiffness = hermitian(parts%stiffness)
      if (options%rotation_speed > 0.0_wp) then
         if (allocated(parts%stiffness_rotation)) then
            nodal%stiffness = nodal%stiffness + options%rotation_speed**2* &
                              hermitian(parts%stiffness_rotation)
         else if (.not. (allocated(raw%load_static_rotation) .or. allocated(parts%coriolis) .or. &
                         allocated(parts%load_static_rotation) .or. raw%bodies%count() > 0)) then
            call reader%refuse('model', 'rotation_speed', 'is given, but the model has no '// &
                               'stiffness_rotation: remove it')
         end if
      end if
      if (allocated(parts%damping)) nodal%damping = hermitian(parts%damping)
      ! i G is Hermitian.
      if (allocated(parts%coriolis) .and. options%rotation_speed > 0.0_wp) then
         nodal%coriolis = options%rotation_speed*0.5_wp* &
                          (parts%coriolis - conjg(transpose(parts%coriolis)))
      end if
      if (options%rayleigh_mass + options%rayleigh_stiffness > 0.0_wp) then
         if (.not. allocated(nodal%damping)) nodal%damping = 0.0_wp*nodal%mass
         nodal%damping = nodal%damping + options%rayleigh_mass*nodal%mass + &
                         options%rayleigh_stiffness*nodal%stiffness
      end if
      call take_loads(reader, options, raw, parts, nodal)
      call join_bodies(options, raw, nodal)
   end subroutine put_together

   !> Bodies that no spring holds, among the displacements in front.
   pure subroutine join_bodies(options, raw, nodal)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(nodal_matrices), intent(inout) :: nodal
      real(wp), allocatable :: mass(:, :), load(:, :)
      integer :: n

      if (raw%bodies%count() == 0) return
      n = raw%cyclic%n_physical
      call raw%bodies%join(n, mass, load)
      nodal%mass(:n, :n) = nodal%mass(:n, :n) + mass
      if (options%rayleigh_mass > 0.0_wp) nodal%damping(:n, :n) = nodal%damping(:n, :n) + &
                                                                  options%rayleigh_mass*mass
      nodal%load(:n, 1) = nodal%load(:n, 1) + options%static_scale*options%rotation_speed**2* &
                          load(:, 1)
   end subroutine join_bodies

   !> The hermitian part.
   pure function hermitian(matrix) result(sound)
      complex(wp), intent(in) :: matrix(:, :)
      complex(wp), allocatable :: sound(:, :)

      ! What round-off of writing has left is shared by both triangles.
      sound = 0.5_wp*(matrix + conjg(transpose(matrix)))
   end function hermitian

   !> Loads of the nodal diameter, or those of the displacements in front.
   subroutine take_loads(reader, options, raw, parts, nodal)
      type(reader_type), intent(in) :: reader
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(nodal_parts), intent(in) :: parts
      type(nodal_matrices), intent(inout) :: nodal

      allocate (nodal%load(size(nodal%mass, 1), 3), source=(0.0_wp, 0.0_wp))
      call take(1, 'static', raw%load_static, parts%load_static)
      call take(2, 'cosine', raw%load_cosine, parts%load_cosine)
      call take(3, 'sine', raw%load_sine, parts%load_sine)
      associate (f => nodal%load(:, 1))
         if (allocated(parts%load_static_rotation)) then
            f = f + options%rotation_speed**2*parts%load_static_rotation
         else if (allocated(raw%load_static_rotation)) then
            f(:raw%cyclic%n_physical) = f(:raw%cyclic%n_physical) + &
                                        options%rotation_speed**2*raw%load_static_rotation
         end if
         f = options%static_scale*f
      end associate
      nodal%load(:, 2:) = options%harmonic_scale*nodal%load(:, 2:)

   contains

      subroutine take(column, key, physical, reduced)
         integer, intent(in) :: column
         character(*), intent(in) :: key
         real(wp), allocatable, intent(in) :: physical(:)
         complex(wp), allocatable, intent(in) :: reduced(:)

         if (allocated(reduced) .and. .not. reader%given('load', key)) then
            nodal%load(:, column) = reduced
         else if (allocated(physical)) then
            nodal%load(:size(physical), column) = physical
         end if
      end subroutine take

   end subroutine take_loads

   !> What asks a model of sectors whether loads act, or dofs have mass, finds it among the
   !> displacements.
   pure subroutine stand_in(options, raw, model)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model
      integer :: k, n

      associate (unused => options)
      end associate
      n = raw%cyclic%n_physical
      allocate (model%mass(n, n), model%stiffness(n, n), model%damping(n, n), source=0.0_wp)
      allocate (model%load_static(n), model%load_cosine(n), model%load_sine(n), source=0.0_wp)
      do k = 1, size(model%cyclic%nodal)
         associate (nodal => model%cyclic%nodal(k))
            if (.not. allocated(nodal%mass)) cycle
            model%mass = model%mass + real(nodal%mass(:n, :n), wp)
            model%stiffness = model%stiffness + real(nodal%stiffness(:n, :n), wp)
            if (k == 1) model%load_static(1) = norm2(abs(nodal%load(:, 1)))
            model%load_cosine(1) = max(model%load_cosine(1), norm2(abs(nodal%load(:, 2))))
            model%load_sine(1) = max(model%load_sine(1), norm2(abs(nodal%load(:, 3))))
         end associate
      end do
   end subroutine stand_in

   !> Observed quantities of every nodal diameter: rows of displacements, and rows of the nodal
   !> diameters themselves by their places.
   pure subroutine observe_nodal(raw, picks, model)
      type(raw_model), intent(in) :: raw
      !> Factors of the rows that stand with the nodal diameters (n_observed, n_rows).
      real(wp), intent(in) :: picks(:, :)
      type(model_type), intent(inout) :: model
      integer :: k

      if (.not. model%cyclic%has_nodal()) return
      do k = 1, size(model%cyclic%nodal)
         associate (nodal => model%cyclic%nodal(k), parts => raw%cyclic%nodal(k))
            if (.not. allocated(nodal%mass)) cycle
            allocate (nodal%observe(size(model%observe_matrix, 1), size(nodal%mass, 1)), &
                      source=(0.0_wp, 0.0_wp))
            nodal%observe(:, :model%n_dof) = model%observe_matrix
            if (size(picks, 2) > 0) nodal%observe = nodal%observe + matmul(picks, parts%observe)
         end associate
      end do
   end subroutine observe_nodal

end module fw_read_nodal
