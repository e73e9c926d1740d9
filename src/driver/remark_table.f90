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
                  'friction can jam a body that no spring holds: normal forces at rest have '// &
                  'no upper bound (flanks with tan a <= mu)'), &
      remark_kind('body without load', &
                  'no rotation speed, radius or static load presses a body that no spring '// &
                  'holds'), &
      remark_kind('body turns', &
                  'friction alone holds a motion of a body that no spring holds: a cylinder, '// &
                  'or one point on each flank'), &
      ! What the program has chosen, and what it had to leave out.
      remark_kind('law chosen', &
                  'law was not given: ''rigid'' is taken, or ''dlft'' with instants asked '// &
                  'for (n_time, sampling = ''uniform'', histories, a method other than hbm), '// &
                  'two tangential directions or negative damping of a dof'), &
      remark_kind('law under accuracy', &
                  'with accuracy dlft and dlft_velocity are solved as rigid, the same '// &
                  'friction whose error is known'), &
      remark_kind('few instants', &
                  'law = ''regularised'': velocities so far above slip_speed that friction '// &
                  'turns round between two instants (n_time below 8 max abs(v)/v_0); not '// &
                  'under accuracy'), &
      remark_kind('sliding may turn', &
                  'sliding = ''steady'': a pair that bears moves faster than the surface at '// &
                  'some points, so that friction turns round'), &
      ! Parts of the input that change nothing: said, since they were meant to.
      remark_kind('not read', &
                  'the model file holds names that nothing reads, see model files'), &
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
                  'speed_order is not engine_order, nor its negative, nor differs by a '// &
                  'multiple of the number of sectors'), &
      ! How far the model and the number of harmonics serve.
      remark_kind('accuracy chosen', &
                  'neither n_harmonics nor accuracy was given: accuracy = 1e-2 is taken '// &
                  '(natural sweeps and points with contact or springs, without n_time, '// &
                  'histories, other methods and memory = ''carried''); steps of a session '// &
                  'keep one harmonic'), &
      remark_kind('unstable', &
                  'without contact the linear structure has a mode that grows: coriolis, '// &
                  'circulatory, unsymmetric or air forces'), &
      remark_kind('beyond reduction', &
                  'the highest harmonic of the highest frequency is above '// &
                  '/reduction/frequency of the model file'), &
      remark_kind('damping of all modes', &
                  'modal_damping of 3,000 coordinates or more takes long: '// &
                  'modal_damping_up_to takes the lowest modes'), &
      remark_kind('one harmonic', &
                  'contact or springs, and n_harmonics = 1'), &
      ! Wear: where its steps or its harmonics decide more than the law does.
      remark_kind('too few harmonics', &
                  'wear: a pair slips that with 2H+1 harmonics sticks, or slips by less than '// &
                  'half: it wears for want of harmonics (finer meshes need more)'), &
      remark_kind('steady state not confirmed', &
                  'wear: nothing wears any more with H harmonics, and a pair still does '// &
                  'with 2H+1'), &
      remark_kind('vibration jumps', &
                  'wear: beyond a depth the vibration so far does not exist; which one '// &
                  'follows was looked for without its motion'), &
      remark_kind('slip begins', &
                  'wear: the wear of a pair that begins to slip depends on the step, however '// &
                  'short'), &
      remark_kind('steps too long', &
                  'wear: explicit steps above 1/50 of the final depth overshoot a steady '// &
                  'state by half a step; other steps of first order above 1/5 of it'), &
      remark_kind('profile depends on steps', &
                  'wear: with check_steps, halved steps move the profile by more than 2 %'), &
      ! Campbell diagrams, and derivatives by parameters.
      remark_kind('campbell points', &
                  'campbell: frequencies near a crossing were not solved: its peak may be '// &
                  'missed'), &
      remark_kind('bounds without solution', &
                  'bounds: residual tractions lie behind a fold of the response; the range is '// &
                  'of those that a straight way from the middle leads to'), &
      remark_kind('population peaks', &
                  'population: maxima between rows took too many solutions: the largest '// &
                  'amplitude solved stands for them'), &
      remark_kind('derivatives of instants', &
                  '&sensitivity with contact decided at instants: take sampling = '// &
                  '''events'''), &
      remark_kind('derivatives at held eps', &
                  '&sensitivity by damping or rotation with a rigid law: its eps, which '// &
                  'follows the matrices, is held; with few harmonics derivatives may be far '// &
                  'off'), &
      remark_kind('one-sided derivatives', &
                  '&sensitivity: points where a pair is at the onset of slip or contact'), &
      remark_kind('tied peaks', &
                  '&sensitivity: points where two peaks of a period are alike'), &
      remark_kind('no derivatives', &
                  '&sensitivity: points where the response folds'), &
      ! Controlled responses and nonlinear modes: other solutions that are near.
      remark_kind('several loads', &
                  '&control: more than one load gives an amplitude, as pairs stick or slip: '// &
                  'follow the response over the load'), &
      remark_kind('branches off', &
                  'another curve branches off between two amplitudes of a nonlinear mode: '// &
                  'which one is followed may depend on steps and law (natural steps, up to '// &
                  '120 unknowns)'), &
      remark_kind('fold below the start', &
                  'the curve of a nonlinear mode turns back below mode%start: another part '// &
                  'of it may begin there'), &
      remark_kind('onset not reached', &
                  'a nonlinear mode ended before mode%end with its pairs as at rest, or its '// &
                  'first solution is above the onset: onset_amplitude is NaN'), &
      remark_kind('onset from below', &
                  'a nonlinear mode sticks up to onset_amplitude; just above no solution was '// &
                  'found: it may part there and turn back'), &
      ! Resonances over a parameter, and what a sweep may have missed between its rows.
      remark_kind('no resonance', &
                  'analysis = ''resonance'': the sweep has no maximum to follow; status 4'), &
      remark_kind('lost resonance', &
                  'analysis = ''resonance'': the resonance was lost before the last value; '// &
                  'status 4'), &
      remark_kind('corner at the resonance', &
                  'analysis = ''resonance'': the maximum is a corner of the response at some '// &
                  'values: its frequency is good to 1e-6 and has no derivative'), &
      remark_kind('optimum', &
                  'analysis = ''resonance'': the value at which the resonance is smallest'), &
      remark_kind('another peak', &
                  'rows of a joint that opens are so far apart that a higher resonance may '// &
                  'lie between them; analysis = ''resonance'': at the last value the sweep '// &
                  'is larger elsewhere'), &
      remark_kind('internal resonance', &
                  'a harmonic of a nonlinear mode meets another mode with stuck or sliding '// &
                  'pairs: a narrow tongue of the curve may be stepped over'), &
      remark_kind('no mode', &
                  'no natural frequency of the free, sliding or stuck structure lies in the '// &
                  'sweep: often Hz typed for rad/s'), &
      remark_kind('repeated mode', &
                  'analysis = ''ringdown'': another mode has the frequency of the one that is '// &
                  'released, and its shape is one of many'), &
      remark_kind('undetermined mode', &
                  'a harmonic meets, to round-off, a mode without damping that no load '// &
                  'reaches, of the structure alone or (up to 400 dofs) with linear springs '// &
                  'and stuck pairs: its motion is taken for none; a load on it makes the '// &
                  'point fail. Not looked for in sectors, sweeps over the matrices and with '// &
                  'filter_harmonics. Set model%damping or model%modal_damping, or move the '// &
                  'frequency'), &
      remark_kind('peak at the end', &
                  'the largest amplitude of a quantity is at an end of the sweep'), &
      ! What could not be decided or followed to its end.
      remark_kind('stability undecided', &
                  'a multiplier is as near to the unit circle as its error: more harmonics '// &
                  'make it certain'), &
      remark_kind('peak not resolved', &
                  'a maximum was not followed to its top: more points, or arclength; where '// &
                  'contact alone damps, damping'), &
      remark_kind('several solutions', &
                  'pieces of a sweep (fretwear run --workers) came to different solutions of '// &
                  'a point: those of a sweep from the start were taken'), &
      remark_kind('explained', &
                  'fw_run --explain: what was tried for points that were not found, and what '// &
                  'an integration comes to (where points begin to fail, three places at most)'), &
      remark_kind('branch condensed', &
                  'a structure could not be taken whole where its branch begins: resonances '// &
                  'that the joint does not show may be stepped over')]

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
         '--restart goes on with the same case only: take the value back, or start from the '// &
         'depths with &contact worn'), &
      message_kind( &
         'x.h5: no step was saved before the run ended', &
         'start anew'), &
      message_kind( &
         '&contact worn x.h5: ...', &
         'name the result of a wear run of a joint with as many pairs'), &
      message_kind( &
         ! Points and accuracies that were not reached.
         'point 12 of 41: ..., NOT CONVERGED', &
         'more points in the sweep, the other direction, a start away from the peak; more '// &
         'n_time where contact is sampled; penalty_scale 0.3 or 3; fw_run --explain says '// &
         'why. Exit status 4'), &
      message_kind( &
         'accuracy 1.00E-03 is missed at 7 points, ...', &
         'the error of points whose /error_estimate is above accuracy is larger: raise '// &
         'n_harmonics (the most that may be used), or ask for less. Exit status 0'), &
      message_kind( &
         '... finer balances were given up at 2 of them (first at 5.00E-02 rad/s, '// &
         'after 143 iterations with up to 15 harmonics)', &
         'more harmonics came no nearer to the accuracy there: ask for less, or give '// &
         'n_harmonics'), &
      message_kind( &
         ! Branches: each ends in its own way, and what it has is kept.
         'branch: its points run away at a constant parameter: ...', &
         'all contact slips, and friction alone cannot hold the structure: support it, by a '// &
         'weak linear &spring. Exit status 4'), &
      message_kind( &
         'branch: no continuation was found at ...', &
         'other first steps (n_points), a start from the other end, or a natural sweep; what '// &
         'the branch has is kept. Exit status 4'), &
      message_kind( &
         'branch: it turned back on itself, ...', &
         'the branch retraced its own points from the frequency named [rad/s], by round-off '// &
         'at a kink: other first steps (n_points), a start from the other end, or a natural '// &
         'sweep. Exit status 4'), &
      message_kind( &
         'branch: it returned to the start ...', &
         'the branch came back to the frequency start with another response: start from the '// &
         'other end. Exit status 4'), &
      message_kind( &
         'branch: not at its end when the time of the run was over', &
         'case%max_seconds ended it; what it has is kept. Exit status 6'), &
      message_kind( &
         ! Nonlinear modes.
         'the mode ended: no solution was found beyond ...', &
         'with mode%continuation = ''natural'' the curve may fold: take ''arclength''. Or '// &
         'nothing holds the structure once all pairs slip; what the curve has is kept'), &
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
