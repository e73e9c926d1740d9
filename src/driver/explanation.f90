!> Why points were not found, in words, where a run is asked to say it: what was tried, what that
!> met, and what an integration in time comes to from there.
module fw_explanation
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_motion, only: motion_failed, motion_grows, motion_irregular, motion_leaves, &
      motion_repeats, motion_settles, motion_type
   use fw_point, only: point_type
   use fw_sinks, only: point_sink
   use fw_strategy, only: point_strategy
   use fw_text, only: to_text
   use fw_vibration, only: six_digits
   implicit none (type, external)
   private

   public :: failure_list

   !> Places that are looked at: each costs an integration.
   integer, parameter :: most = 3
   !> Share of a motion above the harmonics of the balance that it misses.
   real(wp), parameter :: much = 0.01_wp

   !> Points one behind the other that were not found.
   type :: failure_type
      !> Of the first.
      real(wp) :: omega = 0.0_wp
      integer :: n_points = 0
      character(480) :: account = ''
   end type failure_type

   !> Places where points began to fail, with what was tried there; the first ones are kept.
   type, extends(point_sink) :: failure_list
      !> Who solves, and can tell what it has tried.
      class(point_strategy), pointer :: strategy => null()
      !> How often points began to fail.
      integer, private :: n = 0
      type(failure_type), private :: item(most)
      logical, private :: follows = .false.
   contains
      procedure :: take
      procedure :: n_places
      procedure :: omega
      procedure :: tell
   end type failure_list

contains

   !> A row of the sweep.
   subroutine take(self, point, error)
      class(failure_list), intent(inout) :: self
      type(point_type), intent(in) :: point
      type(error_type), allocatable, intent(out) :: error

      associate (unused => allocated(error))
      end associate
      if (point%converged) then
         self%follows = .false.
         return
      end if
      if (.not. self%follows) then
         self%n = self%n + 1
         if (self%n <= most) self%item(self%n) = failure_type(point%omega, 0, &
                                                              self%strategy%account())
      end if
      self%follows = .true.
      if (self%n <= most) self%item(self%n)%n_points = self%item(self%n)%n_points + 1
   end subroutine take

   !> How many places are looked at.
   pure integer function n_places(self)
      class(failure_list), intent(in) :: self

      n_places = min(self%n, most)
   end function n_places

   !> The frequency of such a place [rad/s].
   pure real(wp) function omega(self, place)
      class(failure_list), intent(in) :: self
      integer, intent(in) :: place

      omega = self%item(place)%omega
   end function omega

   !> Why nothing was found at a place.
   subroutine tell(self, place, n_harmonics, point, motion, refusal, text)
      class(failure_list), intent(in) :: self
      integer, intent(in) :: place
      !> Of the balance.
      integer, intent(in) :: n_harmonics
      !> What the integration came to, and what follows from there.
      type(point_type), intent(in) :: point
      type(motion_type), intent(in) :: motion
      !> Why there was none; '' where there was.
      character(*), intent(in) :: refusal
      character(:), allocatable, intent(out) :: text

      associate (failure => self%item(place))
         text = 'no solution at '//trim(six_digits(failure%omega))//' rad/s'
         if (failure%n_points == 2) text = text//' and at the point behind it'
         if (failure%n_points > 2) text = text//' and at '//to_text(failure%n_points - 1)// &
                                          ' points behind it'
         if (failure%account /= '') text = text//': '//trim(failure%account)
      end associate
      text = text//'; an integration in time from there '
      if (refusal /= '') then
         text = text//trim(refusal)
      else if (point%converged) then
         text = text//trim(of_periodic(point, n_harmonics))
      else
         text = text//trim(of_motion(motion, point))
      end if
      if (place == most .and. self%n > most) text = text//' (points begin to fail at '// &
         to_text(self%n - most)//' further places, which were not looked at)'
   end subroutine tell

   !> Of a motion that repeats with the load.
   function of_periodic(point, n_harmonics) result(words)
      type(point_type), intent(in) :: point
      !> Of the balance.
      integer, intent(in) :: n_harmonics
      character(320) :: words
      real(wp) :: above, whole
      character(8) :: percent

      words = 'comes to a periodic motion'//trim(amplitude_of(point))//' after '// &
              to_text(point%iterations)//' periods'
      associate (c => point%coefficients)
         above = norm2(c(2*n_harmonics + 2:, :))
         whole = max(norm2(c(2:, :)), tiny(1.0_wp))
      end associate
      if (above > much*whole) then
         write (percent, '(f6.1)') 100.0_wp*above/whole
         words = trim(words)//', of which '//trim(adjustl(percent))//' % is above harmonic '// &
                 to_text(n_harmonics)//': more n_harmonics may hold it'
      else
         words = trim(words)//', which the harmonics of the balance can hold: smaller steps '// &
                 'of the sweep, its other direction or more n_time may lead there'
      end if
   end function of_periodic

   !> Of a motion that did not come to repeat with the load.
   function of_motion(motion, point) result(words)
      type(motion_type), intent(in) :: motion
      type(point_type), intent(in) :: point
      character(320) :: words

      select case (motion%kind)
      case (motion_repeats)
         words = 'comes to a motion'//trim(amplitude_of(point))//' that repeats after '// &
                 to_text(motion%repeats_after)//' periods of the load: a balance at the '// &
                 'frequency of the load does not hold it'
         if (motion%repeats_after == 1) then
            words = 'comes to a periodic motion'//trim(amplitude_of(point))//' in which a step '// &
                    'of contact was not solved: more time%steps_per_period'
         end if
      case (motion_settles)
         words = 'still settles after '//to_text(point%iterations)// &
                 ' periods: more time%n_periods may show where it comes to'
      case (motion_leaves)
         words = 'moves away for good: a body leaves that only its contact holds; it needs '// &
                 'preload, friction or a support'
      case (motion_grows)
         words = 'grows from period to period: no periodic motion is near; damping or contact '// &
                 'has to limit it'
      case (motion_irregular)
         words = 'comes to no periodic motion: it does not repeat within 12 periods of the load'// &
                 amplitude_of(point)
      case (motion_failed)
         words = 'could not be followed: no forces were found for a step of it'
      case default
         words = 'came to no end'
      end select
   end function of_motion

   function amplitude_of(point) result(words)
      type(point_type), intent(in) :: point
      character(48) :: words

      words = ''
      if (.not. allocated(point%amplitude)) return
      if (size(point%amplitude) == 0) return
      words = ' (amplitude '//trim(six_digits(point%amplitude(1)))//')'
   end function amplitude_of

end module fw_explanation
