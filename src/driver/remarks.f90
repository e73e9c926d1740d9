!> What is allowed and seldom meant: it is said, in the summary and in the result, and never ends a
!> run.
module fw_remarks
   use fw_body, only: body_type
   use fw_case, only: analyses, case_type
   use fw_force_law, only: law_facts
   use fw_joint_modes, only: held_stiffness, joint_mode_type, most_dofs, state_sliding
   use fw_kinds, only: pi, wp
   use fw_lapack, only: dpotrf
   use fw_held_bodies, only: body_hold, find_hold
   use fw_harmonics_options, only: method_hbm, sampling_uniform
   use fw_law_text, only: law_text
   use fw_laws, only: facts_of, law_under_accuracy, law_words, is_of_high_order
   use fw_parameters, only: loss_factor, modal_damping, rayleigh_mass, rayleigh_stiffness
   use fw_peak, only: found_bound, found_unresolved, peak_type
   use fw_modes, only: mode_type
   use fw_result_group, only: group_writer, result_group
   use fw_sector_modes, only: find_sector_modes
   use fw_side, only: terms_of
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   use fw_undetermined, only: undetermined_note
   implicit none (type, external)
   private

   public :: remark_list, remark_input, remark_range, remark_peaks, remark_open, remark_stability
   public :: remark_condensed, remark_undetermined, remark_unused, is_shaken, is_undamped

   !> Friction coefficients above it are no dry friction of metals.
   real(wp), parameter :: highest_friction = 2.0_wp
   !> Part of its entries by which a matrix may miss being positive: round-off of the reductions
   !> that models come from.
   real(wp), parameter :: round_off = 1.0e-9_wp

   !> Names by which programs know remarks, and their texts.
   type, extends(result_group) :: remark_list
      type(string_type), allocatable :: name(:), text(:)
   contains
      procedure :: write => write_remarks
      procedure :: add
      procedure :: count => count_remarks
   end type remark_list

contains

   !> Nothing where there is none.
   subroutine write_remarks(self, to)
      class(remark_list), intent(in) :: self
      type(group_writer), intent(inout) :: to

      if (self%count() == 0) return
      call to%put('/remarks/name', self%name)
      call to%put('/remarks/text', self%text)
   end subroutine write_remarks

   !> A name for programs and a text for people.
   subroutine add(self, name, text)
      class(remark_list), intent(inout) :: self
      character(*), intent(in) :: name, text

      if (.not. allocated(self%name)) allocate (self%name(0), self%text(0))
      call append(self%name, name)
      call append(self%text, text)
   end subroutine add

   !> How many there are until now.
   pure integer function count_remarks(self) result(n)
      class(remark_list), intent(in) :: self

      n = 0
      if (allocated(self%name)) n = size(self%name)
   end function count_remarks

   !> Of the structure, its joint and its loads.
   subroutine remark_input(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      character(24) :: name
      real(wp), allocatable :: stiffness(:, :)

      ! A part that its contact holds may well be softened by rotation.
      call held_stiffness(case, state_sliding, stiffness)
      if (is_negative(stiffness)) call remarks%add('negative stiffness', &
         'the stiffness matrix is not positive: some deformation gives off energy, and nothing '// &
         'holds the structure where it is')
      if (is_negative(case%model%mass)) call remarks%add('negative mass', &
         'the mass matrix is not positive: motions have negative kinetic energy, as of signs '// &
         'or entries off the diagonal that are wrong; resonances are none of a structure then')
      if (is_negative(case%model%damping)) call remarks%add('negative damping', &
         'the damping matrix is not positive: some motion gains energy (flutter, where it is '// &
         'meant); a periodic response need not be the one that is seen')
      if (case%contact%n_pairs > 0) then
         if (maxval(case%contact%mu) > highest_friction) call remarks%add('high friction', &
            'contact%mu is up to '//to_text(maxval(case%contact%mu))//': dry friction of '// &
            'metals is below '//to_text(highest_friction))
         call case%contact%constants%first_unused(name)
         if (len_trim(name) > 0) call remarks%add('constant not used', &
            'the model gives contact%'//trim(name)//', which contact%law = '// &
            trim(law_text(case%contact))//' does not take')
      end if
      ! A mode has none.
      if (.not. (is_shaken(case) .or. analyses(case%analysis)%is_free)) then
         call remarks%add('no load', 'no vibratory load acts: the response is that at rest; '// &
                          'set load%cosine or load%sine (with a model file, load%harmonic_scale)')
      end if
      call remark_order(case, remarks)
      call remark_unstable(case, remarks)
      call remark_unused(case, remarks)
      call remark_reduction(case, remarks)
      call remark_harmonics(case, remarks)
      call remark_law(case, remarks)
      call remark_tail(case, remarks)
      call remark_bodies(case, remarks)
   end subroutine remark_input

   !> Bodies that forces without a load can hold, that have none, or that normals leave a motion.
   subroutine remark_bodies(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      type(body_hold) :: hold
      type(string_type), allocatable :: numbers(:)
      integer :: i, k

      if (.not. allocated(case%bodies)) return
      do i = 1, case%bodies%count()
         call find_hold(case, i, hold)
         if (hold%has_springs) cycle
         associate (name => case%bodies%name(i)%text)
            if (hold%locks_itself) call remarks%add('self-locking', 'body '//name//' can be '// &
               'jammed: friction holds forces of its pairs without a load, and its normal '// &
               'forces at rest have no upper bound')
            if (.not. hold%is_loaded) call remarks%add('body without load', 'nothing presses '// &
               'body '//name//' against its flanks: give model%rotation_speed, and a radius '// &
               'and a direction in /body')
            if (hold%n_by_normals == hold%n_motions) cycle
            allocate (numbers(0))
            do k = 1, size(hold%touches)
               if (hold%touches(k)) call append(numbers, to_text(k))
            end do
            call remarks%add('body turns', 'the normals of body '//name//' (pairs '// &
               trim(list_of(numbers))//') hold '//to_text(hold%n_by_normals)//' of its '// &
               to_text(hold%n_motions)//' motions: friction alone holds the others, and '// &
               'nothing where all its pairs slip')
            deallocate (numbers)
         end associate
      end do
   end subroutine remark_bodies

   !> A load at rest that a wave meets has the order that the speed has to the frequency.
   subroutine remark_order(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      integer :: order

      associate (cyclic => case%model%cyclic, speed_order => case%sweep%speed_order)
         if (speed_order <= 0.0_wp .or. .not. cyclic%has_sectors()) return
         order = nint(speed_order)
         if (abs(speed_order - order) <= 0.0_wp .and. any( &
             modulo([order - cyclic%engine_order, order + cyclic%engine_order], &
                    cyclic%n_sectors) == 0)) return
         call remarks%add('another order', 'sweep%speed_order = '//to_text(speed_order)// &
            ' is not the order of the wave, cyclic%engine_order = '// &
            to_text(cyclic%engine_order)//' of '//to_text(cyclic%n_sectors)// &
            ' sectors: the load does not stand still')
      end associate
   end subroutine remark_order

   !> Forces across the motion, of bearings or seals, may feed it.
   subroutine remark_unstable(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      !> All frequencies [rad/s], and no held component of pairs.
      real(wp), parameter :: all_of_them(*) = [0.0_wp, 1.0e9_wp]
      integer, parameter :: none_held = 4
      !> Growth of round-off, in parts of the frequency.
      real(wp), parameter :: least = 1.0e-9_wp
      type(body_type) :: body
      type(mode_type), allocatable :: modes(:)
      real(wp) :: range(2)
      integer :: i

      if (.not. case%model%cyclic%is_alone) return
      range = case%sweep%range()
      call case%stand_at(range(2), body)
      call find_sector_modes(body, 1, none_held, all_of_them, modes)
      do i = 1, size(modes)
         if (modes(i)%width >= -least*modes(i)%omega) cycle
         call remarks%add('unstable', 'the linear structure without contact is unstable: its '// &
            'motion of '//to_text(modes(i)%omega)//' rad/s grows by exp('// &
            to_text(-0.5_wp*modes(i)%width)//' t); a periodic response is not seen unless '// &
            'something else holds it')
         return
      end do
   end subroutine remark_unstable

   !> What was given and has no effect.
   subroutine remark_unused(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      integer :: n

      if (allocated(case%unread)) then
         if (size(case%unread) > 0) call remarks%add('not read', 'the model file holds '// &
            trim(list_of(case%unread))//', which nothing reads; fw_run --parts lists what is read')
      end if
      if (case%idle_contact) call remarks%add('no pairs', '&contact is given, but there are no '// &
         'contact pairs, and it has no effect: contact%n_pairs and side_1 give some')
      if (case%idle_spring) call remarks%add('no springs', '&spring is given, but there are no '// &
         'springs, and it has no effect: spring%n_springs and side_1 give some')
      n = 0
      associate (c => case%contact)
         if (c%n_pairs > 0) n = count(abs(c%gap) > 0.0_wp .and. c%side_1(3, :) == 0 .and. &
                                      c%side_2(3, :) == 0)
      end associate
      if (n > 0) call remarks%add('gap not used', 'contact%gap has no effect on '//to_text(n)// &
         ' pairs, which have no normal dof: contact%normal_load presses them')
   end subroutine remark_unused

   !> `a, b, c and 7 more`.
   pure function list_of(names) result(text)
      type(string_type), intent(in) :: names(:)
      character(300) :: text
      integer, parameter :: most = 5
      integer :: i

      text = names(1)%text
      do i = 2, min(size(names), most)
         text = trim(text)//', '//names(i)%text
      end do
      if (size(names) > most) text = trim(text)//' and '//to_text(size(names) - most)//' more'
   end function list_of

   !> Whether a vibratory load acts.
   pure logical function is_shaken(case)
      type(case_type), intent(in) :: case

      is_shaken = any(abs(case%model%load_cosine) > 0.0_wp) .or. &
                  any(abs(case%model%load_sine) > 0.0_wp)
      if (allocated(case%model%load_wave)) then
         is_shaken = is_shaken .or. any(abs(case%model%load_wave) > 0.0_wp)
      end if
      ! An obstacle that moves shakes, too.
      is_shaken = is_shaken .or. case%contact%highest_gap() > 0
   end function is_shaken

   !> Whether nothing but its contact could damp the structure.
   pure logical function is_undamped(case)
      type(case_type), intent(in) :: case

      is_undamped = .not. (case%model%cyclic%is_cyclic .or. case%model%loss_factor > 0.0_wp)
      ! That of the case as it was read is none of the values of a sweep over it.
      if (any(case%varied == [modal_damping, rayleigh_mass, rayleigh_stiffness, loss_factor])) then
         is_undamped = .false.
      end if
      if (is_undamped .and. allocated(case%model%damping)) then
         is_undamped = .not. any(abs(case%model%damping) > 0.0_wp)
      end if
   end function is_undamped

   !> Where another law than the word of the user is solved.
   subroutine remark_law(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      character(:), allocatable :: word
      integer :: solved

      associate (contact => case%contact)
         word = trim(law_text(contact))
         if (contact%law_is_chosen) then
            call remarks%add('law chosen', 'nothing was said of contact%law: rigid friction '// &
               'is taken, by '//word//trim(why_not_rigid(case)))
            return
         end if
         if (.not. case%harmonics%accuracy > 0.0_wp) return
         solved = law_under_accuracy(contact, case%harmonics%sampling == sampling_uniform)
         if (solved /= contact%law) call remarks%add('law under accuracy', 'with '// &
            "harmonics%accuracy contact%law = "//word//" is solved as '"// &
            trim(law_words(solved))//"', the same friction, whose error is known")
      end associate
   end subroutine remark_law

   !> Why the law that was chosen is not the one of high order.
   pure function why_not_rigid(case) result(words)
      type(case_type), intent(in) :: case
      character(140) :: words

      words = ''
      associate (c => case%contact, h => case%harmonics)
         if (is_of_high_order(c%law)) return
         if (any(all(c%side_1(1:2, :) /= 0 .or. c%side_2(1:2, :) /= 0, dim=1))) then
            words = "slip in two directions has no law of high order"
         else if (h%method /= method_hbm .or. h%sampling == sampling_uniform .or. h%n_time > 0 &
                  .or. case%output%histories) then
            words = "instants are asked for, and 'rigid' follows events"
         else
            words = "'rigid' needs positive damping of every dof"
         end if
      end associate
      words = ', as '//trim(words)//': not of high order on masses'
   end function why_not_rigid

   !> Where a law that follows the motion above the harmonics cannot.
   subroutine remark_tail(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      type(law_facts) :: facts
      logical :: impacts
      integer :: i

      associate (contact => case%contact)
         if (contact%n_pairs == 0) return
         facts = facts_of(contact)
         if (.not. facts%has_tail) return
         if (any(all(contact%side_1(1:2, :) /= 0 .or. contact%side_2(1:2, :) /= 0, dim=1))) then
            call remarks%add('two directions', 'slip in two directions is solved with the '// &
                             'stiffness that the structure has above the harmonics, and '// &
                             'without its mass there: not of high order on masses')
         end if
         impacts = .false.
         do i = 1, contact%n_pairs
            impacts = impacts .or. has_mass(case, contact%side_1(3, i)) .or. &
                      has_mass(case, contact%side_2(3, i))
         end do
         if (impacts) call remarks%add('impact on mass', 'a normal dof has mass: where it '// &
            'lifts off and lands, errors fall with 1/H only, as impacts of masses have a tail '// &
            "that the law does not follow; law = 'penalty' has it in its springs")
      end associate
   end subroutine remark_tail

   !> Whether a side has any; the ground has none.
   pure logical function has_mass(case, side)
      type(case_type), intent(in) :: case
      integer, intent(in) :: side
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)
      integer :: i

      call terms_of(side, dof, weight, case%model%rows)
      has_mass = any([(case%model%mass(dof(i), dof(i)) > 0.0_wp, i=1, size(dof))])
   end function has_mass

   !> A model that was reduced up to a frequency says nothing above it; modal damping of large
   !> models takes long.
   subroutine remark_reduction(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks
      integer, parameter :: large = 3000
      ! The frequency of the file may be that of the case, but for round-off.
      real(wp), parameter :: above = 1.0_wp + 1.0e-9_wp
      real(wp) :: range(2), highest
      integer :: harmonic

      range = case%sweep%start
      if (case%sweep%end > 0.0_wp .or. allocated(case%sweep%frequencies)) range = case%sweep%range()
      ! Of an accuracy n_harmonics is a limit that points seldom come to.
      harmonic = merge(1, case%harmonics%n_harmonics, case%harmonics%accuracy > 0.0_wp)
      highest = range(2)/(2.0_wp*pi)*harmonic
      if (case%reduced_up_to > 0.0_wp .and. highest > above*case%reduced_up_to .and. &
          analyses(case%analysis)%has_points) then
         call remarks%add('beyond reduction', 'the model was reduced to an accuracy up to '// &
            to_text(rounded(case%reduced_up_to))//' Hz, and harmonic '// &
            to_text(harmonic)//' reaches '//to_text(rounded(highest))// &
            ' Hz: reduce it with --up-to of that')
      end if
      if (case%damps_modes .and. .not. case%damps_modes_up_to > 0.0_wp .and. &
          case%model%n_dof >= large .and. .not. case%model%cyclic%is_cyclic) then
         call remarks%add('damping of all modes', 'model%modal_damping of '// &
            to_text(case%model%n_dof)//' coordinates takes all their modes, and long: '// &
            'model%modal_damping_up_to takes the lowest ones')
      end if
   end subroutine remark_reduction

   !> One harmonic says little of a joint.
   subroutine remark_harmonics(case, remarks)
      type(case_type), intent(in) :: case
      type(remark_list), intent(inout) :: remarks

      if (case%harmonics%is_chosen) call remarks%add('accuracy chosen', 'nothing was said of '// &
         'the harmonics: they are chosen for harmonics%accuracy = '// &
         to_text(case%harmonics%accuracy)//'; give one of both')
      if (case%harmonics%n_harmonics > 1) return
      if (.not. case%is_nonlinear()) return
      call remarks%add('one harmonic', 'the balance keeps one harmonic, and friction or gaps '// &
                       'may be off by half with it: set harmonics%accuracy, or compare with '// &
                       'more harmonics%n_harmonics')
   end subroutine remark_harmonics

   !> Of the range of a sweep.
   subroutine remark_range(case, modes, remarks)
      type(case_type), intent(in) :: case
      !> Those within the range.
      type(joint_mode_type), intent(in) :: modes(:)
      type(remark_list), intent(inout) :: remarks
      character(:), allocatable :: text
      real(wp) :: range(2)

      if (size(modes) > 0 .or. case%model%n_dof > most_dofs) return
      range = [min(case%sweep%start, case%sweep%end), max(case%sweep%start, case%sweep%end)]
      text = 'no natural frequency of the free or the stuck structure lies in the sweep, '// &
             to_text(rounded(range(1)/(2.0_wp*pi)))//' to '// &
             to_text(rounded(range(2)/(2.0_wp*pi)))//' Hz: is sweep%unit the one meant?'
      call remarks%add('no mode', text)
   end subroutine remark_range

   !> Of what was found.
   subroutine remark_peaks(peaks, names, undamped, remarks)
      type(peak_type), intent(in) :: peaks(:)
      !> Observed quantities.
      type(string_type), intent(in) :: names(:)
      !> Whether the structure has no damping of its own.
      logical, intent(in) :: undamped
      type(remark_list), intent(inout) :: remarks
      integer :: i, k, best, n_bound, n_open
      character(:), allocatable :: first, remedy

      n_bound = 0
      do i = 1, size(names)
         ! The highest maximum of each quantity, where it has any.
         best = 0
         do k = 1, size(peaks)
            if (peaks(k)%observed /= i) cycle
            if (best == 0) best = k
            if (peaks(k)%amplitude > peaks(best)%amplitude) best = k
         end do
         if (best == 0) cycle
         if (peaks(best)%found_by /= found_bound) cycle
         n_bound = n_bound + 1
         if (n_bound == 1) first = names(i)%text
      end do
      if (n_bound > 0) call remarks%add('peak at the end', 'the largest amplitude of '//first// &
         trim(others(n_bound - 1))//' is at an end of the sweep: it may rise further outside')
      n_open = count(peaks%found_by == found_unresolved)
      remedy = 'take more points around them (/peak/omega), or continuation = ''arclength'''
      if (undamped) remedy = 'nothing but contact damps the structure, and a resonance without '// &
                             'damping has no height: set model%damping or model%modal_damping'
      if (n_open > 0) call remarks%add('peak not resolved', to_text(n_open)// &
         ' of '//to_text(size(peaks))//' maxima are not resolved: '//remedy)
   end subroutine remark_peaks

   !> Of rows that are too far apart for the resonances of a joint that opens.
   subroutine remark_open(range, n_open, remarks)
      !> Where they may lie [rad/s], and in how many intervals between rows.
      real(wp), intent(in) :: range(2)
      integer, intent(in) :: n_open
      type(remark_list), intent(inout) :: remarks

      if (n_open > 0) call remarks%add('another peak', 'in '//to_text(n_open)//' intervals '// &
         'between '//to_text(rounded(range(1)))//' and '//to_text(rounded(range(2)))// &
         ' rad/s a resonance of the joint, which opens within the period, may lie between the '// &
         'points and be the highest: take more points there')
   end subroutine remark_open

   !> Of a branch of a small structure that could not be taken whole.
   subroutine remark_condensed(remarks)
      type(remark_list), intent(inout) :: remarks

      call remarks%add('branch condensed', 'the structure without condensation did not '// &
         'converge where the branch begins: it was followed by the unknowns of its joint, '// &
         'and a resonance that these do not show may be stepped over; loosen '// &
         'solver%tolerance, or compare with a natural sweep')
   end subroutine remark_condensed

   !> Of modes that are met, not damped, and not loaded.
   subroutine remark_undetermined(note, remarks)
      type(undetermined_note), intent(in) :: note
      type(remark_list), intent(inout) :: remarks
      character(:), allocatable :: where_else, met

      if (note%omega < 0.0_wp) return
      where_else = ''
      if (note%again) where_else = ', and at further frequencies,'
      met = ' a harmonic meets a mode without damping that neither contact nor load reaches'
      if (note%harmonic > 0) met = ' harmonic '//to_text(note%harmonic)//' meets a mode without'// &
         ' damping that no load reaches, of the structure with its linear springs and stuck pairs'
      call remarks%add('undetermined mode', 'at '//to_text(rounded(note%omega))//' rad/s'// &
         where_else//met//': its motion follows from nothing and is taken for none; set '// &
         'model%damping or model%modal_damping, or move the frequency')
   end subroutine remark_undetermined

   !> Of verdicts on stability that nothing stands behind.
   subroutine remark_stability(n_undecided, n_points, remarks)
      integer, intent(in) :: n_undecided
      !> Points with multipliers.
      integer, intent(in) :: n_points
      type(remark_list), intent(inout) :: remarks

      if (n_undecided > 0) call remarks%add('stability undecided', 'at '//to_text(n_undecided)// &
         ' of '//to_text(n_points)//' points a multiplier is as near to the unit circle as its '// &
         'error (/floquet/error): more harmonics%n_harmonics make it certain')
   end subroutine remark_stability

   !> How many more of a kind there are than the one that is shown.
   pure function others(n) result(words)
      integer, intent(in) :: n
      character(20) :: words

      words = ''
      if (n > 0) write (words, '(a, i0, a)') ' and of ', n, ' more'
   end function others

   !> Whether a symmetric matrix has negative directions beyond round-off, its rows being scaled.
   logical function is_negative(matrix)
      real(wp), intent(in) :: matrix(:, :)
      real(wp), allocatable :: factor(:, :)
      real(wp) :: scale(size(matrix, 1))
      integer :: i, j, n, info

      n = size(matrix, 1)
      allocate (factor(n, n))
      do i = 1, n
         scale(i) = sqrt(maxval(abs(matrix(:, i))))
      end do
      where (scale <= 0.0_wp) scale = 1.0_wp
      ! Cholesky's method on the scaled matrix with round_off added to its diagonal: it fails where
      ! a direction is negative by more than that.
      do j = 1, n
         factor(:, j) = matrix(:, j)/(scale*scale(j))
         factor(j, j) = factor(j, j) + round_off
      end do
      call dpotrf('U', n, factor, n, info)
      is_negative = info > 0
   end function is_negative

   !> Four digits are enough to read.
   real(wp) function rounded(number)
      real(wp), intent(in) :: number
      character(24) :: buffer

      write (buffer, '(es24.3e3)') number
      read (buffer, *) rounded
   end function rounded

end module fw_remarks
