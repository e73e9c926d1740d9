!> Messages that name no remedy of their own, or whose remedy is longer than a line, and what to do.
!> `fw_run --messages` lists them, the user guide has them from there, and a test holds that the
!> sources still say so.
module fw_message_table
   implicit none (type, external)
   private

   public :: write_message_kinds

   type :: message_kind
      !> As it is shown, with dots for what differs.
      character(128) :: message
      character(320) :: remedy
   end type message_kind

   type(message_kind), parameter :: message_kinds(*) = [ &
      message_kind( &
         'x.h5: its run had wear%order = 2, this case has ...', &
         '--restart goes on with the same case only: take the value back, or '// &
         'start from the depths with &contact worn'), &
      message_kind( &
         'x.h5: no step was saved before the run ended', &
         'start anew'), &
      message_kind( &
         '&contact worn x.h5: ...', &
         'name the result of a wear run of a joint with as many pairs'), &
      message_kind( &
         'point 12 of 41: ..., NOT CONVERGED', &
         'more points in the sweep; sweep in the other direction; more n_time '// &
         '(where events are located it changes little); penalty_scale 0.3 or 3; '// &
         'start away from the peak. Exit status 4'), &
      message_kind( &
         'accuracy 1.00E-03 is missed at 7 points, ...', &
         'the answer is there, but the bound of its error is larger, at the '// &
         'points whose /error_estimate is above accuracy: raise n_harmonics (the '// &
         'most that may be used), or ask for less. Exit status 0'), &
      message_kind( &
         '... finer balances were given up at 2 of them (first at 5.00E-02 rad/s, '// &
         'after 143 iterations with up to 15 harmonics)', &
         'there more harmonics cost much and did not come nearer to the accuracy: '// &
         'ask for less, or give n_harmonics'), &
      message_kind( &
         'branch: its points run away at a constant parameter: ...', &
         'the frequency no longer changes along the branch while the static '// &
         'position grows without bound: all contact slips, and friction alone '// &
         'cannot hold the structure. No periodic response exists there without a '// &
         'support, such as a weak linear &spring. Exit status 4'), &
      message_kind( &
         'branch: no continuation was found at ...', &
         'no step, long or short, led on from this frequency [rad/s]; what the '// &
         'branch has is kept. Other first steps (n_points), start from the other '// &
         'end, or a natural sweep. Exit status 4'), &
      message_kind( &
         'branch: it turned back on itself, ...', &
         'at a kink where many pairs change state at once, round-off led the '// &
         'branch back along its own points to the first; the place where it '// &
         'turned is named [rad/s], and the rows after it repeat those before. '// &
         'Other first steps (n_points), start from the other end, or a natural '// &
         'sweep. Exit status 4'), &
      message_kind( &
         'branch: it returned to the start ...', &
         'the branch came back to the frequency start with another response, so '// &
         'that end is not on this branch. Start from the other end. Exit status 4'), &
      message_kind( &
         'branch: not at its end when the time of the run was over', &
         'case%max_seconds ended it; what it has is kept. Exit status 6'), &
      message_kind( &
         'the mode ended: no solution was found beyond ...', &
         'with mode%continuation = ''natural'' the curve may fold: take '// &
         '''arclength''. Or nothing holds the structure once all pairs slip; what '// &
         'the curve has is kept'), &
      message_kind( &
         '&mode number = 3: the structure with its closed pairs stuck has 2 '// &
         'elastic modes', &
         'take one of them'), &
      message_kind( &
         'output%observe: the first observed quantity is at a node of mode ...', &
         'name another first, or take &mode control = ''modal'''), &
      message_kind( &
         '... does not go with ...: ...', &
         'what stands behind the colon; fw_run --rules lists all of them'), &
      message_kind( &
         'the structure resonates without damping at omega = ...', &
         'give the mode damping, or shift the frequency'), &
      message_kind( &
         'the structure with its contact held has a part without both stiffness '// &
         'and mass ...', &
         'a dof has neither; remove it or check the matrices'), &
      message_kind( &
         '&load static pushes a part of the structure that neither stiffness nor '// &
         'contact holds ...', &
         'hold the part'), &
      message_kind( &
         '&contact pair 3, t1: its relative displacement follows from that of '// &
         'earlier pairs ...', &
         'the pair repeats others; remove it or use law = ''penalty'''), &
      message_kind( &
         '&harmonics parity = ''odd'': the response has even harmonics ...', &
         'use ''auto''')]

contains

   !> The table as Markdown.
   subroutine write_message_kinds(unit)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      integer :: i

      write (unit, '(a)') '| message | what to do |', '|---|---|'
      do i = 1, size(message_kinds)
         write (unit, '(5a)') '| ', trim(message_kinds(i)%message), ' | ', &
            trim(message_kinds(i)%remedy), ' |'
      end do
   end subroutine write_message_kinds

end module fw_message_table
