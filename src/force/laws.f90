!> The laws of contact pairs by their words: a new law is a word and a line here, and a file of its
!> own. Pairs of one case may have different ones.
module fw_laws
   use fw_bouc_wen, only: bouc_wen_friction
   use fw_contact_data, only: contact_type, sliding_path, sliding_steady
   use fw_force_law, only: law_facts
   use fw_friction, only: elastic_friction, rigid_friction, rigid_friction_of_rates
   use fw_kinds, only: wp
   use fw_iwan, only: iwan_friction
   use fw_normal_law, only: curved_pairs
   use fw_pair_law, only: pair_law
   use fw_regularised, only: regularised_friction
   use fw_rigid_law, only: friction_of_high_order
   use fw_several_laws, only: common_facts, lean_facts, several_laws
   implicit none (type, external)
   private

   public :: law_words, law_help, law_number, new_law, build_law, laws_of, pairs_of_law, facts_of
   public :: is_rigid, pairs_are_rigid, pairs_are_hysteretic, law_under_accuracy, usual_law
   public :: is_of_high_order, is_viscous

   character(*), parameter :: law_words(*) = &
      [character(13) :: 'dlft', 'dlft_velocity', 'penalty', 'rigid', 'regularised', &
                        'iwan', 'bouc_wen']
   !> What they are, in the same order, for the key `law` (160 characters).
   character(*), parameter :: law_help = 'rigid, rigid at velocity level, elastic, rigid of '// &
      'high order (friction on mass), smooth in the velocity, joints of Iwan, of Bouc-Wen'

contains

   !> The law of a number in `law_words`, without its pairs.
   subroutine new_law(number, law)
      integer, intent(in) :: number
      class(pair_law), allocatable, intent(out) :: law

      select case (law_words(number))
      case ('dlft_velocity'); allocate (law, source=rigid_friction_of_rates())
      case ('penalty'); allocate (law, source=elastic_friction())
      case ('rigid'); allocate (law, source=friction_of_high_order())
      case ('regularised'); allocate (law, source=regularised_friction())
      case ('iwan'); allocate (law, source=iwan_friction())
      case ('bouc_wen'); allocate (law, source=bouc_wen_friction())
      case default; allocate (law, source=rigid_friction())
      end select
   end subroutine new_law

   !> The law of all pairs of a case, built: one, or several as one.
   subroutine build_law(contact, present, law)
      type(contact_type), intent(in) :: contact
      !> Components in use (3, n_pairs).
      logical, intent(in) :: present(:, :)
      class(pair_law), allocatable, intent(out) :: law
      class(pair_law), allocatable :: member
      type(several_laws), allocatable :: all
      real(wp) :: speed(contact%n_pairs, 2)
      integer :: group(contact%n_pairs)
      integer, allocatable :: pair(:)
      integer :: i, k

      group = groups_of(contact)
      speed = 0.0_wp
      if (contact%sliding == sliding_steady) speed = contact%speeds()
      if (maxval([group, 1]) == 1 .and. .not. any(abs(speed) > 0.0_wp)) then
         call new_law(contact%law, law)
         call law%build(contact, present)
         return
      end if
      allocate (all)
      do k = 1, maxval(group)
         pair = pack([(i, i=1, size(group))], group == k)
         call new_law(law_of_pair(contact, pair(1)), member)
         if (any(abs(speed(pair(1), :)) > 0.0_wp)) then
            ! What presses alone; friction follows from it.
            call member%build(without_friction(part_of(contact, pair)), &
                              present(:, pair) .and. spread([.false., .false., .true.], 2, &
                                                            size(pair)))
         else
            call member%build(part_of(contact, pair), present(:, pair))
         end if
         call all%add(member, pair)
      end do
      call all%join(present, contact%mu, speed, contact%worn_friction)
      call move_alloc(all, law)
   end subroutine build_law

   !> Pairs that press and do not rub.
   type(contact_type) function without_friction(contact) result(smooth)
      type(contact_type), intent(in) :: contact

      smooth = contact
      smooth%mu = 0.0_wp
      if (allocated(smooth%worn_friction)) deallocate (smooth%worn_friction)
      call smooth%constants%set('speed_1', spread(0.0_wp, 1, contact%n_pairs))
      call smooth%constants%set('speed_2', spread(0.0_wp, 1, contact%n_pairs))
   end function without_friction

   !> Pairs that one law is built for have one number, in the order of their first pairs: those with
   !> the same word, and of them those whose pressure is a curve, and those on a side that slides
   !> steadily (n_pairs).
   pure function groups_of(contact) result(group)
      type(contact_type), intent(in) :: contact
      integer :: group(contact%n_pairs)
      logical, dimension(contact%n_pairs) :: curved, steady
      integer :: code(contact%n_pairs)
      integer :: first, i, n

      curved = curved_pairs(contact)
      steady = .false.
      if (contact%sliding == sliding_steady) steady = any(abs(contact%speeds()) > 0.0_wp, dim=2)
      code = [(4*law_of_pair(contact, i) + merge(2, 0, steady(i)) + merge(1, 0, curved(i)), &
               i=1, size(code))]
      n = 0
      do i = 1, size(code)
         first = findloc(code, code(i), dim=1)
         if (first == i) n = n + 1
         group(i) = merge(n, group(first), first == i)
      end do
   end function groups_of

   !> Number of the law of a pair.
   pure integer function law_of_pair(contact, pair) result(number)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: pair

      number = contact%law
      if (allocated(contact%law_of)) number = contact%law_of(pair)
   end function law_of_pair

   !> Numbers of the laws that the pairs of a case have, each once, in the order of their pairs.
   pure function laws_of(contact) result(numbers)
      type(contact_type), intent(in) :: contact
      integer, allocatable :: numbers(:)
      integer :: i

      numbers = [contact%law]
      if (.not. allocated(contact%law_of)) return
      do i = 1, size(contact%law_of)
         if (all(numbers /= contact%law_of(i))) numbers = [numbers, contact%law_of(i)]
      end do
   end function laws_of

   !> The pairs that have the law of a number.
   pure function pairs_of_law(contact, number) result(pair)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: number
      integer, allocatable :: pair(:)
      integer :: i

      pair = [(i, i=1, merge(contact%n_pairs, 0, number == contact%law))]
      if (.not. allocated(contact%law_of)) return
      pair = pack([(i, i=1, size(contact%law_of))], contact%law_of == number)
   end function pairs_of_law

   !> Some pairs of a contact, with what laws take of them.
   pure type(contact_type) function part_of(contact, pair) result(part)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: pair(:)

      part%n_pairs = size(pair)
      part%penalty_scale = contact%penalty_scale
      part%memory = contact%memory
      part%sliding = contact%sliding
      part%side_1 = contact%side_1(:, pair)
      part%side_2 = contact%side_2(:, pair)
      part%mu = contact%mu(pair)
      if (allocated(contact%worn_friction)) part%worn_friction = &
         contact%worn_friction%of_pairs(pair)
      part%gap = contact%gap(pair)
      if (allocated(contact%gap_harmonic)) then
         part%gap_harmonic = contact%gap_harmonic
         part%gap_cosine = contact%gap_cosine(pair, :)
         part%gap_sine = contact%gap_sine(pair, :)
      end if
      part%normal_load = contact%normal_load(pair)
      part%speed_order = contact%speed_order
      if (allocated(contact%gap_rotation)) part%gap_rotation = contact%gap_rotation(pair)
      if (allocated(contact%normal_load_rotation)) then
         part%normal_load_rotation = contact%normal_load_rotation(pair)
      end if
      part%constants = contact%constants%of_pairs(pair)
      call take_normal_part(contact, pair, part)
      if (allocated(contact%tangential_stiffness)) then
         part%tangential_stiffness = contact%tangential_stiffness(pair)
      end if
      if (allocated(contact%normal_stiffness)) then
         part%normal_stiffness = contact%normal_stiffness(pair)
      end if
   end function part_of

   !> How some pairs press.
   pure subroutine take_normal_part(contact, pair, part)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: pair(:)
      type(contact_type), intent(inout) :: part

      if (.not. allocated(contact%normal_law)) return
      part%normal_law = contact%normal_law(pair)
      part%n_table = contact%n_table
      if (allocated(contact%overclosure)) part%overclosure = contact%overclosure
      if (allocated(contact%table_force)) part%table_force = contact%table_force
      part%normal_per_area = contact%normal_per_area
      if (allocated(contact%area)) part%area = contact%area(pair)
   end subroutine take_normal_part

   !> What holds of the pairs of a case together.
   !> For checks of the input, which come before any pair is built.
   type(law_facts) function facts_of(contact) result(facts)
      type(contact_type), intent(in) :: contact
      type(contact_type) :: part
      integer :: group(contact%n_pairs)
      integer, allocatable :: pair(:)
      type(law_facts), allocatable :: each(:)
      integer :: i, k

      group = groups_of(contact)
      allocate (each(maxval([group, 1])))
      if (contact%n_pairs == 0) each = facts_of_law(contact%law, contact)
      do k = 1, maxval([group, 0])
         pair = pack([(i, i=1, size(group))], group == k)
         part%n_pairs = size(pair)
         part%side_1 = contact%side_1(:, pair)
         part%side_2 = contact%side_2(:, pair)
         part%constants = contact%constants%of_pairs(pair)
         part%mu = contact%mu(pair)
         call take_normal_part(contact, pair, part)
         if (contact%sliding == sliding_steady .and. part%slides()) then
            each(k) = facts_of_law(law_of_pair(contact, pair(1)), without_friction(part))
            call lean_facts(each(k))
         else
            each(k) = facts_of_law(law_of_pair(contact, pair(1)), part)
         end if
      end do
      facts = each(1)
      if (size(each) > 1) facts = common_facts(each)
   end function facts_of

   type(law_facts) function facts_of_law(number, contact) result(facts)
      integer, intent(in) :: number
      !> The pairs that have it.
      type(contact_type), intent(in), optional :: contact
      class(pair_law), allocatable :: law

      call new_law(number, law)
      if (present(contact)) call law%take_facts(contact)
      facts = law%facts
   end function facts_of_law

   !> Whether the law of each pair predicts from the balance (n_pairs).
   !> Rigid laws have no stiffness of their own, hence no derivative in time.
   function pairs_are_rigid(contact) result(rigid)
      type(contact_type), intent(in) :: contact
      logical :: rigid(contact%n_pairs)
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      do k = 1, size(numbers)
         rigid(pairs_of_law(contact, numbers(k))) = law_is_rigid(numbers(k))
      end do
   end function pairs_are_rigid

   !> Whether the law of each pair takes one tangential direction under a constant load alone
   !> (n_pairs).
   function pairs_are_hysteretic(contact) result(are)
      type(contact_type), intent(in) :: contact
      logical :: are(contact%n_pairs)
      type(law_facts) :: facts
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      do k = 1, size(numbers)
         facts = facts_of_law(numbers(k))
         are(pairs_of_law(contact, numbers(k))) = facts%is_hysteretic
      end do
   end function pairs_are_hysteretic

   !> Whether some pairs of a case are rigid; of a case without pairs, what its law is.
   logical function is_rigid(contact)
      type(contact_type), intent(in) :: contact
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      is_rigid = .false.
      do k = 1, size(numbers)
         is_rigid = is_rigid .or. law_is_rigid(numbers(k))
      end do
   end function is_rigid

   logical function law_is_rigid(number)
      integer, intent(in) :: number
      class(pair_law), allocatable :: law

      call new_law(number, law)
      law_is_rigid = law%prediction%takes_balance
   end function law_is_rigid

   !> Whether some pairs hold nothing at rest: their friction is one of rates.
   logical function is_viscous(contact)
      type(contact_type), intent(in) :: contact
      class(pair_law), allocatable :: law
      integer, allocatable :: numbers(:)
      integer :: k

      numbers = laws_of(contact)
      is_viscous = .false.
      do k = 1, size(numbers)
         call new_law(numbers(k), law)
         is_viscous = is_viscous .or. (law%prediction%order(1) > 0 .and. &
                                       .not. law%prediction%takes_balance)
      end do
   end function is_viscous

   !> The law that has the solutions of the law of a number and knows its forces in every harmonic;
   !> the number itself where there is none.
   integer function law_with_tail(number) result(same)
      integer, intent(in) :: number
      type(law_facts) :: facts
      integer :: k

      same = number
      facts = facts_of_law(number)
      ! Rigid, and known to the integration in time: Coulomb's friction, whatever the method.
      if (.not. (law_is_rigid(number) .and. facts%is_integrated)) return
      do k = 1, size(law_words)
         facts = facts_of_law(k)
         if (facts%has_tail) same = k
      end do
   end function law_with_tail

   !> The law that is solved where an accuracy is to be kept: friction of dofs, each in one
   !> direction, by the law that knows its tail.
   integer function law_under_accuracy(contact, by_instants) result(number)
      type(contact_type), intent(in) :: contact
      !> Whether forces are wanted at instants: that law follows events.
      logical, intent(in) :: by_instants

      number = contact%law
      if (contact%n_pairs == 0 .or. by_instants .or. allocated(contact%law_of)) return
      ! That law carries no anchors along.
      if (contact%slides() .and. contact%sliding == sliding_path) return
      ! Two directions are solved by the displacement law only.
      if (any(all(contact%side_1(1:2, :) /= 0 .or. contact%side_2(1:2, :) /= 0, dim=1))) return
      number = law_with_tail(number)
   end function law_under_accuracy

   !> The law of a case that names none: rigid friction, of high order where that serves.
   pure integer function usual_law(of_high_order) result(number)
      logical, intent(in) :: of_high_order

      number = law_number('dlft')
      if (of_high_order) number = law_number('rigid')
   end function usual_law

   !> Whether a law is that of high order.
   pure logical function is_of_high_order(number)
      integer, intent(in) :: number

      is_of_high_order = number == usual_law(.true.)
   end function is_of_high_order

   !> Where a word stands among `law_words`; 0 where it does not.
   pure integer function law_number(word)
      character(*), intent(in) :: word

      law_number = findloc(law_words, word, dim=1)
   end function law_number

end module fw_laws
