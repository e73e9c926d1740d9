!> Harmonics that meet a mode without damping of the structure as its linear springs and stuck pairs
!> hold it. No equation determines that motion: without a load on it it is taken for none, and with
!> one it grows without bound.
!>
!> With v such a motion, S = K + springs + stuck pairs - theta M, and D all that it must not move,
!> dampers and pairs that slip: (S + i D) v = 0. Among the modes near theta the least singular
!> values sigma of S + i D are compared with the round-off of the sums that S consists of,
!>
!>   sigma = delta epsilon |v|^T (|K| + springs + pairs + theta |M|) |v|.
!>
!> Where delta is about one, other matrices that round to those of the model meet the mode exactly:
!> no computation tells the two apart. Above, f = v^T (F - forces of slipping pairs) makes a motion
!> f/sigma, which is known but for round-off of f, component by component, and for a part 1/delta
!> of it. A coupling counts from the first bit on that those sums do not lose.
!>
!> Such a motion may be lost in the tolerance of the solver: 1/sigma of its residual. It is found
!> from the residual in these few modes, which their singular values solve.
module fw_undetermined
   use fw_balance_state, only: balance_state
   use fw_contact_data, only: contact_type, spring_type
   use fw_dof_rows, only: dof_row, list_rows, strains
   use fw_formed_stiffness, only: harmonic_load
   use fw_jacobi_svd, only: singular_vectors
   use fw_idle_part, only: find_motion, part_in
   use fw_joined_modes, only: find_joined_modes, joined_modes
   use fw_kinds, only: wp
   use fw_linalg, only: has_pivots
   use fw_model, only: model_type
   implicit none (type, external)
   private

   public :: undetermined_search, undetermined_note, idle_motion

   !> What is looked for, and in which structure.
   type :: undetermined_search
      !> Whether some motion may be without damping.
      logical :: is_needed = .false.
      type(model_type), allocatable, private :: model
      type(contact_type), allocatable, private :: contact
      type(spring_type), allocatable, private :: springs
      type(joined_modes), private :: modes
   contains
      procedure :: start
      procedure :: find
   end type undetermined_search

   !> Motions of one harmonic that nothing determines.
   type :: idle_motion
      !> Place of the harmonic, and motions in the dofs of the model (n_dof, n).
      integer :: h = 0
      complex(wp), allocatable :: shapes(:, :)
      !> The present motion, what is left of it without them, and what is to be added to it
      !> (n_dof).
      complex(wp), allocatable :: present(:), rest(:), change(:)
      !> A load acts on one of them; springs or stuck pairs move in one of them.
      logical :: is_driven = .false., is_held = .false.
   end type idle_motion

   !> What is to be said of them.
   type :: undetermined_note
      !> Where a motion was first taken for none [rad/s], below 0: nowhere; whether that was so at
      !> other frequencies too; the harmonic, where springs or stuck pairs hold the mode, else 0.
      real(wp) :: omega = -1.0_wp
      logical :: again = .false.
      integer :: harmonic = 0
   contains
      procedure :: take
   end type undetermined_note

   !> Beyond it, in parts of epsilon, motions are known well enough whatever they are.
   real(wp), parameter :: most_delta = 100.0_wp
   !> Round-off of f, in parts of its sums, and loads that are meant to be none: shapes that loads
   !> are made orthogonal to are good to some hundred times epsilon.
   real(wp), parameter :: load_round_off = 8.0_wp*epsilon(1.0_wp), no_load = 1.0e-13_wp
   !> Part of the largest displacement to which a motion has to be known.
   real(wp), parameter :: known = 1.0e-2_wp
   !> Part of theta within which modes are looked at: beyond, what tolerances leave is little.
   real(wp), parameter :: around = 1.0e-4_wp
   !> Part of the largest displacement from which on a motion is corrected.
   real(wp), parameter :: noticed = 1.0e-4_wp
   !> Dofs up to which the modes take little time beside the rest of a run.
   integer, parameter :: most_dofs = 400

contains

   !> Look for them from now on, unless all motions are damped.
   subroutine start(self, model, contact, springs, range)
      class(undetermined_search), intent(inout) :: self
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      !> Lowest and highest frequency of all harmonics [rad/s].
      real(wp), intent(in) :: range(2)

      self%is_needed = model%n_dof <= most_dofs .and. .not. model%cyclic%is_cyclic .and. &
                       model%loss_factor <= 0.0_wp
      if (self%is_needed) self%is_needed = .not. damps_all(model, range)
      if (.not. self%is_needed) return
      self%model = model
      self%contact = contact
      self%springs = springs
      self%modes = joined_modes()
   end subroutine start

   !> A motion without damping at theta <= theta_max, C v = 0 and v^T K v <= theta v^T M v, makes
   !> C - tau M + tau/(2 theta_max) K indefinite. Nodes without mass do not.
   logical function damps_all(model, range)
      type(model_type), intent(in) :: model
      real(wp), intent(in) :: range(2)
      !> Twice a damping ratio far above the round-off that counts as none.
      real(wp), parameter :: least_damping = 1.0e-8_wp
      real(wp) :: least

      damps_all = any(abs(model%damping) > 0.0_wp) .and. range(1) > 0.0_wp
      if (.not. damps_all) return
      least = least_damping*range(1)
      damps_all = has_pivots(model%damping - least*model%mass + &
                             0.5_wp*least/range(2)**2*model%stiffness)
   end function damps_all

   !> Where the system was evaluated last, the motions of each harmonic.
   subroutine find(self, system, x, found)
      class(undetermined_search), intent(inout) :: self
      type(balance_state), intent(inout) :: system
      !> Coefficients of the coordinates.
      real(wp), intent(in), contiguous :: x(:)
      type(idle_motion), allocatable, intent(out) :: found(:)
      type(dof_row), allocatable :: rows(:)
      type(idle_motion) :: motion
      real(wp) :: theta
      integer :: h

      allocate (found(0))
      if (.not. self%is_needed) return
      call list_rows(system, self%contact, self%springs, self%model%rows, rows)
      if (.not. self%modes%fit(rows)) call find_joined_modes(self%model, rows, self%modes)
      associate (fourier => system%problem%fourier)
         do h = 1, fourier%n_retained
            if (fourier%harmonic(h) == 0) cycle
            theta = (fourier%harmonic(h)*system%frequency())**2
            if (.not. any(self%modes%are_near(theta, around))) cycle
            call look_at(self, system, x, rows, h, motion)
            if (allocated(motion%change)) found = [found, motion]
         end do
      end associate
   end subroutine find

   subroutine look_at(self, system, x, rows, h, motion)
      type(undetermined_search), intent(in) :: self
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(dof_row), intent(in) :: rows(:)
      integer, intent(in) :: h
      type(idle_motion), intent(out) :: motion
      real(wp), allocatable :: values(:), delta(:), sizes(:, :)
      complex(wp), allocatable :: left(:, :)
      logical, allocatable :: unknown(:)
      integer, allocatable :: weak(:)
      real(wp) :: s
      integer :: j

      s = system%problem%fourier%harmonic(h)*system%frequency()
      sizes = self%modes%sizes + s**2*abs(self%model%mass) + s*abs(self%model%damping)
      call find_least(self, rows, s, sizes, values, motion%shapes, left)
      delta = [(values(j)/(epsilon(1.0_wp)*energy(sizes, motion%shapes(:, j))), &
                j=1, size(values))]
      weak = pack([(j, j=1, size(delta))], delta*epsilon(1.0_wp) <= around)
      if (size(weak) == 0) return
      motion%h = h
      motion%shapes = motion%shapes(:, weak)
      call judge(self, system, x, rows, sizes, values(weak), delta(weak), motion, unknown)
      call correct(self, system, rows, s, values(weak), left(:, weak), unknown, motion)
   end subroutine look_at

   !> Singular values of S + i D among the modes near theta, what they belong to, and rows that make
   !> the square of the value times its motion of a residual.
   subroutine find_least(self, rows, s, sizes, values, found, left)
      type(undetermined_search), intent(in) :: self
      type(dof_row), intent(in) :: rows(:)
      real(wp), intent(in) :: s, sizes(:, :)
      real(wp), allocatable, intent(out) :: values(:)
      complex(wp), allocatable, intent(out) :: found(:, :), left(:, :)
      real(wp), allocatable :: shapes(:, :), s_shapes(:, :)
      complex(wp), allocatable :: matrix(:, :), v(:, :)
      integer, allocatable :: near(:)
      integer :: j

      associate (model => self%model, modes => self%modes)
         near = pack([(j, j=1, size(modes%values))], modes%are_near(s**2, around))
         shapes = modes%shapes(:, near)
         do j = 1, size(shapes, 2)
            shapes(:, j) = shapes(:, j)/sqrt(energy(sizes, cmplx(shapes(:, j), kind=wp)))
         end do
         call modes%clean(model%mass, s**2, around, shapes)
         s_shapes = matmul(modes%stiffness - s**2*model%mass, shapes)
         do j = 1, size(rows)
            if (rows(j)%is_mixed) call rows(j)%take_from(shapes, s_shapes)
         end do
         matrix = cmplx(matmul(transpose(shapes), s_shapes), &
                        s*matmul(transpose(shapes), matmul(model%damping, shapes)) + &
                        resistance(modes, rows, sizes, shapes, s_shapes), wp)
      end associate
      allocate (values(size(shapes, 2)), v(size(shapes, 2), size(shapes, 2)))
      call singular_vectors(matrix, values, v)
      found = matmul(shapes, v)
      left = matmul(shapes, conjg(matmul(matrix, v)))
   end subroutine find_least

   !> Which of the shapes are not known, and whether loads act on them.
   subroutine judge(self, system, x, rows, sizes, values, delta, motion, unknown)
      type(undetermined_search), intent(in) :: self
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      type(dof_row), intent(in) :: rows(:)
      real(wp), intent(in) :: sizes(:, :), values(:), delta(:)
      type(idle_motion), intent(inout) :: motion
      logical, allocatable, intent(out) :: unknown(:)
      complex(wp) :: load(self%model%n_dof)
      real(wp) :: force, least, noise, size_of_rest, sums
      integer :: j

      allocate (unknown(size(values)))
      call find_load(self, system, rows, motion%h, load)
      call find_motion(system, x, motion%h, motion%present)
      motion%rest = motion%present - part_in(self%model%mass, motion%shapes(:, pack( &
         [(j, j=1, size(delta))], delta <= most_delta)), motion%present)
      size_of_rest = maxval(abs(motion%rest))
      least = 1.0_wp + 0.5_wp*sqrt(real(self%model%n_dof, wp))
      do j = 1, size(values)
         associate (v => motion%shapes(:, j))
            force = abs(sum(v*load))
            sums = dot_product(abs(v), abs(load) + matmul(sizes, abs(motion%rest)))
            noise = load_round_off*sums
            unknown(j) = delta(j) <= least .or. (delta(j) <= most_delta .and. &
                         max(noise, force/delta(j))*maxval(abs(v)) > known*values(j)*size_of_rest)
            if (.not. unknown(j)) cycle
            ! Where v is zero round-off is left of it.
            motion%is_driven = motion%is_driven .or. force > no_load*sums + &
                               load_round_off*maxval(abs(v))*sum(abs(load))
            motion%is_held = motion%is_held .or. strains(v, rows)
         end associate
      end do
   end subroutine judge

   !> Motions that are not known come to rest, and the others to what they are. Left is what is not
   !> known.
   subroutine correct(self, system, rows, s, values, left, unknown, motion)
      type(undetermined_search), intent(in) :: self
      type(balance_state), intent(in) :: system
      type(dof_row), intent(in) :: rows(:)
      real(wp), intent(in) :: s, values(:)
      complex(wp), intent(in) :: left(:, :)
      logical, intent(in) :: unknown(:)
      type(idle_motion), intent(inout) :: motion
      complex(wp), dimension(self%model%n_dof) :: added, residual
      integer :: j

      call find_residual(self, system, rows, s, motion, residual)
      added = (0.0_wp, 0.0_wp)
      do j = 1, size(values)
         if (.not. unknown(j)) added = added + &
                                       motion%shapes(:, j)*(sum(left(:, j)*residual)/values(j)**2)
      end do
      if (maxval(abs(added)) <= noticed*maxval(abs(motion%present + added))) added = 0.0_wp
      motion%shapes = motion%shapes(:, pack([(j, j=1, size(values))], unknown))
      motion%rest = motion%present - part_in(self%model%mass, motion%shapes, motion%present)
      if (any(unknown) .or. maxval(abs(added)) > 0.0_wp) then
         motion%change = motion%rest - motion%present + added
      end if
   end subroutine correct

   !> Loads less the forces of the present motion; those that hold rigid pairs are left out, as no
   !> shape moves them.
   subroutine find_residual(self, system, rows, s, motion, residual)
      type(undetermined_search), intent(in) :: self
      type(balance_state), intent(in) :: system
      type(dof_row), intent(in) :: rows(:)
      real(wp), intent(in) :: s
      type(idle_motion), intent(in) :: motion
      complex(wp), intent(out) :: residual(:)
      real(wp), dimension(size(residual), 2) :: parts, forces
      integer :: i

      call find_load(self, system, rows, motion%h, residual)
      parts = reshape([real(motion%present, wp), aimag(motion%present)], shape(parts))
      forces = matmul(self%modes%stiffness, parts) - s**2*matmul(self%model%mass, parts)
      do i = 1, size(rows)
         if (rows(i)%is_mixed .and. .not. rows(i)%is_held) call rows(i)%take_from(parts, forces)
      end do
      residual = residual - cmplx(forces(:, 1), forces(:, 2), wp) - &
                 cmplx(0.0_wp, s, wp)*matmul(self%model%damping, motion%present)
   end subroutine find_residual

   !> F less the forces of what is mixed, of one harmonic in the dofs.
   subroutine find_load(self, system, rows, h, load)
      type(undetermined_search), intent(in) :: self
      type(balance_state), intent(in) :: system
      type(dof_row), intent(in) :: rows(:)
      integer, intent(in) :: h
      complex(wp), intent(out) :: load(:)
      integer :: i, k

      associate (fourier => system%problem%fourier)
         load = system%structure_state%load_factor(h)* &
                harmonic_load(self%model%load_columns(), self%model%waves, fourier%harmonic(h), &
                              fourier%harmonic(h)*system%frequency())
         k = fourier%column(h)
      end associate
      do i = 1, size(rows)
         if (rows(i)%is_mixed) call rows(i)%add_force(-system%work(rows(i)%law)%force( &
            rows(i)%element, rows(i)%component, k:k + 1), load)
      end do
   end subroutine find_load

   !> |v|^T sizes |v|
   pure real(wp) function energy(sizes, v)
      real(wp), intent(in) :: sizes(:, :)
      complex(wp), intent(in) :: v(:)

      energy = dot_product(abs(v), matmul(sizes, abs(v)))
   end function energy

   !> Of what motions must not move: pairs that slip, and nonlinear springs, as dashpots; rigid
   !> pairs that slip bear no force of the motion either.
   function resistance(modes, rows, sizes, shapes, s_shapes) result(matrix)
      type(joined_modes), intent(in) :: modes
      type(dof_row), intent(in) :: rows(:)
      real(wp), intent(in) :: sizes(:, :), shapes(:, :), s_shapes(:, :)
      real(wp) :: matrix(size(shapes, 2), size(shapes, 2))
      real(wp) :: values(size(shapes, 2)), scale
      integer :: i, held

      matrix = 0.0_wp
      held = 0
      do i = 1, size(rows)
         if (rows(i)%is_held) held = held + 1
         if (.not. rows(i)%is_mixed) cycle
         scale = scale_of(rows(i), sizes)
         if (rows(i)%is_held) then
            ! The force of a row that depends on others is theirs.
            if (.not. modes%held%independent(held)) cycle
            values = matmul(modes%held%c(:, count(modes%held%independent(:held))), &
                            s_shapes(modes%held%pivot, :))/scale
         else
            values = rows(i)%elongation(shapes)
         end if
         matrix = matrix + scale*spread(values, 2, size(values))*spread(values, 1, size(values))
      end do
   end function resistance

   !> Stiffness about the ends of a row.
   pure real(wp) function scale_of(row, sizes)
      type(dof_row), intent(in) :: row
      real(wp), intent(in) :: sizes(:, :)
      integer :: k

      scale_of = tiny(1.0_wp)
      do k = 1, size(row%dof)
         scale_of = max(scale_of, sizes(row%dof(k), row%dof(k)))
      end do
   end function scale_of

   !> One more motion at a frequency.
   pure subroutine take(self, omega, harmonic)
      class(undetermined_note), intent(inout) :: self
      real(wp), intent(in) :: omega
      !> As of the component.
      integer, intent(in) :: harmonic

      if (self%omega < 0.0_wp) then
         self%omega = omega
         self%harmonic = harmonic
      end if
      self%again = self%again .or. abs(self%omega - omega) > 0.0_wp
   end subroutine take

end module fw_undetermined
