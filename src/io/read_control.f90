!> Group &control: amplitudes that are given in place of the load.
module fw_read_control
   use fw_control_options, only: control_options, of_first_harmonic
   use fw_key, only: key
   use fw_model, only: model_type
   use fw_reader, only: reader_type
   use fw_reader_text, only: did_you_mean
   use fw_text, only: string_type
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: read_control

contains

   subroutine read_control(reader, model, options)
      type(reader_type), intent(inout) :: reader
      !> Its observed quantities are known, unless something failed before.
      type(model_type), intent(in) :: model
      type(control_options), intent(inout) :: options
      type(string_type), allocatable :: chosen(:)
      logical, allocatable :: is_text(:)
      character(*), parameter :: without = &
         'is given without amplitude: give it, or leave this out'
      integer :: i

      call options%bind_keys(reader)
      call reader%bind_list(key('observed', 'the quantity that has it, by the name that '// &
                                'output%observe gives it', absent='the first one', &
                                only='amplitude'), 'an observed quantity', 1, chosen, is_text)
      if (reader%failed()) return
      if (.not. options%is_wanted()) then
         ! The default of `of` stands in every case that is written out.
         if (options%of /= of_first_harmonic) call reader%refuse('control', 'of', without)
         if (reader%given('control', 'observed')) call reader%refuse('control', 'observed', without)
         return
      end if
      if (size(chosen) == 0 .or. .not. allocated(model%observe_name)) return
      associate (names => model%observe_name, word => chosen(1)%text)
         do i = 1, size(names)
            ! A dof number k is called uk.
            if (names(i)%text /= word .and. names(i)%text /= 'u'//word) cycle
            options%observed = i
            return
         end do
         call reader%refuse('control', 'observed', '= '//quoted_text(word)//': must be an '// &
                            'observed quantity'//did_you_mean(word, names))
      end associate
   end subroutine read_control

end module fw_read_control
