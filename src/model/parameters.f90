!> Parameters of a case by which its responses are differentiated, and over which resonances are
!> tracked: the words of the input, `group%key` of the key that holds the value.
module fw_parameters
   use fw_text, only: lower_case
   implicit none (type, external)
   private

   public :: parameter_words, n_parameter_words, parameter_number, parameter_group, parameter_key, &
             parameter_dataset, is_per_pair, is_per_spring, is_of_matrices
   public :: harmonic_scale, static_scale, friction_coefficient, normal_load, gap, &
             tangential_stiffness, normal_stiffness, spring_coefficient, modal_damping, &
             rotation_speed, rayleigh_mass, rayleigh_stiffness

   integer, parameter :: harmonic_scale = 1, static_scale = 2, friction_coefficient = 3, &
                         normal_load = 4, gap = 5, tangential_stiffness = 6, &
                         normal_stiffness = 7, spring_coefficient = 8, modal_damping = 9, &
                         rotation_speed = 10, rayleigh_mass = 11, rayleigh_stiffness = 12

   integer, parameter :: n_parameter_words = 12

   !> In the order of the constants.
   character(*), parameter :: parameter_words(n_parameter_words) = &
      [character(28) :: 'load%harmonic_scale', 'load%static_scale', 'contact%mu', &
       'contact%normal_load', 'contact%gap', 'contact%tangential_stiffness', &
       'contact%normal_stiffness', 'spring%coefficient', 'model%modal_damping', &
       'model%rotation_speed', 'model%rayleigh_mass', 'model%rayleigh_stiffness']

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

   !> Whether each pair has a value of its own.
   elemental logical function is_per_pair(number)
      integer, intent(in) :: number

      is_per_pair = any(number == [friction_coefficient, normal_load, gap, tangential_stiffness, &
                                   normal_stiffness])
   end function is_per_pair

   !> Whether each spring has a value of its own.
   elemental logical function is_per_spring(number)
      integer, intent(in) :: number

      is_per_spring = number == spring_coefficient
   end function is_per_spring

   !> Whether it changes matrices of the structure.
   elemental logical function is_of_matrices(number)
      integer, intent(in) :: number

      is_of_matrices = any(number == [modal_damping, rotation_speed, rayleigh_mass, &
                                      rayleigh_stiffness])
   end function is_of_matrices

end module fw_parameters
