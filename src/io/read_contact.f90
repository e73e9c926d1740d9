!> Contact pairs and nonlinear springs: groups &contact and &spring on top of a model file.
!>
!> The arrays of a file apply only to the pairs of the file: whoever gives another number of pairs
!> gives their dofs too, and starts without the constants of others.
module fw_read_contact
   use fw_contact_data, only: contact_type, memory_residual, spring_type
   use fw_contact_keys, only: bind_pairs, bind_law, bind_sides, bind_friction, bind_gap, &
      bind_growth, bind_normal_load, bind_laws, bind_march, bind_n_springs, bind_springs
   use fw_key_range, only: range_type
   use fw_kinds, only: wp
   use fw_law_text, only: law_text
   use fw_laws, only: law_words, laws_of, is_rigid, pairs_are_hysteretic
   use fw_normal_law, only: curved_pairs
   use fw_read_normal, only: check_normal_laws, match_normal_dofs, read_normal_law
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   use fw_text_list, only: name_sectors
   use fw_values, only: range_text, real_kind
   implicit none (type, external)
   private

   public :: read_contact, read_springs

   integer, parameter :: t1 = 1, t2 = 2, n = 3

contains

   !> Group &contact. Every array but area, position and patch leaves allocated.
   subroutine read_contact(reader, file_pairs, needs_area, n_sectors, contact)
      type(reader_type), intent(inout) :: reader
      !> What the model holds; overridden here.
      type(contact_type), intent(in) :: file_pairs
      !> Whether the analysis is one of wear.
      logical, intent(in) :: needs_area
      !> Sectors whose pairs may differ.
      integer, intent(in) :: n_sectors
      type(contact_type), intent(inout) :: contact
      real(wp) :: scale

      ! The order matters: see fw_contact_keys.
      call read_n_pairs(reader, file_pairs, n_sectors, contact)
      call bind_law(reader, contact)
      call read_normal_law(reader, contact)
      call read_sides(reader, contact)
      if (n_sectors > 1) call repeat_pairs(reader, n_sectors, contact)
      call match_normal_dofs(reader, has_normal(contact), contact)
      call read_constants(reader, needs_area .or. (contact%normal_per_area .and. &
                                                any(curved_pairs(contact))), contact)
      call read_law(reader, contact)
      call bind_march(reader, contact)
      call read_residual(reader, contact)
      scale = contact%penalty_scale
      if (.not. is_rigid(contact) .and. abs(scale - 1.0_wp) > 0.0_wp) then
         call reader%refuse('contact', 'penalty_scale', 'has no meaning with law = '// &
                            trim(law_text(contact))//': '// &
                            'scale the stiffnesses themselves')
      end if
   end subroutine read_contact

   !> Residual tractions in the middle of what balances, unless they are given: values of a file
   !> have passed no range, those of the namelist that of their key.
   subroutine read_residual(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(inout) :: contact
      integer :: i

      if (allocated(contact%residual)) then
         if (reader%given('contact', 'residual')) return
         i = findloc(abs(contact%residual) <= 1.0_wp, .false., dim=1)
         if (i > 0) call reader%refuse('contact', 'residual', '= '// &
                                       to_text(contact%residual(i))//' for pair '//to_text(i)// &
                                       ': must be from -1 to 1')
      else if (contact%memory == memory_residual) then
         allocate (contact%residual(contact%n_pairs), source=0.0_wp)
      end if
   end subroutine read_residual

   !> The number of pairs, and what the file says of them where it is about the same pairs.
   subroutine read_n_pairs(reader, file_pairs, n_sectors, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: file_pairs
      integer, intent(in) :: n_sectors
      type(contact_type), intent(inout) :: contact
      integer :: n_file

      n_file = 0
      if (allocated(file_pairs%side_1)) n_file = size(file_pairs%side_1, 2)
      ! The default of the key is what the file holds.
      contact%n_pairs = n_file
      call bind_pairs(reader, contact)
      if (contact%n_pairs == n_file .and. n_file > 0) then
         ! The law too only with the pairs that it was written for: others take the usual law.
         contact = file_pairs
         contact%n_pairs = n_file
         call repeat_values(n_file, n_sectors, contact%mu)
         call repeat_values(n_file, n_sectors, contact%gap)
         call repeat_values(n_file, n_sectors, contact%area)
         call repeat_values(n_file, n_sectors, contact%normal_load)
         call repeat_values(n_file, n_sectors, contact%gap_rotation)
         call repeat_values(n_file, n_sectors, contact%normal_load_rotation)
         call repeat_values(n_file, n_sectors, contact%slider_1)
         call repeat_values(n_file, n_sectors, contact%slider_2)
         call repeat_values(n_file, n_sectors, contact%residual)
         call contact%constants%offer_all(file_pairs%constants, n_file, n_sectors)
      else if (n_file > 0 .and. contact%n_pairs > 0 &
               .and. .not. reader%given('contact', 'side_1')) then
         call reader%refuse('contact', 'n_pairs', '= '//to_text(contact%n_pairs)// &
                            ': the model holds '//to_text(n_file)//'; give side_1 '// &
                            'and side_2 for other pairs, or 0 for no contact')
      else if (reader%given('contact', 'side_1') &
               .and. .not. reader%given('contact', 'n_pairs')) then
         call reader%refuse('contact', 'n_pairs', 'is missing: must be the number of pairs')
      end if
   end subroutine read_n_pairs

   !> Values of the pairs of a file, of one sector for all or of every sector.
   pure subroutine repeat_values(n_pairs, n_sectors, values)
      integer, intent(in) :: n_pairs, n_sectors
      real(wp), allocatable, intent(inout) :: values(:)
      integer :: j

      if (.not. allocated(values)) return
      if (size(values) == n_pairs) values = [(values, j=1, n_sectors)]
   end subroutine repeat_values

   !> From the pairs of a sector to those of all, sector after sector.
   subroutine repeat_pairs(reader, n_sectors, contact)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: n_sectors
      type(contact_type), intent(inout) :: contact
      !> More than any joint has that is solved for.
      integer, parameter :: most = 1000000
      real(wp), allocatable :: position(:, :)
      integer :: j, n

      n = contact%n_pairs
      if (n > most/n_sectors) then
         call reader%refuse('cyclic', 'mistuned', '= .true.: '//to_text(n)//' pairs in each of '// &
                            to_text(n_sectors)//' sectors are too many: must be at most '// &
                            to_text(most)//' in all')
         return
      end if
      contact%n_alike = n_sectors
      if (allocated(contact%law_of)) contact%law_of = [(contact%law_of, j=1, n_sectors)]
      if (allocated(contact%normal_law)) contact%normal_law = [(contact%normal_law, j=1, n_sectors)]
      contact%n_pairs = n*n_sectors
      contact%side_1 = reshape([(contact%side_1, j=1, n_sectors)], [3, contact%n_pairs])
      contact%side_2 = reshape([(contact%side_2, j=1, n_sectors)], [3, contact%n_pairs])
      contact%sector_2 = [(contact%sector_2, j=1, n_sectors)]
      if (allocated(contact%position)) then
         ! Of the sector itself: where the others stand is not known here.
         position = contact%position
         contact%position = reshape([(position, j=1, n_sectors)], [3, contact%n_pairs])
      end if
      if (allocated(contact%patch)) call name_sectors(n_sectors, contact%patch)
      call reader%set_size('n_pairs', contact%n_pairs)
      call reader%set_tile('n_pairs', n)
   end subroutine repeat_pairs

   !> The dofs of both sides.
   subroutine read_sides(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(inout) :: contact
      logical :: needed

      needed = .not. (allocated(contact%side_1) .or. reader%failed()) .and. contact%n_pairs > 0
      ! Dofs of 0 until they are read: with a failure the checks below are not reached.
      if (.not. allocated(contact%side_1)) allocate (contact%side_1(3, contact%n_pairs), source=0)
      call bind_sides(reader, contact, needed)
      if (.not. reader%failed()) call check_sides(reader, contact)
   end subroutine read_sides

   !> Every pair must join something to something else.
   subroutine check_sides(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      integer :: i, k

      do i = 1, contact%n_pairs
         associate (a => abs(contact%side_1(:, i)), b => abs(contact%side_2(:, i)))
            if (all(a == 0) .and. all(b == 0)) then
               call refuse_pair(reader, i, 'has no dof on either side: at least one must not be 0')
            end if
            ! A dof against itself would be a force of the pair on itself.
            do k = t1, n
               ! Of another sector it is another dof.
               if (a(k) == b(k) .and. a(k) > 0 .and. contact%sector_2(i) == 0) then
                  call refuse_pair(reader, i, 'has dof '//to_text(a(k))//' on both sides: '// &
                                   'they must differ')
               end if
               if (is_repeated(a, k) .or. is_repeated(b, k)) then
                  call refuse_pair(reader, i, 'has one dof for two of its directions: t1, t2 '// &
                                   'and n must differ on each side')
                  exit
               end if
            end do
         end associate
      end do
   end subroutine check_sides

   !> A dof may stand for one direction only: t1, t2 and n are independent.
   pure logical function is_repeated(dofs, k)
      integer, intent(in) :: dofs(3), k

      is_repeated = dofs(k) > 0 .and. count(dofs == dofs(k)) > 1
   end function is_repeated

   !> Refuse both sides of a pair, by its number from 1.
   subroutine refuse_pair(reader, i, message)
      type(reader_type), intent(inout) :: reader
      integer, intent(in) :: i
      character(*), intent(in) :: message

      call reader%refuse('contact', 'side_1', 'and side_2: pair '//to_text(i)//' '//message)
   end subroutine refuse_pair

   !> Friction, gap, area and constant load.
   subroutine read_constants(reader, needs_area, contact)
      type(reader_type), intent(inout) :: reader
      logical, intent(in) :: needs_area
      type(contact_type), intent(inout) :: contact
      logical :: slides(contact%n_pairs), closes(contact%n_pairs)
      integer :: n_pairs

      n_pairs = contact%n_pairs
      slides = has_tangent(contact)
      closes = has_normal(contact)
      call bind_friction(reader, contact, any(slides) .and. .not. allocated(contact%mu))
      if (.not. allocated(contact%mu)) allocate (contact%mu(n_pairs), source=0.0_wp)
      call bind_gap(reader, contact, needs_area .and. n_pairs > 0 &
                    .and. .not. allocated(contact%area))
      call bind_normal_load(reader, contact, &
                            any(slides .and. .not. closes .and. contact%mu > 0.0_wp) .and. &
                            .not. allocated(contact%normal_load))
      if (.not. allocated(contact%normal_load)) then
         allocate (contact%normal_load(n_pairs), source=0.0_wp)
      else if (all(closes) .and. any(contact%normal_load > 0.0_wp)) then
         call reader%refuse('contact', 'normal_load', 'has no meaning: every pair has a normal '// &
                            'dof; press the pairs together with &load static or a negative gap')
      end if
      call bind_growth(reader, contact)
      ! One value for all may have been meant for the others.
      where (closes) contact%normal_load = 0.0_wp
      if (allocated(contact%normal_load_rotation)) then
         where (closes) contact%normal_load_rotation = 0.0_wp
      end if
   end subroutine read_constants

   !> Constants that belong to some laws, and to no others.
   subroutine read_law(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(inout) :: contact
      character(24) :: name
      integer :: other

      call bind_laws(reader, contact, has_tangent(contact), &
                     has_normal(contact) .and. .not. curved_pairs(contact))
      call contact%constants%first_of_others(laws_of(contact), name, other)
      if (other > 0) then
         call reader%refuse('contact', trim(name), "belongs to law = '"//trim(law_words(other))// &
                            "', but law = "//trim(law_text(contact))// &
                            ': remove it or change the law')
      end if
      if (.not. contact%constants%has('mu_dynamic')) then
         if (contact%constants%has('weakening_speed')) call reader%refuse('contact', &
            'weakening_speed', 'has no meaning without mu_dynamic: give the friction of fast '// &
            'sliding')
         if (contact%constants%has('weakening_exponent')) call reader%refuse('contact', &
            'weakening_exponent', 'has no meaning without mu_dynamic: give the friction of '// &
            'fast sliding')
      end if
      ! Components of their own beside the constants: results and restarts hold them.
      contact%tangential_stiffness = contact%constants%get('tangential_stiffness', contact%n_pairs)
      contact%normal_stiffness = contact%constants%get('normal_stiffness', contact%n_pairs)
      if (reader%failed()) return
      if (allocated(contact%law_of)) call check_values(reader, contact)
      if (reader%failed()) return
      call check_normal_laws(reader, contact)
      if (contact%constants%has('normal_stiffness')) call check_normal_zeros(reader, contact)
      if (contact%constants%has('tangential_stiffness')) call check_zeros(reader, contact)
      call check_hysteresis(reader, contact)
   end subroutine read_law

   !> Laws of hysteresis have one direction, and what presses is a constant.
   subroutine check_hysteresis(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      logical, dimension(contact%n_pairs) :: are, normal
      integer :: i

      are = pairs_are_hysteretic(contact)
      normal = has_normal(contact)
      do i = 1, contact%n_pairs
         if (.not. are(i)) cycle
         associate (a => contact%side_1(:, i), b => contact%side_2(:, i))
            if (normal(i) .or. a(t2) /= 0 .or. b(t2) /= 0) then
               call refuse_pair(reader, i, "has a law ('iwan', 'bouc_wen') of one tangential "// &
                                'direction (t1) under a constant normal_load: t2 and n must be '// &
                                "0; for others use parallel 'penalty' pairs "// &
                                '(fretwear.laws.iwan_pairs)')
               return
            end if
         end associate
         if (.not. contact%tangential_stiffness(i) > 0.0_wp) then
            call reader%refuse('contact', 'tangential_stiffness', '= '// &
                               to_text(contact%tangential_stiffness(i))//' for pair '// &
                               to_text(i)//": must be above 0 with law = 'iwan' or 'bouc_wen'")
            return
         end if
      end do
   end subroutine check_hysteresis

   !> Values count where the law of the pair takes them.
   subroutine check_values(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      type(range_type) :: range
      character(24) :: name
      real(wp) :: value
      integer :: i

      call contact%constants%first_wrong(contact%law_of, name, i, value, range)
      if (i > 0) call reader%refuse('contact', trim(name), '= '//to_text(value)//' for pair '// &
                                    to_text(i)//": must be "//range_text(real_kind, range))
   end subroutine check_values

   !> Which pairs have a law that takes a constant.
   pure function take(contact, name) result(takes)
      type(contact_type), intent(in) :: contact
      character(*), intent(in) :: name
      logical :: takes(contact%n_pairs)
      integer :: i

      takes = .true.
      if (.not. allocated(contact%law_of)) return
      takes = [(contact%constants%is_taken(contact%law_of(i), name), i=1, contact%n_pairs)]
   end function take

   !> A stiffness of 0 is none.
   subroutine check_normal_zeros(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      integer :: i

      i = findloc(has_normal(contact) .and. .not. curved_pairs(contact) .and. &
                  take(contact, 'normal_stiffness') .and. &
                  contact%normal_stiffness <= 0.0_wp, .true., 1)
      if (i > 0) call reader%refuse('contact', 'normal_stiffness', '= 0 for pair '// &
                                    to_text(i)//': must be above 0 where there is a normal dof')
   end subroutine check_normal_zeros

   !> Without a tangential stiffness the pair has no such dof, or is one of several sliders between
   !> the same dofs of which others have one.
   subroutine check_zeros(reader, contact)
      type(reader_type), intent(inout) :: reader
      type(contact_type), intent(in) :: contact
      logical :: slides(contact%n_pairs)
      integer :: i

      slides = has_tangent(contact) .and. take(contact, 'tangential_stiffness')
      do i = 1, contact%n_pairs
         if (contact%tangential_stiffness(i) > 0.0_wp .or. .not. slides(i)) cycle
         if (any(contact%tangential_stiffness > 0.0_wp .and. is_parallel(contact, i) .and. &
                 take(contact, 'tangential_stiffness'))) cycle
         call reader%refuse('contact', 'tangential_stiffness', '= 0 for pair '//to_text(i)// &
                            ': must be above 0, unless the pair has no tangential dof, or '// &
                            'another pair of the same tangential dofs has a stiffness')
         return
      end do
   end subroutine check_zeros

   !> Which pairs join the same tangential dofs as pair i, in either direction.
   pure function is_parallel(contact, i) result(is)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: i
      logical :: is(contact%n_pairs)
      integer :: k, n_sector

      n_sector = contact%n_pairs/contact%n_alike
      associate (a => contact%side_1(t1:t2, :), b => contact%side_2(t1:t2, :))
         do k = 1, contact%n_pairs
            ! Turned round, the pair is the same.
            if (contact%sector_2(k) /= contact%sector_2(i) .or. &
                (k - 1)/n_sector /= (i - 1)/n_sector) then
               is(k) = .false.
               cycle
            end if
            is(k) = (all(a(:, k) == a(:, i)) .and. all(b(:, k) == b(:, i))) .or. &
                    (all(a(:, k) == b(:, i)) .and. all(b(:, k) == a(:, i)))
         end do
      end associate
   end function is_parallel

   !> Which pairs have a tangential dof on either side.
   pure function has_tangent(contact) result(has)
      type(contact_type), intent(in) :: contact
      logical :: has(contact%n_pairs)

      has = any(contact%side_1(t1:t2, :) /= 0 .or. contact%side_2(t1:t2, :) /= 0, 1)
   end function has_tangent

   !> Which pairs have a normal dof on either side.
   pure function has_normal(contact) result(has)
      type(contact_type), intent(in) :: contact
      logical :: has(contact%n_pairs)

      has = contact%side_1(n, :) /= 0 .or. contact%side_2(n, :) /= 0
   end function has_normal

   !> Group &spring, on top of the springs of the model as &contact is on top of its pairs.
   subroutine read_springs(reader, file_springs, n_sectors, springs)
      type(reader_type), intent(inout) :: reader
      !> What the model holds; overridden here.
      type(spring_type), intent(in) :: file_springs
      !> Sectors whose motion is solved for.
      integer, intent(in) :: n_sectors
      type(spring_type), intent(inout) :: springs
      integer :: m, i, j

      ! The default of the key is what the model holds.
      springs%n_springs = file_springs%n_springs
      call bind_n_springs(reader, springs)
      associate (n_file => file_springs%n_springs)
         if (springs%n_springs == n_file .and. n_file > 0) then
            ! The same springs: what the case gives replaces one array after the other.
            springs = file_springs
         else if (n_file > 0 .and. springs%n_springs > 0 .and. &
                  .not. reader%given('spring', 'side_1')) then
            call reader%refuse('spring', 'n_springs', '= '//to_text(springs%n_springs)// &
                               ': the model holds '//to_text(n_file)//'; give side_1 and '// &
                               'coefficient for other springs, or 0 for none')
         else if (reader%given('spring', 'coefficient') .and. &
                  .not. reader%given('spring', 'n_springs')) then
            call reader%refuse('spring', 'n_springs', 'is missing: must be the number of springs')
         end if
      end associate
      call bind_springs(reader, springs)
      ! What was needed and not given is a problem already; the arrays only have to exist.
      m = springs%n_springs
      if (.not. allocated(springs%side_1)) allocate (springs%side_1(m), source=0)
      if (.not. allocated(springs%coefficient)) allocate (springs%coefficient(m), source=0.0_wp)
      if (reader%failed()) return
      do i = 1, m
         if (abs(springs%side_1(i)) /= abs(springs%side_2(i))) cycle
         if (springs%sector_2(i) /= 0) cycle
         call reader%refuse('spring', 'side_1', 'and side_2: spring '//to_text(i)//' has dof '// &
                            to_text(springs%side_1(i))//' on both sides: they must differ')
      end do
      if (n_sectors == 1 .or. m == 0) return
      springs%n_springs = m*n_sectors
      springs%side_1 = [(springs%side_1, j=1, n_sectors)]
      springs%side_2 = [(springs%side_2, j=1, n_sectors)]
      springs%sector_2 = [(springs%sector_2, j=1, n_sectors)]
      springs%coefficient = [(springs%coefficient, j=1, n_sectors)]
      springs%power = [(springs%power, j=1, n_sectors)]
   end subroutine read_springs

end module fw_read_contact
