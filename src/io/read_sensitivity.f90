!> Group &sensitivity: which derivatives are wanted, and whether the case has them.
module fw_read_sensitivity
   use fw_case, only: analyses, case_type
   use fw_deviation, only: mass_part
   use fw_error, only: error_type, fatal_error, status_input
   use fw_key, only: key
   use fw_key_range, only: at_least
   use fw_kinds, only: wp
   use fw_mode_options, only: control_observed
   use fw_parameter_checks, only: check_parameter, pairs_of
   use fw_parameter_values, only: get_parameter
   use fw_parameters, only: blade_frequency, friction_coefficient, harmonic_scale, is_of_sectors, &
      normal_load, parameter_words
   use fw_reader, only: reader_type
   use fw_reader_text, only: did_you_mean
   use fw_response_rows, only: dissipation, first_harmonic, is_of_pairs, largest, load_scale, &
      mode_damping_ratio, mode_omega, quantity_words, resonance_omega, wear_volume
   use fw_sensitivity_options, only: sensitivity_options
   use fw_text, only: lower_case, string_type
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: read_sensitivity, finish_sensitivity, check_sensitivity

   character(*), parameter :: group = 'sensitivity'

contains

   !> The keys, read before the model, which keeps what its matrices change by.
   subroutine read_sensitivity(reader, options)
      type(reader_type), intent(inout) :: reader
      type(sensitivity_options), intent(inout) :: options
      type(string_type), allocatable :: words(:)
      logical, allocatable :: is_text(:)

      call reader%open(group, 'derivatives of the response by parameters of the case')
      call reader%bind_list(key('parameters', 'what the response is differentiated by', &
                                absent='none: no derivatives', &
                                only="analysis = 'frf', 'point', 'resonance', 'mode'"), &
                            'some of '//list_of(parameter_words), size(parameter_words), words, &
                            is_text)
      call find_words(reader, 'parameters', words, parameter_words, options%parameters)
      call reader%bind_list(key('quantities', 'first_harmonic, largest, dissipation, wear_volume', &
                                absent='all that the case has', only='parameters'), 'quantities', &
                            size(quantity_words), words, is_text)
      call find_words(reader, 'quantities', words, quantity_words, options%quantities)
      ! One deviation for each parameter, or one for all.
      call reader%set_size('n_parameters', size(options%parameters))
      call reader%bind(key('deviation', 'standard deviation of each parameter over its value', &
                           at_least(0.0_wp), shape='n_parameters', absent='none', &
                           only='parameters'), options%deviation)
      if (size(options%parameters) > 0 .or. reader%failed()) return
      if (size(options%quantities) > 0) call reader%refuse(group, 'quantities', &
         'is given without parameters: name them, or leave it out')
      if (reader%given(group, 'deviation')) call reader%refuse(group, 'deviation', &
         'is given without parameters: name them, or leave it out')
   end subroutine read_sensitivity

   !> Numbers of words, each of which may be given once.
   subroutine find_words(reader, name, given, words, numbers)
      type(reader_type), intent(inout) :: reader
      !> Of the key.
      character(*), intent(in) :: name
      type(string_type), intent(in) :: given(:)
      character(*), intent(in) :: words(:)
      integer, allocatable, intent(out) :: numbers(:)
      type(string_type) :: known(size(words))
      integer :: i, k

      ! For the nearest word of a misspelling.
      do k = 1, size(words)
         known(k)%text = trim(words(k))
      end do
      allocate (numbers(0))
      do i = 1, size(given)
         k = findloc(words, lower_case(given(i)%text), dim=1)
         if (k == 0) then
            call reader%refuse(group, name, '= '//quoted_text(given(i)%text)//': must be one '// &
                               'of '//list_of(words)//did_you_mean(given(i)%text, known))
         else if (any(numbers == k)) then
            call reader%refuse(group, name, 'names '//quoted_text(given(i)%text)//' twice')
         else
            numbers = [numbers, k]
         end if
      end do
   end subroutine find_words

   !> The words, separated by commas.
   pure function list_of(words) result(text)
      character(*), intent(in) :: words(:)
      character(:), allocatable :: text
      integer :: k

      text = "'"//trim(words(1))//"'"
      do k = 2, size(words)
         text = text//", '"//trim(words(k))//"'"
      end do
   end function list_of

   !> All quantities that the case has, where none is named.
   subroutine finish_sensitivity(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(inout) :: case

      associate (options => case%sensitivity)
         if (.not. options%is_wanted()) return
         options%has_harmonics = reader%given('harmonics', 'n_harmonics')
         if (analyses(case%analysis)%is_resonance) options%further = [resonance_omega]
         if (case%control%is_wanted()) options%further = [load_scale]
         if (analyses(case%analysis)%is_free) options%further = [mode_omega, mode_damping_ratio]
         if (size(options%quantities) > 0) return
         options%quantities = [first_harmonic, largest]
         if (is_cyclic_mode(case)) options%quantities = [first_harmonic]
         if (case%contact%n_pairs == 0) return
         options%quantities = [options%quantities, dissipation]
         if (.not. allocated(case%wear%coefficient)) return
         options%quantities = [options%quantities, wear_volume]
      end associate
   end subroutine finish_sensitivity

   !> Higher harmonics of a wave are condensed, and what is observed of them follows the frequency.
   pure logical function is_cyclic_mode(case)
      type(case_type), intent(in) :: case

      is_cyclic_mode = analyses(case%analysis)%is_free .and. case%model%cyclic%is_cyclic
   end function is_cyclic_mode

   !> Refuse what has no derivative, or none that the program knows.
   subroutine check_sensitivity(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: asks = 'sensitivity%parameters'
      integer :: k

      if (.not. case%sensitivity%is_wanted()) return
      do k = 1, size(case%sensitivity%parameters)
         call check_parameter(case, case%sensitivity%parameters(k), asks, error)
         if (analyses(case%analysis)%is_free .and. .not. allocated(error) .and. &
             case%sensitivity%parameters(k) == harmonic_scale) then
            call fatal_error(error, asks//" = '"//trim(parameter_words(harmonic_scale))// &
                             "': no vibratory load acts on a nonlinear mode; leave it out", &
                             status_input)
         else if (case%control%is_wanted() .and. .not. allocated(error) .and. &
                  case%sensitivity%parameters(k) == harmonic_scale) then
            call fatal_error(error, asks//" = '"//trim(parameter_words(harmonic_scale))// &
                             "': the load is what control%amplitude finds; leave it out (its "// &
                             'derivatives are those of load_scale)', status_input)
         end if
         if (.not. allocated(error)) call check_onset(case, case%sensitivity%parameters(k), error)
         if (.not. allocated(error)) call check_mass(case, case%sensitivity%parameters(k), error)
         if (allocated(error)) return
      end do
      call check_quantities(case, error)
      if (allocated(error) .or. case%sensitivity%has_harmonics) return
      ! Last, since the rest may say that there are to be no derivatives. An accuracy would choose
      ! other harmonics from point to point, and with them another function.
      call fatal_error(error, '&harmonics n_harmonics is missing: derivatives (&sensitivity) '// &
                       'are those of a balance of given harmonics', status_input)
   end subroutine check_sensitivity

   !> The modal amplitude is measured by a mass that is to stay.
   subroutine check_mass(case, parameter, error)
      type(case_type), intent(in) :: case
      integer, intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: part(:, :, :, :)

      if (.not. (analyses(case%analysis)%is_free .and. is_of_sectors(parameter))) return
      if (case%mode%control == control_observed) return
      associate (deviation => case%model%cyclic%deviation)
         allocate (part, mold=deviation%part)
         call deviation%change(parameter - blade_frequency + 1, 1, part)
      end associate
      if (any(abs(part(:, :, :, mass_part)) > 0.0_wp)) call fatal_error( &
         error, "sensitivity%parameters = '"//trim(parameter_words(parameter))//"' changes the "// &
         "mass, by which mode%control = 'modal' measures amplitudes: use 'observed'", status_input)
   end subroutine check_mass

   !> Friction begins at mu = 0 and at a load of 0: derivatives there are one-sided.
   subroutine check_onset(case, parameter, error)
      type(case_type), intent(in) :: case
      integer, intent(in) :: parameter
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: values(:)
      logical :: begins(case%contact%n_pairs)

      if (all(parameter /= [friction_coefficient, normal_load])) return
      ! Pairs without friction of their own do not count.
      call get_parameter(case, parameter, values)
      begins = pairs_of(case%contact, friction_coefficient) .and. &
               pairs_of(case%contact, parameter) .and. .not. values > 0.0_wp
      if (any(begins)) call fatal_error(error, "sensitivity%parameters = '"// &
         trim(parameter_words(parameter))//"': it is 0 at a pair, where friction begins and "// &
         'the derivative is one-sided; leave it out, or give a small value', status_input)
   end subroutine check_onset

   !> Work of friction needs pairs, wear its coefficient.
   subroutine check_quantities(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      do k = 1, size(case%sensitivity%quantities)
         associate (quantity => case%sensitivity%quantities(k))
            if (is_of_pairs(quantity) .and. case%contact%n_pairs == 0) then
               call fatal_error(error, "sensitivity%quantities = '"// &
                                trim(quantity_words(quantity))//"' needs contact pairs, and "// &
                                'there are none: leave it out', status_input)
            else if (quantity == largest .and. is_cyclic_mode(case)) then
               call fatal_error(error, "sensitivity%quantities = 'largest' is not served for "// &
                                'nonlinear modes of cyclic structures: leave it out', status_input)
            else if (quantity == wear_volume .and. .not. allocated(case%wear%coefficient)) then
               call fatal_error(error, "sensitivity%quantities = 'wear_volume' needs "// &
                                'wear%coefficient: give it, or leave the quantity out', &
                                status_input)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine check_quantities

end module fw_read_sensitivity
