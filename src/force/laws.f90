!> The laws of contact pairs by their words: a new law is a word and a line here, and a file of its
!> own.
module fw_laws
   use fw_contact_data, only: contact_type
   use fw_force_law, only: law_facts
   use fw_friction, only: elastic_friction, rigid_friction, rigid_friction_of_rates
   use fw_pair_law, only: pair_law
   use fw_regularised, only: regularised_friction
   use fw_rigid_law, only: friction_of_high_order
   implicit none (type, external)
   private

   public :: law_words, law_help, law_number, new_law, facts_of, is_rigid
   public :: law_under_accuracy, usual_law, is_of_high_order, is_viscous

   character(*), parameter :: law_words(*) = &
      [character(13) :: 'dlft', 'dlft_velocity', 'penalty', 'rigid', 'regularised']
   !> What they are, in the same order, for the key `law` (160 characters).
   character(*), parameter :: law_help = 'rigid, rigid at velocity level, elastic, rigid of '// &
      'high order (friction on dofs with mass), or smooth in the velocity'

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
      case default; allocate (law, source=rigid_friction())
      end select
   end subroutine new_law

   !> What holds of the law of a number.
   !> For checks of the input, which come before any pair is built.
   type(law_facts) function facts_of(number) result(facts)
      integer, intent(in) :: number
      class(pair_law), allocatable :: law

      call new_law(number, law)
      facts = law%facts
   end function facts_of

   !> Whether the law of a number predicts from the balance.
   !> Rigid laws have no stiffness of their own, hence no derivative in time.
   logical function is_rigid(number)
      integer, intent(in) :: number
      class(pair_law), allocatable :: law

      call new_law(number, law)
      is_rigid = law%prediction%takes_balance
   end function is_rigid

   !> Whether pairs of the law of a number hold nothing at rest: their friction is one of rates.
   logical function is_viscous(number)
      integer, intent(in) :: number
      class(pair_law), allocatable :: law

      call new_law(number, law)
      is_viscous = law%prediction%order(1) > 0 .and. .not. law%prediction%takes_balance
   end function is_viscous

   !> The law that has the solutions of the law of a number and knows its forces in every harmonic;
   !> the number itself where there is none.
   integer function law_with_tail(number) result(same)
      integer, intent(in) :: number
      type(law_facts) :: facts
      integer :: k

      same = number
      facts = facts_of(number)
      ! Rigid, and known to the integration in time: Coulomb's friction, whatever the method.
      if (.not. (is_rigid(number) .and. facts%is_integrated)) return
      do k = 1, size(law_words)
         facts = facts_of(k)
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
      if (contact%n_pairs == 0 .or. by_instants) return
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
