!> Loads of any harmonic of a case: what a model holds of them, and the terms of group &load.
module fw_read_waves
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_cyclic_data, only: cyclic_type
   use fw_kinds, only: wp
   use fw_load_terms, only: add_wave, load_terms
   use fw_load_waves, only: load_waves
   use fw_raw_model, only: raw_model
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_terms, gather_waves

   !> What each term has.
   character(*), parameter :: term_keys(*) = &
      [character(14) :: 'term_dof', 'term_harmonic', 'term_order', 'term_amplitude', &
       'term_phase', 'term_power']

contains

   !> The keys term_...
   subroutine read_terms(reader, terms)
      type(reader_type), intent(inout) :: reader
      type(load_terms), intent(inout) :: terms
      logical :: by_order
      integer :: i

      ! Without their number the terms would be left out.
      if (.not. reader%given('load', 'n_terms')) then
         do i = 1, size(term_keys)
            if (.not. reader%given('load', trim(term_keys(i)))) cycle
            call reader%refuse('load', 'n_terms', 'is missing: must be the number of terms')
            exit
         end do
      end if
      by_order = reader%given('load', 'term_order')
      call terms%bind_keys(reader, by_order)
      if (by_order .and. reader%given('load', 'term_harmonic')) then
         call reader%refuse('load', 'term_order', 'is given beside term_harmonic: must be one '// &
                            'of both')
      end if
      if (reader%failed()) return
      call terms%take_orders()
      do i = 1, terms%n_terms
         if (terms%dof(i) == 0) then
            call reader%refuse('load', 'term_dof', 'of term '//to_text(i)//' is 0, the ground: '// &
                               'must be a dof')
         else if (terms%harmonic(i) == 0 .and. terms%power(i) > 0) then
            call reader%refuse('load', 'term_power', 'of term '//to_text(i)//' is '// &
                               to_text(terms%power(i))//', but harmonic 0 has no frequency: '// &
                               'must be 0')
         else
            cycle
         end if
         return
      end do
   end subroutine read_terms

   !> All loads of harmonics, not scaled, and what acts in harmonic 0. The same harmonic may come
   !> more than once, and adds up; a power of the frequency makes a wave of its own.
   subroutine gather_waves(reader, raw, terms, cyclic, n_dof, waves, columns, static)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(in) :: raw
      type(load_terms), intent(in) :: terms
      type(cyclic_type), intent(in) :: cyclic
      integer, intent(in) :: n_dof
      type(load_waves), intent(inout) :: waves
      !> Cosine and sine parts of the waves, one behind the other (n_dof, 2 n_waves) [force].
      real(wp), allocatable, intent(inout) :: columns(:, :)
      !> (n_dof).
      real(wp), intent(out) :: static(:)
      integer :: j, w

      static = 0.0_wp
      call check_finite('harmonic_cosine', raw%harmonic_cosine)
      call check_finite('harmonic_sine', raw%harmonic_sine)
      if (reader%failed()) return
      if (allocated(raw%load_harmonic)) then
         do j = 1, size(raw%load_harmonic)
            if (raw%load_harmonic(j) == 0) then
               if (allocated(raw%harmonic_cosine)) static = static + raw%harmonic_cosine(:, j)
               cycle
            end if
            w = waves%place(raw%load_harmonic(j), 0)
            if (w == 0) then
               call add_wave(raw%load_harmonic(j), 0, n_dof, waves, columns)
               w = waves%n_waves()
            end if
            if (allocated(raw%harmonic_cosine)) columns(:, 2*w - 1) = columns(:, 2*w - 1) + &
               raw%harmonic_cosine(:, j)
            if (allocated(raw%harmonic_sine)) columns(:, 2*w) = columns(:, 2*w) + &
               raw%harmonic_sine(:, j)
         end do
      end if
      ! On top of what the model holds.
      call terms%add_to(static, waves, columns, raw%rows)
      if (terms%fundamental > 0) call check_orders(reader, raw, terms, cyclic)

   contains

      subroutine check_finite(name, loads)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(in) :: loads(:, :)

         if (.not. allocated(loads)) return
         if (all(ieee_is_finite(loads))) return
         call reader%refuse_model('a load '//name//' with a value that is not finite')
      end subroutine check_finite

   end subroutine gather_waves

   !> What says the frequency in other ways than the orders has to agree with them: a load of the
   !> first harmonic is of order 1, and a wave around sectors has the order of the sweep.
   subroutine check_orders(reader, raw, terms, cyclic)
      type(reader_type), intent(inout) :: reader
      type(raw_model), intent(in) :: raw
      type(load_terms), intent(in) :: terms
      type(cyclic_type), intent(in) :: cyclic
      logical :: has_first, has_others

      has_others = .false.
      if (allocated(raw%load_harmonic)) has_others = any(raw%load_harmonic > 0)
      ! In a file or in the namelist.
      has_first = .false.
      if (allocated(raw%load_cosine)) has_first = any(abs(raw%load_cosine) > 0.0_wp)
      if (allocated(raw%load_sine)) has_first = has_first .or. any(abs(raw%load_sine) > 0.0_wp)
      associate (g => terms%fundamental, n => cyclic%n_sectors)
         if (has_first .and. g /= 1) then
            call reader%refuse('load', 'term_order', 'has orders that are multiples of '// &
                               to_text(g)//', beside cosine or sine of order 1: must have 1 as '// &
                               'their greatest common divisor, or give all loads as terms')
         else if (has_others .and. g /= 1) then
            call reader%refuse('load', 'term_order', 'has orders that are multiples of '// &
                               to_text(g)//', beside loads of harmonics in the model: must '// &
                               'have 1 as their greatest common divisor, or use term_harmonic')
         else if (cyclic%is_cyclic .and. modulo(cyclic%engine_order - g, n) /= 0 .and. &
                  modulo(cyclic%engine_order + g, n) /= 0) then
            call reader%refuse('cyclic', 'engine_order', '= '//to_text(cyclic%engine_order)// &
                               ': the orders of term_order are multiples of '//to_text(g)// &
                               ', which is that of the frequency of the sweep: must be '// &
                               to_text(g)//' or '//to_text(-g)//', or use term_harmonic')
         end if
      end associate
   end subroutine check_orders

end module fw_read_waves
