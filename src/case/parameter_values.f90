!> Values of the parameters of fw_parameters in a case that has been read, and a case with other
!> values, as if it had been read with them.
module fw_parameter_values
   use fw_body, only: body_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_model_forming, only: form_structure
   use fw_parameters, only: blade_frequency, body_mass, friction_coefficient, gap, harmonic_scale, &
      is_of_elements, is_of_matrices, is_of_sectors, is_per_pair, is_per_spring, loss_factor, &
      mistuning_scale, modal_damping, normal_load, normal_stiffness, parameter_group, &
      parameter_key, rayleigh_mass, rayleigh_stiffness, residual_share, rotation_speed, slider_1, &
      slider_2, static_scale, tangential_stiffness
   implicit none (type, external)
   private

   public :: get_parameter, put_parameter

contains

   !> Values that a parameter has: one, or one for each pair or spring.
   pure integer function n_values(case, number)
      class(body_type), intent(in) :: case
      !> As in parameter_words.
      integer, intent(in) :: number
      character(24) :: group

      n_values = 1
      if (is_per_pair(number)) n_values = case%contact%n_pairs
      if (is_per_spring(number)) n_values = case%springs%n_springs
      if (is_of_elements(number)) then
         call parameter_group(number, group)
         n_values = case%elements%count_of(trim(group))
      end if
   end function n_values

   !> Values in the case (n_values).
   pure subroutine get_parameter(case, number, values)
      class(body_type), intent(in) :: case
      integer, intent(in) :: number
      real(wp), allocatable, intent(out) :: values(:)
      character(24) :: key
      integer :: k

      associate (c => case%contact)
         select case (number)
         case (friction_coefficient); values = c%mu
         case (normal_load); values = c%normal_load
         case (gap); values = c%gap
         case (tangential_stiffness); values = c%tangential_stiffness
         case (normal_stiffness); values = c%normal_stiffness
         case (residual_share); values = c%residual
         case (slider_1); values = c%slider_1
         case (slider_2); values = c%slider_2
         case (harmonic_scale); values = [case%model%harmonic_scale]
         case (static_scale); values = [case%model%static_scale]
         case default
            if (is_per_spring(number)) then
               values = case%springs%coefficient
               return
            else if (is_of_elements(number)) then
               call parameter_group(number, key)
               values = case%elements%coefficients_of(trim(key))
               return
            else if (is_per_pair(number)) then
               call parameter_key(number, key)
               values = c%constants%get(trim(key), c%n_pairs)
               return
            else if (is_of_sectors(number)) then
               allocate (values(0))
               if (allocated(case%model%cyclic%deviation)) values = &
                  case%model%cyclic%deviation%values_of(number - blade_frequency + 1)
               return
            end if
            values = [0.0_wp]
            if (.not. allocated(case%model%changes)) return
            do k = 1, size(case%model%changes)
               if (case%model%changes(k)%parameter == number) then
                  values = [case%model%changes(k)%value]
               end if
            end do
         end select
      end associate
   end subroutine get_parameter

   !> Give the case other values. A parameter of the matrices needs `origin`, which the case keeps
   !> where it was read with the parameter among those wanted.
   subroutine put_parameter(case, number, values, error)
      class(body_type), intent(inout) :: case
      integer, intent(in) :: number
      !> (n_values)
      real(wp), intent(in) :: values(:)
      !> Modes of the damping that cannot be found.
      type(error_type), allocatable, intent(out) :: error
      character(24) :: key

      associate (c => case%contact, m => case%model)
         select case (number)
         case (friction_coefficient); c%mu = values
         case (normal_load); c%normal_load = values
         case (gap); c%gap = values
         case (tangential_stiffness); c%tangential_stiffness = values
         case (normal_stiffness); c%normal_stiffness = values
         case (residual_share); c%residual = values
         case (slider_1); c%slider_1 = values
         case (slider_2); c%slider_2 = values
         case (harmonic_scale)
            call scale_vibration(values(1)/m%harmonic_scale, m)
            m%harmonic_scale = values(1)
            if (allocated(case%origin)) case%origin%options%harmonic_scale = values(1)
         case (static_scale)
            call scale_static(values(1)/m%static_scale, m)
            m%static_scale = values(1)
            if (allocated(case%origin)) case%origin%options%static_scale = values(1)
         case default
            call parameter_key(number, key)
            if (is_per_pair(number)) call c%constants%set(trim(key), values)
            if (is_per_spring(number)) case%springs%coefficient = values
            if (is_of_elements(number)) then
               call parameter_group(number, key)
               call case%elements%set_coefficients(trim(key), values)
            end if
            if (is_of_matrices(number)) call put_of_matrices(case, number, values(1), error)
            if (number == mistuning_scale) call m%cyclic%deviation%set_scale(values(1))
         end select
      end associate
   end subroutine put_parameter

   !> Factor of the loads above harmonic 0.
   subroutine scale_vibration(factor, model)
      real(wp), intent(in) :: factor
      type(model_type), intent(inout) :: model
      integer :: k

      if (allocated(model%load_cosine)) model%load_cosine = factor*model%load_cosine
      if (allocated(model%load_sine)) model%load_sine = factor*model%load_sine
      if (allocated(model%load_wave)) model%load_wave = factor*model%load_wave
      if (.not. allocated(model%cyclic%nodal)) return
      do k = 1, size(model%cyclic%nodal)
         if (.not. allocated(model%cyclic%nodal(k)%load)) cycle
         associate (load => model%cyclic%nodal(k)%load)
            load(:, 2:) = factor*load(:, 2:)
         end associate
      end do
   end subroutine scale_vibration

   !> Factor of the loads of harmonic 0.
   subroutine scale_static(factor, model)
      real(wp), intent(in) :: factor
      type(model_type), intent(inout) :: model
      integer :: k

      if (allocated(model%load_static)) model%load_static = factor*model%load_static
      if (.not. allocated(model%cyclic%nodal)) return
      do k = 1, size(model%cyclic%nodal)
         if (.not. allocated(model%cyclic%nodal(k)%load)) cycle
         associate (load => model%cyclic%nodal(k)%load)
            load(:, 1) = factor*load(:, 1)
         end associate
      end do
   end subroutine scale_static

   !> Put the structure together anew.
   subroutine put_of_matrices(case, number, value, error)
      class(body_type), intent(inout) :: case
      integer, intent(in) :: number
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error

      if (case%model%cyclic%is_cyclic) then
         call put_mass(value, case)
         return
      end if
      associate (options => case%origin%options)
         select case (number)
         case (modal_damping); options%modal_damping = value
         case (rotation_speed); options%rotation_speed = value
         case (rayleigh_mass); options%rayleigh_mass = value
         case (rayleigh_stiffness); options%rayleigh_stiffness = value
         case (loss_factor); options%loss_factor = value
         case (body_mass)
            call case%origin%raw%bodies%set_mass(value, case%origin%raw%mass, &
                                                 case%origin%raw%growth%load)
            if (allocated(case%bodies)) case%bodies%mass = value
         case default ! changes no matrix
         end select
      end associate
      associate (origin => case%origin)
         call form_structure(origin%options, origin%raw, origin%static, origin%wanted, &
                             case%model, error)
      end associate
   end subroutine put_of_matrices

   !> The mass of bodies in a wave, on which matrices and load depend in proportion: what else they
   !> hold by the speed, by directions of their own or by damping stays as it was formed.
   pure subroutine put_mass(value, case)
      real(wp), intent(in) :: value
      class(body_type), intent(inout) :: case
      integer :: k

      k = findloc(case%model%changes%parameter, body_mass, dim=1)
      associate (m => case%model, change => case%model%changes(k))
         m%mass = m%mass + (value - change%value)*change%mass
         m%damping = m%damping + (value - change%value)*change%damping
         m%load_static = m%load_static + (value - change%value)*change%load_static
         change%value = value
      end associate
      if (allocated(case%bodies)) case%bodies%mass = value
   end subroutine put_mass

end module fw_parameter_values
