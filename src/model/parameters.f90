!> Parameters of a case by which its responses are differentiated, and over which resonances are
!> tracked: the words of the input, `group%key` of the key that holds the value.
module fw_parameters
   use fw_text, only: lower_case
   implicit none (type, external)
   private

   public :: parameter_type, parameters, parameter_words, n_parameter_words, parameter_number, &
             parameter_group, parameter_key, parameter_dataset
   public :: is_of_elements, is_of_loads, is_of_matrices, is_of_sectors, is_per_element, &
             is_per_pair, is_per_spring
   public :: harmonic_scale, static_scale, friction_coefficient, normal_load, gap, &
             tangential_stiffness, normal_stiffness, spring_coefficient, modal_damping, &
             rotation_speed, rayleigh_mass, rayleigh_stiffness, normal_coefficient, &
             reference_force, loss_factor, slip_speed, mu_dynamic, blade_frequency, &
             mistuning_scale, body_mass, residual_share, slider_1, slider_2
   public :: of_sliding, of_closing, of_pressed, not_negative, positive, within_one

   integer, parameter :: harmonic_scale = 1, static_scale = 2, friction_coefficient = 3, &
                         normal_load = 4, gap = 5, tangential_stiffness = 6, &
                         normal_stiffness = 7, spring_coefficient = 8, modal_damping = 9, &
                         rotation_speed = 10, rayleigh_mass = 11, rayleigh_stiffness = 12, &
                         normal_coefficient = 13, reference_force = 14, loss_factor = 17, &
                         slip_speed = 18, mu_dynamic = 19
   !> The first and the last of those in which sectors differ, in the order of fw_deviation.
   integer, parameter :: blade_frequency = 20, mistuning_scale = 24
   integer, parameter :: body_mass = 25
   integer, parameter :: residual_share = 26, slider_1 = 27, slider_2 = 28

   !> Where its values are: one of the loads, one for each pair or spring, one of the matrices, one
   !> for each of a group of other elements (its coefficient), one for each sector or for each row
   !> of each of them.
   integer, parameter :: of_loads = 1, of_pairs = 2, of_springs = 3, of_matrices = 4, &
                         of_elements = 5, of_sectors = 6
   !> Pairs that it says something of: those with tangential dofs, with a normal dof, or those that
   !> a constant load presses, as they have no normal dof.
   integer, parameter :: of_sliding = 1, of_closing = 2, of_pressed = 3
   !> What a value may be.
   integer, parameter :: any_sign = 0, not_negative = 1, positive = 2, within_one = 3

   !> A parameter: its name, its unit, and where it stands in a case.
   type :: parameter_type
      !> `group%key` of the key that holds the value.
      character(28) :: word
      integer :: of
      integer :: sign = any_sign
      integer :: pairs = 0
      !> Whether fw_parameter_slopes knows its derivative; without it only sweeps by natural steps
      !> go over it.
      logical :: has_slope = .true.
   end type parameter_type

   !> In the order of the constants. A new parameter is a row. Of the pairs it is a constant of a
   !> law, or has its value in fw_parameter_values as the others do; the derivative is in
   !> fw_parameter_slopes.
   type(parameter_type), parameter :: parameters(*) = [ &
      parameter_type('load%harmonic_scale', of_loads), &
      parameter_type('load%static_scale', of_loads), &
      parameter_type('contact%mu', of_pairs, not_negative, of_sliding), &
      parameter_type('contact%normal_load', of_pairs, not_negative, of_pressed), &
      parameter_type('contact%gap', of_pairs, any_sign, of_closing), &
      parameter_type('contact%tangential_stiffness', of_pairs, positive, of_sliding), &
      parameter_type('contact%normal_stiffness', of_pairs, positive, of_closing), &
      parameter_type('spring%coefficient', of_springs), &
      parameter_type('model%modal_damping', of_matrices, not_negative), &
      parameter_type('model%rotation_speed', of_matrices, not_negative), &
      parameter_type('model%rayleigh_mass', of_matrices, not_negative), &
      parameter_type('model%rayleigh_stiffness', of_matrices, not_negative), &
      parameter_type('contact%normal_coefficient', of_pairs, positive, of_closing), &
      parameter_type('contact%reference_force', of_pairs, positive, of_closing), &
      parameter_type('polynomial%coefficient', of_elements), &
      parameter_type('damper%coefficient', of_elements), &
      parameter_type('model%loss_factor', of_matrices, not_negative), &
      parameter_type('contact%slip_speed', of_pairs, positive, of_sliding), &
      parameter_type('contact%mu_dynamic', of_pairs, not_negative, of_sliding), &
      parameter_type('mistuning%frequency', of_sectors), &
      parameter_type('mistuning%damping_ratio', of_sectors), &
      parameter_type('mistuning%stiffness', of_sectors), &
      parameter_type('mistuning%mass', of_sectors), &
      parameter_type('mistuning%scale', of_sectors), &
      parameter_type('body%mass', of_matrices, positive), &
      parameter_type('contact%residual', of_pairs, within_one, of_sliding), &
      parameter_type('contact%slider_1', of_pairs, any_sign, of_sliding), &
      parameter_type('contact%slider_2', of_pairs, any_sign, of_sliding)]

   integer, parameter :: n_parameter_words = size(parameters)
   character(*), parameter :: parameter_words(*) = parameters%word

contains

   !> Where a word stands among `parameter_words`, in any case of letters; 0 where it does not.
   pure integer function parameter_number(word) result(number)
      character(*), intent(in) :: word

      number = findloc(parameter_words, lower_case(word), dim=1)
   end function parameter_number

   !> Group of the key, 'contact' for one.
   pure subroutine parameter_group(number, group)
      integer, intent(in) :: number
      ! allow(C072): a text of the caller
      character(*), intent(out) :: group

      group = parameter_words(number)(:index(parameter_words(number), '%') - 1)
   end subroutine parameter_group

   !> Name of the key, 'mu' for one.
   pure subroutine parameter_key(number, key)
      integer, intent(in) :: number
      ! allow(C072): a text of the caller
      character(*), intent(out) :: key

      key = parameter_words(number)(index(parameter_words(number), '%') + 1:)
   end subroutine parameter_key

   !> The word as it stands in the names of datasets: 'contact_mu'.
   pure subroutine parameter_dataset(number, name)
      integer, intent(in) :: number
      ! allow(C072): a text of the caller
      character(*), intent(out) :: name
      integer :: at

      name = parameter_words(number)
      at = index(name, '%')
      name(at:at) = '_'
   end subroutine parameter_dataset

   !> Whether it is a factor of loads.
   elemental logical function is_of_loads(number)
      integer, intent(in) :: number

      is_of_loads = is_of(number, of_loads)
   end function is_of_loads

   !> Whether each pair has a value of its own.
   elemental logical function is_per_pair(number)
      integer, intent(in) :: number

      is_per_pair = is_of(number, of_pairs)
   end function is_per_pair

   !> Whether each spring has a value of its own.
   elemental logical function is_per_spring(number)
      integer, intent(in) :: number

      is_per_spring = is_of(number, of_springs)
   end function is_per_spring

   !> Whether each element of a group that is neither of pairs nor of springs has a value.
   elemental logical function is_of_elements(number)
      integer, intent(in) :: number

      is_of_elements = is_of(number, of_elements)
   end function is_of_elements

   !> Whether it has a value for each element of some kind, pairs and springs among them.
   elemental logical function is_per_element(number)
      integer, intent(in) :: number

      is_per_element = is_per_pair(number) .or. is_per_spring(number) .or. &
                       is_of_elements(number) .or. &
                       (is_of_sectors(number) .and. number /= mistuning_scale)
   end function is_per_element

   !> Whether it says how sectors differ.
   elemental logical function is_of_sectors(number)
      integer, intent(in) :: number

      is_of_sectors = is_of(number, of_sectors)
   end function is_of_sectors

   !> Whether it changes matrices of the structure.
   elemental logical function is_of_matrices(number)
      integer, intent(in) :: number

      is_of_matrices = is_of(number, of_matrices)
   end function is_of_matrices

   !> 0 stands for no parameter.
   elemental logical function is_of(number, of)
      integer, intent(in) :: number, of

      is_of = .false.
      if (number > 0) is_of = parameters(number)%of == of
   end function is_of

end module fw_parameters
