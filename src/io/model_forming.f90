!> The matrices and the static load of a model from the parts that were given: rotation, Rayleigh
!> and modal damping, factors, and the derivatives by these that are wanted.
module fw_model_forming
   use fw_damping, only: add_modal_damping
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_model_changes, only: find_changes
   use fw_raw_model, only: raw_model
   use fw_model_keys, only: model_options
   implicit none (type, external)
   private

   public :: model_origin, form_structure, form_matrices, finish_structure

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

end module fw_model_forming
