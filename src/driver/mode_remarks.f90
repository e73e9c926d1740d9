!> Remarks on a nonlinear mode: harmonics that meet another mode on the way.
module fw_mode_remarks
   use fw_kinds, only: wp
   use fw_mode_group, only: mode_table, onset_below, onset_none, onset_stuck, onset_type
   use fw_mode_start, only: mode_start
   use fw_remarks, only: remark_list
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: remark_internal, remark_jump, remark_onset

   !> Frequencies this near, as a part of them, meet: the tongues of weak couplings are narrow, and
   !> their damping is of this order.
   real(wp), parameter :: near = 1.0e-3_wp
   !> Meetings that are named.
   integer, parameter :: most_named = 3

contains

   !> Where a harmonic of the curve passes the frequency of a linear mode energy goes from one to
   !> the other: the curve has a narrow tongue there, which steps may miss. The other mode moves
   !> with the amplitude too: its frequencies with stuck and with sliding pairs stand for it.
   subroutine remark_internal(start, table, remarks)
      type(mode_start), intent(in) :: start
      type(mode_table), intent(in) :: table
      type(remark_list), intent(inout) :: remarks
      character(:), allocatable :: text
      integer :: h, n_found

      if (table%n == 0) return
      text = ''
      n_found = 0
      do h = 1, start%problem%fourier%n_retained
         if (start%problem%fourier%harmonic(h) < 2) cycle
         call note_meetings(start, table, h, start%met(h)%stuck, 'stuck', &
                            start%met(h)%sliding(:0), text, n_found)
      end do
      do h = 1, start%problem%fourier%n_retained
         if (start%problem%fourier%harmonic(h) < 2) cycle
         call note_meetings(start, table, h, start%met(h)%sliding, 'sliding', &
                            start%met(h)%stuck, text, n_found)
      end do
      if (n_found == 0) return
      if (n_found > most_named) text = text//' and '//to_text(n_found - most_named)//' more'
      call remarks%add('internal resonance', text//': a narrow tongue of the curve may be '// &
                       "stepped over there; to follow it take &mode continuation = "// &
                       "'arclength' and more n_points")
   end subroutine remark_internal

   !> Meetings of a harmonic with the modes of one kind.
   subroutine note_meetings(start, table, h, omega, kind, known, text, n_found)
      type(mode_start), intent(in) :: start
      type(mode_table), intent(in) :: table
      integer, intent(in) :: h
      !> Frequencies of the modes, and those that were asked for already [rad/s].
      real(wp), intent(in) :: omega(:), known(:)
      !> How their pairs are.
      character(*), intent(in) :: kind
      character(:), allocatable, intent(inout) :: text
      integer, intent(inout) :: n_found
      integer :: j, k, n

      n = start%problem%fourier%harmonic(h)
      do j = 1, size(omega)
         if (any(abs(known - omega(j)) <= near*omega(j))) cycle
         k = meeting(table, real(n, wp), omega(j))
         if (k == 0) cycle
         n_found = n_found + 1
         if (n_found > most_named) cycle
         if (n_found > 1) text = text//', '
         text = text//to_text(n)//' omega meets mode '//to_text(j)
         associate (cyclic => start%case%model%cyclic)
            if (cyclic%has_sectors() .and. .not. cyclic%is_mistuned) text = text// &
               ' of nodal diameter '//to_text(cyclic%nodal_diameter(n))
         end associate
         if (start%problem%n_pairs > 0) text = text//' with '//kind//' pairs'
         text = text//' ('//trim(short(omega(j)))//' rad/s) near the amplitude '// &
                trim(short(table%row(k)%amplitude))
      end do
   end subroutine note_meetings

   !> The first row behind which, or at which, n omega is that of a mode; 0 where it never is.
   pure integer function meeting(table, n, omega) result(row)
      type(mode_table), intent(in) :: table
      real(wp), intent(in) :: n, omega
      real(wp) :: apart, before

      before = 0.0_wp
      do row = 1, table%n
         if (.not. table%row(row)%converged) cycle
         apart = n*table%row(row)%omega - omega
         if (abs(apart) <= near*omega .or. before*apart < 0.0_wp) return
         before = apart
      end do
      row = 0
   end function meeting

   !> A number for a text.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(9) :: text

      write (text, '(es9.2)') value
      text = adjustl(text)
   end function short

   !> A fold on the way to the first row.
   subroutine remark_jump(amplitude, start, remarks)
      !> Where the curve from the stuck mode ended; 0 where it did not.
      real(wp), intent(in) :: amplitude, start
      type(remark_list), intent(inout) :: remarks

      if (.not. amplitude > 0.0_wp) return
      call remarks%add('fold below the start', 'the curve from the stuck mode turns back at '// &
                       'the amplitude '//to_text(amplitude)//', below mode%start = '// &
                       to_text(start)//': what begins there may be another part of it, or '// &
                       "another curve; take a lower mode%start with mode%continuation = "// &
                       "'arclength' to follow it")
   end subroutine remark_jump

   !> What the onset of slip or separation is not known by.
   subroutine remark_onset(onset, ended, reached, end, remarks)
      type(onset_type), intent(in) :: onset
      !> Whether the curve ended short of its highest amplitude.
      logical, intent(in) :: ended
      real(wp), intent(in) :: reached, end
      type(remark_list), intent(inout) :: remarks
      character(:), allocatable :: limit

      select case (onset%known_by)
      case (onset_none)
         if (ended) call remark_no_onset(reached, end, remarks)
      case (onset_below)
         call remarks%add('onset not reached', 'the first solution of the curve slips or '// &
                          'parts: onset_amplitude is NaN, as the onset is below it; take a '// &
                          'lower mode%start')
      case (onset_stuck)
         limit = ''
         if (onset%bound > 0.0_wp) limit = '; above '//to_text(onset%bound)//' nothing sticks'
         call remarks%add('onset from below', 'pairs stick up to onset_amplitude = '// &
                          to_text(onset%amplitude)//', and no solution was found just above '// &
                          'it: the mode may part there and turn back to lower amplitudes'//limit)
      case default
         ! It is known on both sides.
      end select
   end subroutine remark_onset

   !> That nothing is known of the onset: the curve ended with its pairs as they are at rest.
   subroutine remark_no_onset(reached, end, remarks)
      real(wp), intent(in) :: reached, end
      type(remark_list), intent(inout) :: remarks

      call remarks%add('onset not reached', 'up to the amplitude '//to_text(reached)//', where '// &
                       'the curve ended short of '//to_text(end)//', its pairs are as at rest: '// &
                       'onset_amplitude is NaN, as the onset is not known; follow the curve '// &
                       "further (mode%continuation = 'arclength', more mode%max_points or "// &
                       'mode%n_points), or give the structure a stiffness beside its pairs')
   end subroutine remark_no_onset

end module fw_mode_remarks
