!> Obstacles that move: what a model and the keys gap_... of group &contact add to the gaps in
!> harmonics, and how friction follows a side 2 that slides.
module fw_read_obstacle
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use fw_contact_data, only: contact_type, sliding_path, sliding_steady, sliding_words
   use fw_cyclic_data, only: cyclic_type
   use fw_gap_terms, only: gap_terms
   use fw_key, only: key
   use fw_kinds, only: wp
   use fw_laws, only: is_of_high_order, law_words
   use fw_raw_model, only: raw_model
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_obstacle, check_gap_orders

   !> What each term has.
   character(*), parameter :: term_keys(*) = &
      [character(13) :: 'gap_pair', 'gap_harmonic', 'gap_order', 'gap_amplitude', 'gap_phase']

   !> Constants by which friction follows the speed.
   character(*), parameter :: of_speed(*) = [character(10) :: 'mu_dynamic', 'mu_viscous']

contains

   !> Within group &contact, after its pairs and their constants.
   subroutine read_obstacle(reader, cyclic, contact, fundamental)
      type(reader_type), intent(inout) :: reader
      type(cyclic_type), intent(in) :: cyclic
      type(contact_type), intent(inout) :: contact
      !> Greatest common divisor of the orders; 0 where there are none.
      integer, intent(out) :: fundamental
      type(gap_terms) :: terms
      integer :: i, n_pairs

      fundamental = 0
      ! Without their number the terms would be left out.
      if (.not. reader%given('contact', 'n_gap_terms')) then
         do i = 1, size(term_keys)
            if (.not. reader%given('contact', trim(term_keys(i)))) cycle
            call reader%refuse('contact', 'n_gap_terms', 'is missing: must be the number of terms')
            exit
         end do
      end if
      call terms%bind_keys(reader)
      call keys_of_sliding(reader, contact)
      if (reader%given('contact', 'gap_order') .and. reader%given('contact', 'gap_harmonic')) then
         call reader%refuse('contact', 'gap_order', 'is given beside gap_harmonic: must be one '// &
                            'of both')
      end if
      if (reader%failed()) return
      call terms%take_orders()
      fundamental = terms%fundamental
      n_pairs = contact%n_pairs/max(contact%n_alike, 1)
      call check_model(reader, n_pairs, contact)
      if (.not. reader%failed()) call check_terms(reader, terms, n_pairs, contact)
      if (.not. reader%failed()) call check_sliding(reader, contact)
      if (reader%failed()) return
      call add_gaps(terms, cyclic, n_pairs, contact)
   end subroutine read_obstacle

   !> How fast side 2 slides, and whether its friction follows the path or has one direction.
   subroutine keys_of_sliding(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(inout) :: contact

      call reader%bind_word(key('sliding', &
                                'friction along the path of speed and vibration, or against '// &
                                'the speed alone'), contact%sliding, sliding_words)
   end subroutine keys_of_sliding

   !> What a model holds of the gaps in harmonics.
   subroutine check_model(reader, n_pairs, contact)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_pairs
      type(contact_type), intent(inout) :: contact
      integer :: j, m

      if (.not. allocated(contact%gap_harmonic)) then
         if (allocated(contact%gap_cosine) .or. allocated(contact%gap_sine)) then
            call reader%refuse_model('contact/gap_cosine or gap_sine, which needs '// &
                                     'contact/gap_harmonic, the harmonics of its rows')
         end if
         return
      end if
      m = size(contact%gap_harmonic)
      if (any(contact%gap_harmonic < 0)) then
         call reader%refuse_model('contact/gap_harmonic with '// &
                                  to_text(minval(contact%gap_harmonic))//': must be 0, 1, ..')
         return
      end if
      do j = 1, m
         if (count(contact%gap_harmonic == contact%gap_harmonic(j)) == 1) cycle
         call reader%refuse_model('contact/gap_harmonic with '// &
                                  to_text(contact%gap_harmonic(j))//' twice: must differ')
         return
      end do
      if (.not. (allocated(contact%gap_cosine) .or. allocated(contact%gap_sine))) then
         call reader%refuse_model('contact/gap_harmonic, which needs contact/gap_cosine or '// &
                                  'gap_sine')
         return
      end if
      call check_rows('gap_cosine', contact%gap_cosine)
      call check_rows('gap_sine', contact%gap_sine)

   contains

      subroutine check_rows(name, rows)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(inout) :: rows(:, :)

         if (.not. allocated(rows)) allocate (rows(n_pairs, m), source=0.0_wp)
         if (size(rows, 1) /= n_pairs .or. size(rows, 2) /= m) then
            call reader%refuse_model('contact/'//name//' of '//to_text(size(rows, 2))//' by '// &
                                     to_text(size(rows, 1))//': must be '//to_text(m)// &
                                     ' harmonics by '//to_text(n_pairs)//' pairs')
         else if (.not. all(ieee_is_finite(rows))) then
            call reader%refuse_model('contact/'//name//' with a value that is not finite')
         end if
      end subroutine check_rows

   end subroutine check_model

   !> Pairs of the terms exist, and have a gap.
   subroutine check_terms(reader, terms, n_pairs, contact)
      type(reader_type), intent(inout) :: reader
      type(gap_terms), intent(in) :: terms
      integer, intent(in) :: n_pairs
      type(contact_type), intent(in) :: contact
      logical :: has_normal(contact%n_pairs)
      integer :: i

      has_normal = has_gap(contact)
      do i = 1, terms%n_terms
         associate (pair => terms%pair(i))
            if (pair > n_pairs) then
               call reader%refuse('contact', 'gap_pair', 'of term '//to_text(i)//' is '// &
                                  to_text(pair)//': must be 0, for all, to '//to_text(n_pairs))
               return
            end if
            if (pair > 0) then
               if (has_normal(pair)) cycle
               call reader%refuse('contact', 'gap_pair', 'of term '//to_text(i)//' is '// &
                                  to_text(pair)//', a pair without a normal dof, which has no '// &
                                  'gap: give it one in side_1 or side_2')
               return
            end if
         end associate
         if (any(has_normal)) cycle
         call reader%refuse('contact', 'n_gap_terms', '= '//to_text(terms%n_terms)//': no pair '// &
                            'has a normal dof, and with it a gap: leave them out')
         return
      end do
   end subroutine check_terms

   !> Without a speed there is no direction to slide in.
   subroutine check_sliding(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact

      real(wp) :: speed(contact%n_pairs, 2)
      integer :: c, i, law

      if (contact%n_pairs == 0) return
      speed = contact%speeds()
      call check_laws(reader, contact, speed)
      if (reader%failed()) return
      do i = 1, contact%n_pairs
         if (all(abs(speed(i, :)) <= 0.0_wp)) cycle
         law = contact%law
         if (allocated(contact%law_of)) law = contact%law_of(i)
         ! On the path smooth friction shares itself out between both directions.
         if (contact%sliding == sliding_path .and. &
             contact%constants%is_taken(law, 'slip_speed')) cycle
         do c = 1, 2
            if (contact%side_1(c, i) /= 0 .or. contact%side_2(c, i) /= 0) cycle
            if (.not. abs(speed(i, c)) > 0.0_wp) cycle
            call reader%refuse('contact', 'speed_'//to_text(c), '= '//to_text(speed(i, c))// &
                               ' for pair '//to_text(i)//', which has no dof of t'// &
                               to_text(c)//': must be 0')
            return
         end do
         if (contact%sliding == sliding_steady .or. .not. is_of_high_order(law)) cycle
         call reader%refuse('contact', 'sliding', "= 'path' with law = '"// &
                            trim(law_words(law))//"' and a speed of pair "//to_text(i)// &
                            ", whose anchor that law does not carry along: use sliding = "// &
                            "'steady', or law = 'dlft'")
         return
      end do
      if (contact%sliding == sliding_path) return
      if (any(abs(speed) > 0.0_wp)) return
      call reader%refuse('contact', 'sliding', "= '"//trim(sliding_words(sliding_steady))// &
                         "' needs a direction: give speed_1 or speed_2")
   end subroutine check_sliding

   !> A speed for all pairs may be meant for those whose law has one: others would be at rest
   !> without a word. So would what friction of a law does with its speed, where it has none.
   subroutine check_laws(reader, contact, speed)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      real(wp), intent(in) :: speed(:, :)
      integer :: i, k, law

      do i = 1, contact%n_pairs
         if (all(abs(speed(i, :)) <= 0.0_wp)) cycle
         law = contact%law
         if (allocated(contact%law_of)) law = contact%law_of(i)
         if (.not. contact%constants%is_taken(law, 'speed_1')) then
            k = maxloc(abs(speed(i, :)), dim=1)
            call reader%refuse('contact', 'speed_'//to_text(k), '= '//to_text(speed(i, k))// &
                               ' for pair '//to_text(i)//" with law = '"//trim(law_words(law))// &
                               "', which knows no side that slides: must be 0 there")
            return
         end if
         if (contact%sliding == sliding_path) cycle
         do k = 1, size(of_speed)
            if (.not. contact%constants%is_taken(law, trim(of_speed(k)))) cycle
            if (.not. contact%constants%has(trim(of_speed(k)))) cycle
            call reader%refuse('contact', trim(of_speed(k)), "beside sliding = 'steady', whose "// &
                               'friction is mu p whatever the speed: give mu at that speed, or '// &
                               "use sliding = 'path'")
            return
         end do
      end do
   end subroutine check_laws

   !> Pairs whose distance is a displacement.
   pure function has_gap(contact)
      type(contact_type), intent(in) :: contact
      logical :: has_gap(contact%n_pairs)

      has_gap = contact%side_1(3, :) /= 0 .or. contact%side_2(3, :) /= 0
   end function has_gap

   !> The terms on top of what the model holds, and of many sectors a wave: sector s has the gap of
   !> the first one, later by s engine_order/n_sectors of a period.
   subroutine add_gaps(terms, cyclic, n_pairs, contact)
      type(gap_terms), intent(in) :: terms
      type(cyclic_type), intent(in) :: cyclic
      integer, intent(in) :: n_pairs
      type(contact_type), intent(inout) :: contact
      type(contact_type) :: sector
      complex(wp), allocatable :: amplitude(:)
      logical :: has_normal(contact%n_pairs)
      integer :: h, j, s

      has_normal = has_gap(contact)
      sector%n_pairs = n_pairs
      allocate (sector%gap(n_pairs), source=0.0_wp)
      if (allocated(contact%gap_harmonic)) then
         do h = 1, size(contact%gap_harmonic)
            call sector%add_gap(contact%gap_harmonic(h), &
                                merge(contact%gap_cosine(:, h), 0.0_wp, has_normal(:n_pairs)), &
                                merge(contact%gap_sine(:, h), 0.0_wp, has_normal(:n_pairs)))
         end do
         deallocate (contact%gap_harmonic, contact%gap_cosine, contact%gap_sine)
      end if
      call terms%add_to(has_normal(:n_pairs), sector)
      if (any(abs(sector%gap) > 0.0_wp)) contact%gap = contact%gap + &
         [(sector%gap, j=1, contact%n_alike)]
      if (.not. allocated(sector%gap_harmonic)) return
      do h = 1, size(sector%gap_harmonic)
         amplitude = cmplx(sector%gap_cosine(:, h), -sector%gap_sine(:, h), wp)
         associate (k => cyclic%nodal_diameter(sector%gap_harmonic(h)))
            ! Each sector lags behind the one before it.
            amplitude = [amplitude, (cyclic%factor(k, s)*amplitude(:n_pairs), &
                                     s=1, contact%n_alike - 1)]
         end associate
         call contact%add_gap(sector%gap_harmonic(h), real(amplitude, wp), -aimag(amplitude))
      end do
   end subroutine add_gaps

   !> What says the frequency in other ways than the orders of the gaps has to agree with them.
   subroutine check_gap_orders(reader, fundamental, of_terms, raw, cyclic)
      type(reader_type), intent(inout) :: reader
      !> Greatest common divisors of the orders of the gaps, and of term_order (0: none).
      integer, intent(in) :: fundamental, of_terms
      type(raw_model), intent(in) :: raw
      type(cyclic_type), intent(in) :: cyclic
      logical :: has_loads

      if (fundamental == 0) return
      has_loads = .false.
      if (allocated(raw%load_cosine)) has_loads = any(abs(raw%load_cosine) > 0.0_wp)
      if (allocated(raw%load_sine)) has_loads = has_loads .or. any(abs(raw%load_sine) > 0.0_wp)
      if (allocated(raw%load_harmonic)) has_loads = has_loads .or. any(raw%load_harmonic > 0)
      associate (g => fundamental, n => cyclic%n_sectors)
         if (of_terms > 0 .and. of_terms /= g) then
            call reader%refuse('contact', 'gap_order', 'has orders that are multiples of '// &
                               to_text(g)//', beside multiples of '//to_text(of_terms)// &
                               ' in load%term_order: must have one greatest common divisor, or '// &
                               'use gap_harmonic and term_harmonic')
         else if (of_terms == 0 .and. has_loads .and. g /= 1) then
            call reader%refuse('contact', 'gap_order', 'has orders that are multiples of '// &
                               to_text(g)//', beside loads of order 1: must have 1 as their '// &
                               'greatest common divisor, or use gap_harmonic')
         else if (cyclic%is_cyclic .and. modulo(cyclic%engine_order - g, n) /= 0 .and. &
                  modulo(cyclic%engine_order + g, n) /= 0) then
            call reader%refuse('cyclic', 'engine_order', '= '//to_text(cyclic%engine_order)// &
                               ': the orders of contact%gap_order are multiples of '// &
                               to_text(g)//', which is that of the frequency of the sweep: '// &
                               'must be '//to_text(g)//' or '//to_text(-g)// &
                               ', or use gap_harmonic')
         end if
      end associate
   end subroutine check_gap_orders

end module fw_read_obstacle
