!> The matrices and the static load of a model from the parts that were given: rotation, Rayleigh
!> and modal damping, factors, and the derivatives by these that are wanted.
module fw_model_forming
   use fw_damping, only: add_modal_damping
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: matrix_change, model_type
   use fw_raw_model, only: raw_model
   use fw_model_keys, only: model_options
   use fw_parameters, only: is_of_matrices, modal_damping, rayleigh_mass, rayleigh_stiffness, &
      rotation_speed
   implicit none (type, external)
   private

   public :: model_origin, find_changes, form_structure, form_matrices, finish_structure

   !> Step of the difference of the modal damping over the stiffness. Of fourth order: its error
   !> is the fourth power of the step, and what it makes of round-off is as small.
   real(wp), parameter :: step = 1.0e-3_wp

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
      call add_rotation(options%rotation_speed, raw, model)
      model%load_static = options%static_scale*model%load_static
      if (allocated(raw%damping)) then
         model%damping = raw%damping
      else
         if (allocated(model%damping)) deallocate (model%damping)
         allocate (model%damping(model%n_dof, model%n_dof), source=0.0_wp)
      end if
      model%damping = model%damping + options%rayleigh_mass*model%mass &
                      + options%rayleigh_stiffness*model%stiffness
      model%rotates = allocated(raw%stiffness_rotation) .or. allocated(raw%load_static_rotation)
   end subroutine form_matrices

   !> Modal damping, and derivatives by what is wanted; without any of these the matrices that were
   !> given are not needed any more.
   subroutine finish_structure(options, raw, wanted, model, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      integer, intent(in) :: wanted(:)
      type(model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error

      ! Last: its modes are those of the rotating structure, contact open.
      if (model%cyclic%is_cyclic) then
         ! Modes are those of the tied sectors.
         model%cyclic%modal_damping = options%modal_damping
      else if (options%modal_damping > 0.0_wp) then
         call add_modal_damping(model%mass, model%stiffness, options%modal_damping, &
                                model%damping, error)
      end if
      if (model%cyclic%is_cyclic .or. allocated(error)) return
      call find_changes(options, raw, wanted, model, error)
   end subroutine finish_structure

   !> Centrifugal stiffness and load grow with the square of the speed.
   subroutine add_rotation(speed, raw, model)
      real(wp), intent(in) :: speed
      type(raw_model), intent(in) :: raw
      type(model_type), intent(inout) :: model

      if (speed <= 0.0_wp) return
      if (allocated(raw%stiffness_rotation)) then
         model%stiffness = model%stiffness + speed**2*raw%stiffness_rotation
      end if
      if (allocated(raw%load_static_rotation)) then
         model%load_static = model%load_static + speed**2*raw%load_static_rotation
      end if
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
      integer :: n

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
         call add_modal_damping(model%mass, model%stiffness, 1.0_wp, change%damping, error)
         change%value = options%modal_damping
      case (rotation_speed)
         call change_by_speed(options, raw, model, change, error)
         change%value = options%rotation_speed
      case default ! changes no matrix
      end select
   end subroutine find_change

   !> d/d Omega of K + Omega**2 K_r, of the load likewise, and of the damping that follows K.
   subroutine change_by_speed(options, raw, model, change, error)
      type(model_options), intent(in) :: options
      type(raw_model), intent(in) :: raw
      type(model_type), intent(in) :: model
      type(matrix_change), intent(inout) :: change
      type(error_type), allocatable, intent(out) :: error

      associate (speed => options%rotation_speed)
         if (allocated(raw%load_static_rotation)) then
            change%load_static = options%static_scale*2.0_wp*speed*raw%load_static_rotation
         end if
         if (.not. allocated(raw%stiffness_rotation)) return
         change%stiffness = 2.0_wp*speed*raw%stiffness_rotation
         change%damping = options%rayleigh_stiffness*change%stiffness
         if (options%modal_damping > 0.0_wp .and. speed > 0.0_wp) then
            call change_modal_damping(options, raw%stiffness_rotation, model, change%damping, error)
         end if
      end associate
   end subroutine change_by_speed

   !> Modes turn with the stiffness: a difference of the square root that modal damping is.
   subroutine change_modal_damping(options, rotation, model, damping, error)
      type(model_options), intent(in) :: options
      !> Stiffness per square of the speed.
      real(wp), intent(in) :: rotation(:, :)
      type(model_type), intent(in) :: model
      !> Grows by the derivative.
      real(wp), intent(inout) :: damping(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: place(4) = [-2, -1, 1, 2]
      real(wp), parameter :: weight(4) = [1.0_wp, -8.0_wp, 8.0_wp, -1.0_wp]/12.0_wp
      real(wp), allocatable :: stiffness(:, :)
      real(wp) :: h, speed
      integer :: k

      h = step*options%rotation_speed
      do k = 1, size(place)
         speed = options%rotation_speed + place(k)*h
         stiffness = model%stiffness + (speed**2 - options%rotation_speed**2)*rotation
         call add_modal_damping(model%mass, stiffness, weight(k)/h*options%modal_damping, damping, &
                                error)
         if (allocated(error)) return
      end do
   end subroutine change_modal_damping

end module fw_model_forming
