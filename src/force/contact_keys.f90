!> The keys of groups &contact and &spring.
!>
!> One procedure for each group of keys that is read at the same place, because some keys need
!> others first: sizes before arrays, the law before its constants, sides before what goes with
!> their dofs. A value that a model file gave is in the components already, and stays where the
!> namelist has none.
module fw_contact_keys
   use fw_contact_data, only: contact_type, spring_type, memory_words
   use fw_key, only: key, key_type, key_visitor
   use fw_key_range, only: above, at_least, side_numbers, from_to
   use fw_kinds, only: wp
   use fw_laws, only: law_help, law_words, laws_of, new_law, pairs_of_law
   use fw_normal_law, only: normal_words, table, unilateral
   use fw_pair_law, only: pair_law
   implicit none (type, external)
   private

   public :: ask_laws, bind_pairs, bind_law, bind_normal_law, bind_table, bind_sides, &
             bind_friction, bind_gap, bind_growth, bind_normal_load, bind_laws, bind_march, &
             bind_worn, bind_n_springs, bind_springs

   !> More pairs or springs are taken for a mistake.
   integer, parameter :: most = 1000000

   character(*), parameter :: of_file = 'of the file'

contains

   !> The number of pairs, which becomes the size 'n_pairs' of all arrays of the group.
   subroutine bind_pairs(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact

      call keys%open('contact', 'contact pairs, friction, gap, contact law')
      call keys%bind(key('n_pairs', '0 switches the contact of a file off', from_to(0, most), &
                         absent=of_file), contact%n_pairs)
      call keys%set_size('n_pairs', contact%n_pairs)
   end subroutine bind_pairs

   !> The law of all pairs, or one for each, by words of fw_laws.
   subroutine bind_law(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      integer, allocatable :: numbers(:)

      numbers = [contact%law]
      if (allocated(contact%law_of)) numbers = contact%law_of
      ! Without a word usual_law (fw_laws) takes one.
      call keys%bind_words(key('law', law_help, shape='n_pairs', &
                               absent="'rigid' where it goes"), numbers, law_words)
      if (size(numbers) == 0) return
      contact%law = numbers(1)
      if (allocated(contact%law_of)) deallocate (contact%law_of)
      if (any(numbers /= numbers(1))) contact%law_of = numbers
   end subroutine bind_law

   !> How all pairs press, or each, by words of fw_normal_law.
   subroutine bind_normal_law(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      integer, allocatable :: numbers(:)

      numbers = [unilateral]
      if (allocated(contact%normal_law)) numbers = contact%normal_law
      if (size(numbers) == 0) numbers = [unilateral]
      call keys%bind_words(key('normal_law', &
                               'a spring, normal_coefficient d**normal_exponent, '// &
                               'reference_force exp(d/decay_length), a table', shape='n_pairs', &
                               only="law = 'penalty', 'regularised'"), numbers, normal_words)
      if (allocated(contact%normal_law)) deallocate (contact%normal_law)
      if (all(numbers == unilateral)) return
      if (size(numbers) /= contact%n_pairs) numbers = spread(numbers(1), 1, contact%n_pairs)
      contact%normal_law = numbers
   end subroutine bind_normal_law

   !> The table of those that have one, and whether what they take is of an area.
   subroutine bind_table(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      character(*), parameter :: with_table = "normal_law = 'table'"
      logical :: needed

      call keys%bind(key('n_table', 'points of the table', from_to(0, most), absent=of_file, &
                         only=with_table), contact%n_table)
      call keys%set_size('n_table', contact%n_table)
      if (allocated(contact%overclosure)) then
         if (size(contact%overclosure) /= contact%n_table) deallocate (contact%overclosure, &
                                                                       contact%table_force)
      end if
      needed = .false.
      if (allocated(contact%normal_law)) needed = any(contact%normal_law == table) .and. &
         contact%n_table > 0 .and. .not. allocated(contact%overclosure)
      call keys%bind(key('overclosure', 'of the points, ascending', unit='L', shape='n_table', &
                         repeats=.false., absent=of_file//', else required', only=with_table), &
                     contact%overclosure, needed)
      call keys%bind(key('force', 'of the points, from 0 up; linear between and beyond', &
                         at_least(0.0_wp), 'F', 'n_table', repeats=.false., &
                         absent=of_file//', else required', only=with_table), contact%table_force, &
                     needed)
      call keys%bind(key('normal_per_area', &
                         'constants of the normal law are pressures, times area', &
                         only="normal_law other than 'unilateral'"), contact%normal_per_area)
   end subroutine bind_table

   !> Dofs of both sides; a pair between one side and the ground has no side 2.
   subroutine bind_sides(keys, contact, needed)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      !> Pairs were announced, and no file gave their dofs.
      logical, intent(in) :: needed

      call keys%bind(key('side_1', 'dofs of t1, t2, n on one side; 0: none, negative: turned', &
                         side_numbers(), shape='3 x n_pairs', &
                         absent='of the file, else required'), contact%side_1, needed)
      call keys%bind(key('side_2', &
                         'of the other side, 0: ground; the normal points from side 2 to side 1', &
                         side_numbers(), shape='3 x n_pairs', absent=of_file), contact%side_2, &
                     default=0)
      call keys%bind(key('sector_2', 'of side 2: 1 is the next, -1 the one before', &
                         shape='n_pairs', absent=of_file, only='&cyclic'), contact%sector_2, &
                     default=0)
   end subroutine bind_sides

   !> Friction coefficients; only pairs with tangential dofs need one.
   subroutine bind_friction(keys, contact, needed)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: needed

      call keys%bind(key('mu', 'friction coefficient', at_least(0.0_wp), shape='n_pairs', &
                         absent='of the file, else required with tangential dofs'), contact%mu, &
                     needed)
   end subroutine bind_friction

   !> Gap and area; the area turns forces into pressures, which wear asks for, and normal laws
   !> whose constants are pressures.
   subroutine bind_gap(keys, contact, needs_area)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: needs_area

      call keys%bind(key('gap', 'initial; negative: interference', unit='L', shape='n_pairs', &
                         absent=of_file), contact%gap, default=0.0_wp)
      call keys%bind(key('area', 'of a pair', above(0.0_wp), 'L^2', 'n_pairs', &
                         absent='of the file, else required for wear, per area', &
                         only="analysis = 'wear', normal_per_area"), contact%area, needs_area)
   end subroutine bind_gap

   !> A constant force in the place of the normal dof that a pair does not have.
   subroutine bind_normal_load(keys, contact, needed)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      logical, intent(in) :: needed

      call keys%bind(key('normal_load', 'constant, compressive', at_least(0.0_wp), 'F', 'n_pairs', &
                         absent=of_file//', else required with friction', &
                         only='pairs without a normal dof'), contact%normal_load, needed)
   end subroutine bind_normal_load

   !> What a rotation speed adds to gaps and normal loads.
   subroutine bind_growth(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      character(*), parameter :: with_speed = 'rotation_speed, speed_order, campbell'

      call keys%bind(key('gap_rotation', 'added to gap for each (rad/s)^2 of the speed', &
                         unit='L s^2', shape='n_pairs', absent=of_file//', else none', &
                         only=with_speed), contact%gap_rotation)
      call keys%bind(key('normal_load_rotation', 'the same of normal_load', unit='F s^2', &
                         shape='n_pairs', absent=of_file//', else none', only=with_speed), &
                     contact%normal_load_rotation)
   end subroutine bind_growth

   !> Which constants the laws have, and which of them pairs need: the visitor is not asked for any.
   subroutine ask_laws(keys, contact, slides, closes)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      !> Of the pairs, where there are some (n_pairs): as of bind_laws.
      logical, intent(in), optional :: slides(:), closes(:)
      class(pair_law), allocatable :: law
      integer, allocatable :: pair(:)
      integer :: k

      contact%constants%is_asked = .true.
      do k = 1, size(law_words)
         contact%constants%word = law_words(k)
         call new_law(k, law)
         if (present(slides) .and. present(closes)) then
            pair = pairs_of_law(contact, k)
            call law%bind_keys(keys, contact, any(slides(pair)), any(closes(pair)))
         else
            call law%bind_keys(keys, contact, .false., .false.)
         end if
      end do
      contact%constants%is_asked = .false.
   end subroutine ask_laws

   !> The keys that belong to one law or some, those of the laws of the case first: keys that laws
   !> share are needed as these say.
   subroutine bind_laws(keys, contact, slides, closes)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact
      !> Which pairs have tangential dofs, normal dofs (n_pairs).
      logical, intent(in) :: slides(:), closes(:)
      class(pair_law), allocatable :: law
      integer, allocatable :: numbers(:), pair(:)
      integer :: k

      numbers = laws_of(contact)
      call ask_laws(keys, contact, slides, closes)
      contact%constants%is_in_use = .true.
      contact%constants%is_partial = size(numbers) > 1
      do k = 1, size(numbers)
         contact%constants%law = numbers(k)
         pair = pairs_of_law(contact, numbers(k))
         call new_law(numbers(k), law)
         call law%bind_keys(keys, contact, any(slides(pair)), any(closes(pair)))
      end do
      contact%constants%is_partial = .false.
      do k = 1, size(law_words)
         if (any(k == numbers)) cycle
         contact%constants%law = k
         contact%constants%is_in_use = .false.
         call new_law(k, law)
         call law%bind_keys(keys, contact, .false., .false.)
      end do
   end subroutine bind_laws

   !> What the march of rigid laws takes; others ignore it, and say so in `only`.
   subroutine bind_march(keys, contact)
      class(key_visitor), intent(inout) :: keys
      type(contact_type), intent(inout) :: contact

      call keys%bind(key('penalty_scale', 'multiplies eps of rigid laws', above(0.0_wp), &
                         only="law = 'dlft', 'dlft_velocity', 'rigid'"), contact%penalty_scale)
      call keys%bind_word(key('memory', &
                              'pairs that never slip start unstrained, as the last point '// &
                              'ended, or with residual'), contact%memory, memory_words)
      call keys%bind(slider_key('slider_1', &
                                'displacement along t1 where a pair that never slips is '// &
                                'unstrained'), contact%slider_1)
      call keys%bind(slider_key('slider_2', 'the same along t2'), contact%slider_2)
      call keys%bind(key('residual', &
                         'traction of pairs that never slip: -1 and 1 are the ends of what '// &
                         'balances, 0 is between', from_to(-1.0_wp, 1.0_wp), shape='n_pairs', &
                         absent='of the file, else 0', only="memory = 'residual'"), &
                     contact%residual)

   contains

      pure type(key_type) function slider_key(name, help)
         character(*), intent(in) :: name, help

         slider_key = key(name, help, unit='L', shape='n_pairs', absent='of the file, else 0')
      end function slider_key

   end subroutine bind_march

   !> The depth that an earlier run of wear ended with.
   subroutine bind_worn(keys, path, step)
      class(key_visitor), intent(inout) :: keys
      !> Not allocated where there is none.
      character(:), allocatable, intent(inout) :: path
      integer, intent(inout) :: step

      call keys%bind(key('worn', &
                         'result of a wear run: start from its last depths, on top of gap', &
                         absent='none'), path)
      call keys%bind(key('worn_step', 'row of its /wear/depth, from 1; 0: the last', at_least(0), &
                         only='worn'), step)
   end subroutine bind_worn

   !> The number of springs, which becomes the size 'n_springs' of all arrays of the group.
   subroutine bind_n_springs(keys, springs)
      class(key_visitor), intent(inout) :: keys
      type(spring_type), intent(inout) :: springs

      call keys%open('spring', 'nonlinear springs')
      call keys%bind(key('n_springs', '0 switches the springs of a file off', from_to(0, most), &
                         absent=of_file), springs%n_springs)
      call keys%set_size('n_springs', springs%n_springs)
   end subroutine bind_n_springs

   !> Group &spring. Arrays that are needed and not given are left unallocated.
   subroutine bind_springs(keys, springs)
      class(key_visitor), intent(inout) :: keys
      type(spring_type), intent(inout) :: springs
      logical :: needed

      needed = springs%n_springs > 0 .and. .not. allocated(springs%side_1)
      call keys%bind(key('side_1', 'dof on one side', side_numbers(), shape='n_springs', &
                         absent='of the file, else required'), springs%side_1, needed)
      call keys%bind(key('side_2', 'dof on the other side, 0: ground', side_numbers(), &
                         shape='n_springs', absent=of_file), springs%side_2, default=0)
      call keys%bind(key('sector_2', 'of side 2, counted from that of side 1', shape='n_springs', &
                         absent=of_file, only='&cyclic'), springs%sector_2, default=0)
      call keys%bind(key('coefficient', 'force = coefficient * elongation**power', &
                         unit='F/L^power', shape='n_springs', &
                         absent='of the file, else required'), springs%coefficient, needed)
      call keys%bind(key('power', 'odd powers keep the symmetry of odd harmonics', &
                         from_to(1, 99), shape='n_springs', absent=of_file), &
                     springs%power, default=3)
   end subroutine bind_springs

end module fw_contact_keys
