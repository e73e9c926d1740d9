!> Every remark that a run may make, and when, and messages whose remedy is longer than a line: a
!> row each. `fw_run --remarks` and `--messages` list them, docs/messages.md has them from there,
!> and tests hold that sources make these remarks and no others, and still say these messages.
module fw_remark_table
   implicit none (type, external)
   private

   public :: write_message_kinds, write_remark_kinds

   !> A remark: its name, and when it is made.
   type :: remark_kind
      !> By which programs know it.
      character(28) :: name
      !> What it is said of.
      character(480) :: meaning
   end type remark_kind

   !> The order is that of a run: the case, the model, then the solution by its analysis. A remark
   !> does not change the status, but where its meaning says so.
   type(remark_kind), parameter :: remark_kinds(*) = [ &
      ! Matrices and constants of a model that are most often a slip of the pen.
      remark_kind('negative stiffness', &
                  'the stiffness is not positive, even with the joint held along its '// &
                  'normals'), &
      remark_kind('negative mass', &
                  'the mass is not positive: entries off its diagonal or signs are wrong'), &
      remark_kind('negative damping', &
                  'the damping is not positive, as flutter may want it'), &
      remark_kind('high friction', &
                  'mu is above 2'), &
      remark_kind('two directions', &
                  'law = ''rigid'' with two tangential directions: not of high order there'), &
      remark_kind('impact on mass', &
                  'law = ''rigid'' with a normal dof that has mass: not of high order '// &
                  'where it impacts'), &
      remark_kind('self-locking', &
                  'friction can jam a body that no spring holds: normal forces at rest '// &
                  'have no upper bound, as of flanks with tan a <= mu'), &
      remark_kind('body without load', &
                  'nothing presses a body that no spring holds against its flanks: no '// &
                  'rotation speed, radius or static load'), &
      remark_kind('body turns', &
                  'normals leave a body that no spring holds a motion, which friction alone '// &
                  'holds: a cylinder, or one point on each flank'), &
      ! What the program has chosen, and what it had to leave out.
      remark_kind('law chosen', &
                  'law was not given: ''rigid'' is taken, or ''dlft'' where something '// &
                  'given asks for instants (n_time, sampling = ''uniform'', histories, a '// &
                  'method other than hbm), or a pair has two tangential directions or a '// &
                  'dof negative damping'), &
      remark_kind('law under accuracy', &
                  'with accuracy the named law (dlft, dlft_velocity) is solved as rigid, '// &
                  'the same friction whose error is known'), &
      remark_kind('few instants', &
                  'law = ''regularised'': at some points velocities are so far above '// &
                  'slip_speed that friction turns round between two instants (n_time below '// &
                  '8 max abs(v)/v_0); not where an accuracy watches over the instants'), &
      remark_kind('sliding may turn', &
                  'sliding = ''steady'': at some points the velocity of a pair that bears, '// &
                  'along the surface, exceeds that of the surface, so that friction turns '// &
                  'round'), &
      ! Parts of the input that change nothing: said, since they were meant to.
      remark_kind('not read', &
                  'the model file holds datasets, groups or attributes that nothing reads, '// &
                  'see model files'), &
      remark_kind('no pairs', &
                  'a group &contact, but no pair that it could be about'), &
      remark_kind('no springs', &
                  'a group &spring, but no spring that it could be about'), &
      remark_kind('gap not used', &
                  'pairs have a gap and no normal dof'), &
      remark_kind('constant not used', &
                  'the model file has stiffnesses that law does not take'), &
      remark_kind('no load', &
                  'no vibratory load acts'), &
      remark_kind('another order', &
                  'speed_order is neither engine_order nor its negative, nor one of these '// &
                  'and a multiple of the number of sectors'), &
      ! How far the model and the number of harmonics serve.
      remark_kind('accuracy chosen', &
                  'neither n_harmonics nor accuracy was given: a natural sweep or a point '// &
                  'with contact or nonlinear springs takes accuracy = 1e-2, where nothing '// &
                  'else given forbids it (n_time, histories, a method other than hbm, '// &
                  'memory = ''carried''); steps of a session keep one harmonic'), &
      remark_kind('unstable', &
                  'coriolis, circulatory, unsymmetric or air forces: the linear structure '// &
                  'without contact has a mode that grows'), &
      remark_kind('beyond reduction', &
                  'the model file says up to which frequency it was reduced '// &
                  '(/reduction/frequency), and the highest harmonic of the highest frequency '// &
                  'is above it'), &
      remark_kind('damping of all modes', &
                  'modal_damping takes all modes of 3,000 coordinates or more, and long: '// &
                  'modal_damping_up_to takes the lowest'), &
      remark_kind('one harmonic', &
                  'contact or springs, and n_harmonics = 1'), &
      ! Wear: where its steps or its harmonics decide more than the law does.
      remark_kind('too few harmonics', &
                  'wear: a pair slips, and with 2H+1 harmonics it sticks or slips by less '// &
                  'than half: it wears for want of harmonics (the finer the mesh, the more '// &
                  'are needed)'), &
      remark_kind('steady state not confirmed', &
                  'wear: nothing wears any more with H harmonics, and a pair still does '// &
                  'with 2H+1'), &
      remark_kind('vibration jumps', &
                  'wear: beyond a depth the vibration so far does not exist; which one the '// &
                  'joint goes to was looked for without its motion'), &
      remark_kind('slip begins', &
                  'wear: how much a pair wears that begins to slip depends on the step, '// &
                  'however short'), &
      remark_kind('steps too long', &
                  'wear: explicit steps of given size above 1/50 of the final depth: they '// &
                  'overshoot a steady state by about half a step; other steps of first '// &
                  'order above 1/5 of it, whose error nothing estimates'), &
      remark_kind('profile depends on steps', &
                  'wear: with check_steps, halved steps move the profile by more than 2 %'), &
      ! Campbell diagrams, and derivatives by parameters.
      remark_kind('campbell points', &
                  'campbell: frequencies near a crossing that could not be solved: its peak '// &
                  'may be missed'), &
      remark_kind('bounds without solution', &
                  'bounds: residual tractions for which no solution was found: they are no '// &
                  'ends of the range, which may be wider'), &
      remark_kind('population peaks', &
                  'population: maxima between rows that took more solutions than they may: '// &
                  'the largest amplitude that was solved stands for them'), &
      remark_kind('derivatives of instants', &
                  '&sensitivity with contact decided at instants: take sampling = '// &
                  '''events'''), &
      remark_kind('derivatives at held eps', &
                  '&sensitivity by damping or rotation with a rigid law: its eps, which '// &
                  'follows the matrices, is held: with few harmonics they may be far off'), &
      remark_kind('one-sided derivatives', &
                  '&sensitivity: points where a pair is at the onset of slip or contact'), &
      remark_kind('tied peaks', &
                  '&sensitivity: points where two peaks of a period are alike'), &
      remark_kind('no derivatives', &
                  '&sensitivity: points where the response folds'), &
      ! Controlled responses and nonlinear modes: other solutions that are near.
      remark_kind('several loads', &
                  '&control: an amplitude that more than one load gives, as pairs stick or '// &
                  'slip; which is found depends on where the search begins: follow the '// &
                  'response over the load'), &
      remark_kind('branches off', &
                  'between two amplitudes of a nonlinear mode another curve branches off, '// &
                  'as where equal parts begin to move apart: which one is followed may '// &
                  'depend on the steps and the law (natural steps, up to 120 unknowns)'), &
      remark_kind('fold below the start', &
                  'the curve of a nonlinear mode turns back below mode%start: what begins '// &
                  'there may be another part of it'), &
      remark_kind('onset not reached', &
                  'the curve of a nonlinear mode ended before mode%end with its pairs as '// &
                  'at rest, or its first solution is above the onset: onset_amplitude is '// &
                  'NaN as it is not known'), &
      remark_kind('onset from below', &
                  'a nonlinear mode sticks up to onset_amplitude, and no solution was '// &
                  'found just above: it may part there and turn back to lower amplitudes'), &
      ! Resonances over a parameter, and what a sweep may have missed between its rows.
      remark_kind('no resonance', &
                  'analysis = ''resonance'': the sweep has no maximum to follow; status 4'), &
      remark_kind('lost resonance', &
                  'analysis = ''resonance'': the resonance was lost before the last value; '// &
                  'status 4'), &
      remark_kind('corner at the resonance', &
                  'analysis = ''resonance'': the maximum is a corner of the response at '// &
                  'some values: its frequency is good to a millionth and has no derivative'), &
      remark_kind('optimum', &
                  'analysis = ''resonance'': the value between the ends at which the '// &
                  'resonance is smallest'), &
      remark_kind('another peak', &
                  'a sweep of a joint that opens within the period: rows are so far apart '// &
                  'that a resonance higher than all maxima may lie between them; analysis '// &
                  '= ''resonance'': at the last value the sweep is larger elsewhere than '// &
                  'at the resonance that was followed'), &
      remark_kind('internal resonance', &
                  'a nonlinear mode of which a harmonic meets the frequency of another '// &
                  'mode with stuck or sliding pairs: a narrow tongue of the curve may be '// &
                  'stepped over there'), &
      remark_kind('no mode', &
                  'no natural frequency of the free, sliding or stuck structure lies in '// &
                  'the sweep: often Hz typed for rad/s'), &
      remark_kind('undetermined mode', &
                  'a harmonic meets, to round-off, a mode without damping that no load '// &
                  'reaches, of the structure alone (within 1e-12) or with its linear '// &
                  'springs and stuck pairs (within round-off of the sums of its matrices; '// &
                  'up to 400 dofs): its motion is taken for none; a load on it makes the '// &
                  'point fail. Not looked for in sectors, in sweeps over parameters of the '// &
                  'matrices, and with harmonics%filter_harmonics. Set model%damping or '// &
                  'model%modal_damping, or move the frequency'), &
      remark_kind('peak at the end', &
                  'the largest amplitude of a quantity is at an end of the sweep'), &
      ! What could not be decided or followed to its end.
      remark_kind('stability undecided', &
                  'a multiplier is as near to the unit circle as its error: more harmonics '// &
                  'make it certain'), &
      remark_kind('peak not resolved', &
                  'a maximum could not be followed to its top: more points, or arclength; '// &
                  'where nothing but contact damps the structure, damping'), &
      remark_kind('several solutions', &
                  'pieces of a sweep (fretwear run --workers) came to different solutions '// &
                  'of the same points: those of a sweep from the start were taken'), &
      remark_kind('explained', &
                  'fw_run --explain: what was tried for points that were not found, what '// &
                  'that met, and what an integration in time comes to from there (the first '// &
                  'of at most three places where points begin to fail)'), &
      remark_kind('branch condensed', &
                  'a small structure could not be taken whole where its branch begins: '// &
                  'resonances that the unknowns of the joint do not show may be stepped '// &
                  'over')]

   !> A message: what it says, and what to do about it.
   type :: message_kind
      !> As it is shown, with dots for what differs.
      character(128) :: message
      character(320) :: remedy
   end type message_kind

   !> Only those whose remedy does not fit into the message: all others say what to do themselves.
   !> Dots stand for names and numbers; a test looks for the words between them in the sources.
   type(message_kind), parameter :: message_kinds(*) = [ &
      message_kind( &
         ! Files of earlier runs.
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
         ! Points and accuracies that were not reached.
         'point 12 of 41: ..., NOT CONVERGED', &
         'more points in the sweep; sweep in the other direction; more n_time '// &
         '(where events are located it changes little); penalty_scale 0.3 or 3; '// &
         'start away from the peak; fw_run --explain says why. Exit status 4'), &
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
         ! Branches: each ends in its own way, and what it has is kept.
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
         ! Nonlinear modes.
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
         ! Cases and models that are refused.
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
   subroutine write_remark_kinds(unit)
      !> Of a file, or of the standard output.
      integer, intent(in) :: unit
      integer :: i

      write (unit, '(a)') '| name | said where |', '|---|---|'
      do i = 1, size(remark_kinds)
         write (unit, '(5a)') '| ', trim(remark_kinds(i)%name), ' | ', &
            trim(remark_kinds(i)%meaning), ' |'
      end do
   end subroutine write_remark_kinds

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

end module fw_remark_table
