!> Derivatives of the matrices and of the static load of a model by the keys that they are made
!> with: modal and Rayleigh damping, rotation speed.
module fw_model_changes
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

   public :: find_changes

   !> Step of the difference of the modal damping over the stiffness. Of fourth order: its error
   !> is the fourth power of the step, and what it makes of round-off is as small.
   real(wp), parameter :: step = 1.0e-3_wp

contains

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

end module fw_model_changes
