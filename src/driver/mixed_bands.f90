!> Where modes lie that the joint changes within the period: each between its frequency with the
!> joint free and that with the joint held, wherever its vibration puts it. A mass that just touches
!> a stop has 2 f c/(f + c) between the free frequency f and the closed one c; with several modes,
!> gaps, preload or friction no formula tells the place.
!>
!> What can be told is how far such a resonance shows. Beside a mode of width w and height A its
!> flank has the height A w/(2 d) at the distance d, whatever the damping: load over 2 omega times
!> modal mass. Two rows hide a resonance between them only where they stand above its flank.
module fw_mixed_bands
   use fw_body, only: body_type
   use fw_joint_modes, only: held_stiffness, joint_mode_type, state_free, state_sliding, &
      state_stuck
   use fw_kinds, only: wp
   use fw_linalg, only: has_pivots
   use fw_modes, only: least_width
   use fw_samples, only: sample_type
   implicit none (type, external)
   private

   public :: mixed_band, find_bands, hidden_points, opens

   type :: mixed_band
      !> Frequencies with the joint free and held [rad/s].
      real(wp) :: free = 0.0_wp, held = huge(1.0_wp)
      !> The larger width of the two [rad/s].
      real(wp) :: width = 0.0_wp
      !> Height and flank at a distance of 1 rad/s, the larger of the two (n_observed).
      real(wp), allocatable :: height(:), flank(:)
   end type mixed_band

   !> Mode whose resonance is wider than this many intervals shows in the rows.
   real(wp), parameter :: intervals_of_width = 3.0_wp
   !> Mean share of the period for which pairs are open, from which on the joint opens, and up to
   !> which it closes.
   real(wp), parameter :: hardly = 0.02_wp, nearly = 0.98_wp

contains

   !> The bands of all modes; none where no pair opens.
   subroutine find_bands(case, modes, bands)
      class(body_type), intent(in) :: case
      !> All below the end of the range.
      type(joint_mode_type), intent(in) :: modes(:)
      type(mixed_band), allocatable, intent(out) :: bands(:)
      integer, allocatable :: free(:), held(:)
      integer :: j, k, n_floating

      allocate (bands(0))
      if (case%contact%n_pairs == 0 .or. size(modes) == 0) return
      if (.not. any(case%contact%side_1(3, :) /= 0 .or. case%contact%side_2(3, :) /= 0)) return
      k = state_stuck
      if (.not. any(modes%state == k)) k = state_sliding
      free = places_of(modes, state_free)
      held = places_of(modes, k)
      n_floating = count_floating(case, modes(free)%omega, modes(held)%omega)
      deallocate (bands)
      allocate (bands(size(free) + n_floating))
      do j = 1, size(bands)
         if (j > n_floating) call take(modes(free(j - n_floating)), .true., bands(j))
         if (j <= size(held)) call take(modes(held(j)), .false., bands(j))
         ! Floating, and held above the range: its mode is not known.
         if (.not. allocated(bands(j)%flank)) bands(j)%held = 0.0_wp
      end do
   end subroutine find_bands

   !> Places of the modes of a state that the first harmonic of the loads hits, by frequency.
   pure function places_of(modes, state) result(places)
      type(joint_mode_type), intent(in) :: modes(:)
      integer, intent(in) :: state
      integer, allocatable :: places(:)
      integer :: j

      places = pack([(j, j=1, size(modes))], modes%state == state .and. modes%harmonic == 1)
   end function places_of

   !> Modes of the free structure at zero frequency, which are not in the list: held ones stand
   !> above free ones of the same number.
   integer function count_floating(case, free, held) result(n)
      class(body_type), intent(in) :: case
      !> Frequencies [rad/s].
      real(wp), intent(in) :: free(:), held(:)
      real(wp), parameter :: round_off = 1.0e-6_wp
      real(wp), allocatable :: stiffness(:, :)
      integer :: m

      n = 0
      if (.not. case%model%cyclic%is_cyclic) then
         call held_stiffness(case, state_free, stiffness)
         if (.not. has_pivots(stiffness)) n = 1
      end if
      do n = n, size(held)
         m = min(size(free), size(held) - n)
         if (all(free(:m) <= (1.0_wp + round_off)*held(n + 1:n + m))) exit
      end do
   end function count_floating

   !> What a mode tells of a band.
   pure subroutine take(mode, is_free, band)
      type(joint_mode_type), intent(in) :: mode
      logical, intent(in) :: is_free
      type(mixed_band), intent(inout) :: band
      integer :: i

      if (is_free) then
         band%free = mode%omega
      else
         band%held = mode%omega
      end if
      if (.not. allocated(band%height)) allocate (band%height(size(mode%amplitude)), &
                                                  band%flank(size(mode%amplitude)), source=0.0_wp)
      band%width = max(band%width, mode%width)
      do i = 1, size(mode%amplitude)
         band%height(i) = max(band%height(i), mode%amplitude(i))
         ! With the width that the amplitude was had with: a flank stands without damping too.
         band%flank(i) = max(band%flank(i), 0.5_wp*max(mode%width, least_width*mode%omega)* &
                             mode%amplitude(i))
      end do
   end subroutine take

   !> How many times too far apart two rows are for a resonance between them to rise above both, in
   !> the quantity that would show it first, and how high that may be (0: not above them).
   pure subroutine hidden_points(bands, below, above, points, height)
      type(mixed_band), intent(in) :: bands(:)
      type(sample_type), intent(in) :: below, above
      real(wp), intent(out) :: points
      !> (n_observed)
      real(wp), intent(out) :: height(:)
      real(wp) :: swing(size(height)), needed
      integer :: i, j

      points = 0.0_wp
      height = 0.0_wp
      swing = max(below%amplitude - below%mean, above%amplitude - above%mean)
      do j = 1, size(bands)
         associate (band => bands(j), distance => above%omega - below%omega)
            if (above%omega <= band%free .or. below%omega >= band%held) cycle
            if (intervals_of_width*distance <= band%width) cycle
            needed = huge(1.0_wp)
            do i = 1, size(height)
               if (band%height(i) <= swing(i)) cycle
               height(i) = max(height(i), band%height(i))
               needed = min(needed, 0.5_wp*distance*swing(i)/max(band%flank(i), tiny(1.0_wp)))
            end do
            if (needed < huge(1.0_wp)) points = max(points, needed)
         end associate
      end do
   end subroutine hidden_points

   !> Whether the joint opens and closes, as far as that is known.
   pure logical function opens(sample)
      type(sample_type), intent(in) :: sample
      integer, parameter :: open = 3

      opens = sample%fraction(open) < 0.0_wp .or. &
              (sample%fraction(open) >= hardly .and. sample%fraction(open) <= nearly)
   end function opens

end module fw_mixed_bands
