!> The contact law of a case that names none: rigid friction of high order, which is right on
!> masses and on nodes without mass, where the rest of the case goes with it; else rigid friction
!> at the instants.
module fw_usual_law
   use fw_case, only: analyses, case_type
   use fw_harmonics_options, only: method_hbm, sampling_uniform
   use fw_kinds, only: wp
   use fw_laws, only: law_words, usual_law
   use fw_reader, only: reader_type
   use fw_values, only: quoted_text
   implicit none (type, external)
   private

   public :: choose_law

contains

   !> Where a law was not given, take the one that is right, in the effective input too.
   subroutine choose_law(reader, case)
      type(reader_type), intent(inout) :: reader
      type(case_type), intent(inout) :: case

      if (reader%given('contact', 'law') .or. case%contact%n_pairs == 0) return
      ! What was saved with the pairs is as good as given.
      if (case%contact%law_is_of_model) return
      associate (contact => case%contact)
         contact%law = usual_law(goes_with_events(case))
         ! Integrated in time, the rigid laws are one, and nothing was chosen.
         contact%law_is_chosen = .not. analyses(case%analysis)%is_integrated
         call reader%amend('contact', 'law', quoted_text(trim(law_words(contact%law))))
      end associate
   end subroutine choose_law

   !> Whether nothing asks for instants: where forces are followed from event to event by
   !> themselves. Integration in time knows one rigid law only, slip in two directions has no law of
   !> high order, and neither has a structure that feeds its vibration.
   pure logical function goes_with_events(case) result(goes)
      type(case_type), intent(in) :: case

      associate (h => case%harmonics, c => case%contact)
         goes = analyses(case%analysis)%is_balanced .and. &
                h%method == method_hbm .and. h%sampling /= sampling_uniform .and. &
                h%n_time == 0 .and. .not. h%adaptive .and. .not. case%output%histories .and. &
                .not. any(all(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1)) .and. &
                .not. feeds_energy(case)
      end associate
   end function goes_with_events

   !> Whether a dof is damped negatively: an oscillator that takes energy has no path to follow.
   pure logical function feeds_energy(case) result(feeds)
      type(case_type), intent(in) :: case
      integer :: i

      feeds = .false.
      if (.not. allocated(case%model%damping)) return
      do i = 1, size(case%model%damping, 1)
         feeds = feeds .or. case%model%damping(i, i) < 0.0_wp
      end do
   end function feeds_energy

end module fw_usual_law
