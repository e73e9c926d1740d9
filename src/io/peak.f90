!> The maxima of a response: one of an observed quantity at a frequency.
module fw_peak
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: peak_type
   public :: found_words, found_row, found_search, found_jump, found_bound, found_unresolved

   !> How a peak was found, in the order of the constants, from 0: a row of the result stands on it;
   !> looked for between the rows; the response jumps there; the largest is at an end of the range,
   !> where it may go on to rise; looked for, but not to the last.
   character(*), parameter :: found_words(0:4) = [character(16) :: 'row', 'search', 'jump', &
                                                  'end of the sweep', 'not resolved']
   integer, parameter :: found_row = 0, found_search = 1, found_jump = 2, found_bound = 3, &
                         found_unresolved = 4

   type :: peak_type
      !> Column of the observed quantity, from 1.
      integer :: observed = 1
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      real(wp) :: amplitude = 0.0_wp
      !> Between the frequencies on both sides where the amplitude is that over the root of 2
      !> [rad/s]; below 0 where it does not fall so far on both sides.
      real(wp) :: bandwidth = -1.0_wp
      !> Part of the amplitude to which this is known; below 0 where nothing is said of it.
      real(wp) :: tolerance = -1.0_wp
      !> Coefficients (0, c1, s1, ...) of the quantity (2H+1).
      real(wp), allocatable :: coefficients(:)
      integer :: found_by = found_row
   end type peak_type

end module fw_peak
