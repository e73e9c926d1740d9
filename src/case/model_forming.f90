!> The matrices and the static load of a model from the parts that were given: rotation, Rayleigh
!> and modal damping, factors, and the derivatives by these that are wanted.
module fw_model_forming
   use fw_cyclic_data, only: speed_matrices
   use fw_damping, only: difference_place, difference_step, difference_weight
   use fw_error, only: error_type
   use fw_kinds, only: pi, wp
   use fw_model, only: matrix_change, model_type
   use fw_raw_model, only: raw_model
   use fw_speed_growth, only: even_powers, slopes_of_powers, speed_growth
   use fw_model_keys, only: model_options
   use fw_parameters, only: body_mass, is_of_matrices, loss_factor, modal_damping, rayleigh_mass, &
      rayleigh_stiffness, rotation_speed
   use fw_sector, only: damp_structure
   implicit none (type, external)
   private

   public :: model_origin, find_changes, form_structure, form_matrices, finish_structure
   public :: goes_alone

   !> What a model is made of, to make it again with other options.
   type :: model_origin
      type(model_options) :: options
      !> As it was given, checked.
      type(raw_model) :: raw
      !> Static loads of any other key, before their factor (n_dof).
      real(wp), allocatable :: static(:)
      !> Parameters of fw_parameters by which responses are to be differentiated.
      integer, allocatable :: wanted(:)
   end type model_origin

contains

   !> Mass, stiffness, damping and static load; what else the model has stays.
   subroutine form_structure(options, raw, static, wanted, model, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      !> As in model_origin.
      real(wp), intent(in) :: static(:)
      integer, intent(in) :: wanted(:)
      type(model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error

      call form_matrices(options, raw, static, model)
      call finish_structure(options, raw, wanted, model, error)
   end subroutine form_structure

   !> Mass, stiffness and static load at speed, and damping without that of modes.
   subroutine form_matrices(options, raw, static, model)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      real(wp), intent(in) :: static(:)
      type(model_type), intent(inout) :: model

      model%n_dof = size(raw%stiffness, 1)
      model%mass = raw%mass
      model%stiffness = raw%stiffness
      model%load_static = raw%load_static + static
      ! Rotation comes before damping, which takes the stiffness at speed, and before the static
      ! scale, which multiplies the load of the rotation too.
      call add_rotation(options%rotation_speed, raw%growth, model)
      model%load_static = options%static_scale*model%load_static
      if (allocated(raw%damping)) then
         model%damping = raw%damping
      else
         if (allocated(model%damping)) deallocate (model%damping)
         allocate (model%damping(model%n_dof, model%n_dof), source=0.0_wp)
      end if
      model%damping = model%damping + options%rayleigh_mass*model%mass &
                      + options%rayleigh_stiffness*model%stiffness
      model%rotates = raw%growth%exists()
      model%turns = model%rotates .or. allocated(raw%coriolis) .or. &
                    allocated(raw%circulatory) .or. raw%contact%has_growth()
      ! Before the matrices below are added, which it is no part of.
      call add_loss(options, raw, model)
      call add_unsymmetric(options, raw, model)
      if (options%speed_order > 0.0_wp) call follow_speed(options, raw, model)
   end subroutine form_matrices

   !> Whether a model that is no sector is solved as the only one of a cyclic structure, whose
   !> blocks need not be symmetric.
   pure logical function goes_alone(options, raw) result(alone)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw

      alone = options%speed_order > 0.0_wp .or. allocated(raw%coriolis) .or. &
              allocated(raw%circulatory) .or. allocated(raw%cyclic%air) .or. &
              is_unsymmetric(raw%stiffness_unsymmetric) .or. &
              is_unsymmetric(raw%damping_unsymmetric)
      if (allocated(raw%structural_damping)) alone = alone .or. &
         any(abs(raw%structural_damping) > 0.0_wp)
      ! The loss factor is one of the stiffness without the matrix that is added.
      alone = alone .or. (options%loss_factor > 0.0_wp .and. allocated(raw%stiffness_unsymmetric))
   end function goes_alone

   pure logical function is_unsymmetric(matrix)
      real(wp), allocatable, intent(in) :: matrix(:, :)

      is_unsymmetric = .false.
      if (.not. allocated(matrix)) return
      if (size(matrix, 1) /= size(matrix, 2)) return
      is_unsymmetric = any(abs(matrix - transpose(matrix)) > 0.0_wp)
   end function is_unsymmetric

   !> Hysteretic damping: a factor where it is alone, and of sectors a matrix.
   subroutine add_loss(options, raw, model)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model

      if (.not. model%cyclic%is_cyclic) then
         model%loss_factor = options%loss_factor
         return
      end if
      if (allocated(raw%structural_damping)) model%cyclic%structural = raw%structural_damping
      if (options%loss_factor <= 0.0_wp) return
      if (.not. allocated(model%cyclic%structural)) then
         model%cyclic%structural = options%loss_factor*model%stiffness
      else
         model%cyclic%structural = model%cyclic%structural + options%loss_factor*model%stiffness
      end if
   end subroutine add_loss

   !> Symmetric parts join the matrices, skew ones stand by themselves.
   subroutine add_unsymmetric(options, raw, model)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model

      call split(raw%stiffness_unsymmetric, 1.0_wp, model%stiffness, model%cyclic%circulatory)
      call split(raw%damping_unsymmetric, 1.0_wp, model%damping, model%cyclic%coriolis)
      if (options%rotation_speed > 0.0_wp) then
         call split(raw%circulatory, options%rotation_speed, model%stiffness, &
                    model%cyclic%circulatory)
      end if
   end subroutine add_unsymmetric

   !> Add the parts of factor times a matrix.
   pure subroutine split(matrix, factor, symmetric, skew)
      real(wp), allocatable, intent(in) :: matrix(:, :)
      real(wp), intent(in) :: factor
      real(wp), intent(inout) :: symmetric(:, :)
      real(wp), allocatable, intent(inout) :: skew(:, :)

      if (.not. allocated(matrix)) return
      symmetric = symmetric + 0.5_wp*factor*(matrix + transpose(matrix))
      if (.not. is_unsymmetric(matrix)) return
      if (.not. allocated(skew)) then
         skew = 0.5_wp*factor*(matrix - transpose(matrix))
      else
         skew = skew + 0.5_wp*factor*(matrix - transpose(matrix))
      end if
   end subroutine split

   !> What follows the frequency with the rotation speed.
   subroutine follow_speed(options, raw, model)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model
      type(speed_matrices) :: speed

      speed%order = options%speed_order
      if (allocated(raw%coriolis)) speed%coriolis = raw%coriolis
      if (allocated(raw%circulatory)) speed%circulatory = raw%circulatory
      speed%growth = raw%growth
      if (allocated(raw%growth%load)) speed%growth%load = options%static_scale*raw%growth%load
      speed%rayleigh = options%rayleigh_stiffness
      speed%loss = options%loss_factor
      model%cyclic%speed = speed
   end subroutine follow_speed

   !> Modal damping, and derivatives by what is wanted; without any of these the matrices that were
   !> given are not needed any more.
   subroutine finish_structure(options, raw, wanted, model, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      integer, intent(in) :: wanted(:)
      type(model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: damping(:, :)

      ! Last: its modes are those of the rotating structure.
      if (model%cyclic%is_cyclic) then
         ! Modes are those of the tied sectors.
         model%cyclic%modal_damping = options%modal_damping
      else if (options%modal_damping > 0.0_wp) then
         call move_alloc(model%damping, damping)
         call damp_structure(model, model%stiffness, options%modal_damping, damping, error, &
                             2.0_wp*pi*options%modal_damping_up_to)
         call move_alloc(damping, model%damping)
      end if
      if (allocated(error)) return
      call find_changes(options, raw, wanted, model, error)
   end subroutine finish_structure

   !> Centrifugal stiffness and load grow with even powers of the speed.
   subroutine add_rotation(speed, growth, model)
      real(wp), intent(in) :: speed
      type(speed_growth), intent(in) :: growth
      type(model_type), intent(inout) :: model

      if (allocated(growth%load_at_rest)) model%load_static = model%load_static + &
                                                              growth%load_at_rest
      if (speed <= 0.0_wp) return
      call growth%add_stiffness(even_powers(speed, growth%n_powers()), model%stiffness)
      call growth%add_load(even_powers(speed, growth%n_powers()), model%load_static)
   end subroutine add_rotation

   !> The changes by those of the wanted parameters that change matrices.
   subroutine find_changes(options, raw, wanted, model, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      integer, intent(in) :: wanted(:)
      !> Complete, with rotation and damping.
      type(model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      type(matrix_change), allocatable :: changes(:)
      integer, allocatable :: parameters(:)
      integer :: k

      parameters = pack(wanted, is_of_matrices(wanted))
      ! Of waves no other change is taken to the nodal diameters.
      if (model%cyclic%is_cyclic) parameters = pack(parameters, parameters == body_mass)
      if (size(parameters) == 0) return
      allocate (changes(size(parameters)))
      do k = 1, size(parameters)
         call find_change(options, raw, parameters(k), model, changes(k), error)
         if (allocated(error)) return
      end do
      call move_alloc(changes, model%changes)
   end subroutine find_changes

   subroutine find_change(options, raw, parameter, model, change, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      integer, intent(in) :: parameter
      type(model_type), intent(in) :: model
      type(matrix_change), intent(out) :: change
      type(error_type), allocatable, intent(out) :: error
      integer :: i, n

      n = model%n_dof
      change%parameter = parameter
      allocate (change%stiffness(n, n), change%damping(n, n), change%load_static(n), source=0.0_wp)
      select case (parameter)
      case (rayleigh_mass)
         change%damping = model%mass
         change%value = options%rayleigh_mass
      case (rayleigh_stiffness)
         change%damping = model%stiffness
         change%value = options%rayleigh_stiffness
      case (modal_damping)
         ! The damping of all modes is proportional to the ratio.
         call damp_structure(model, model%stiffness, 1.0_wp, change%damping, error, &
                             2.0_wp*pi*options%modal_damping_up_to)
         change%value = options%modal_damping
      case (loss_factor)
         change%stiffness = model%stiffness
         change%is_loss = .true.
         change%value = options%loss_factor
      case (rotation_speed)
         call change_by_speed(options, raw, model, change, error)
         change%value = options%rotation_speed
      case (body_mass)
         allocate (change%mass(n, n), source=0.0_wp)
         do i = 1, raw%bodies%count()
            change%mass = change%mass + raw%bodies%unit_matrix(i, n)
            change%load_static = change%load_static + options%static_scale* &
                                 options%rotation_speed**2*raw%bodies%unit_load(i, n)
         end do
         change%damping = options%rayleigh_mass*change%mass
         ! Without bodies it is refused later, in words.
         if (raw%bodies%count() == 0) return
         change%value = raw%bodies%mass(1)
         if (options%modal_damping > 0.0_wp .and. .not. model%cyclic%is_cyclic) then
            call follow_mass(options, model, change, error)
         end if
      case default ! changes no matrix
      end select
   end subroutine find_change

   !> What the damping of modes has of the mass, of which `change` holds the derivative.
   subroutine follow_mass(options, model, change, error)
      type(model_options), intent(in) :: options
      type(model_type), intent(in) :: model
      type(matrix_change), intent(inout) :: change
      type(error_type), allocatable, intent(out) :: error
      type(model_type), allocatable :: moved
      real(wp) :: h
      integer :: k

      h = difference_step*change%value
      allocate (moved, source=model)
      do k = 1, size(difference_place)
         moved%mass = model%mass + difference_place(k)*h*change%mass
         call damp_structure(moved, model%stiffness, difference_weight(k)/h*options%modal_damping, &
                             change%damping, error, 2.0_wp*pi*options%modal_damping_up_to)
         if (allocated(error)) return
      end do
   end subroutine follow_mass

   !> d/d Omega of K + Omega**2 K_r, of the load likewise, and of the damping that follows K.
   subroutine change_by_speed(options, raw, model, change, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(in) :: model
      type(matrix_change), intent(inout) :: change
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: slopes(:)

      associate (speed => options%rotation_speed)
         slopes = slopes_of_powers(speed, raw%growth%n_powers())
         call raw%growth%add_load(slopes, change%load_static)
         change%load_static = options%static_scale*change%load_static
         if (.not. allocated(raw%growth%stiffness)) return
         call raw%growth%add_stiffness(slopes, change%stiffness)
         change%damping = options%rayleigh_stiffness*change%stiffness
         if (options%modal_damping > 0.0_wp .and. speed > 0.0_wp) then
            call change_modal_damping(options, raw%growth, model, change%damping, error)
         end if
      end associate
   end subroutine change_by_speed

   !> Modes turn with the stiffness: a difference of the square root that modal damping is.
   subroutine change_modal_damping(options, growth, model, damping, error)
      type(model_options), intent(in) :: options
      !> What the stiffness has by the speed.
      type(speed_growth), intent(in) :: growth
      type(model_type), intent(in) :: model
      !> Grows by the derivative.
      real(wp), intent(inout) :: damping(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :)
      real(wp) :: h, speed
      integer :: k, n

      h = difference_step*options%rotation_speed
      n = growth%n_powers()
      do k = 1, size(difference_place)
         speed = options%rotation_speed + difference_place(k)*h
         stiffness = model%stiffness
         call growth%add_stiffness(even_powers(speed, n) - even_powers(options%rotation_speed, n), &
                                   stiffness)
         call damp_structure(model, stiffness, difference_weight(k)/h*options%modal_damping, &
                             damping, error, 2.0_wp*pi*options%modal_damping_up_to)
         if (allocated(error)) return
      end do
   end subroutine change_modal_damping

end module fw_model_forming
