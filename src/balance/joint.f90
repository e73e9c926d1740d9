!> The nonlinear coordinates of a case: which components of which pairs, which springs and other
!> elements can move at all, and the relative coordinates that carry them.
module fw_joint
   use fw_kinds, only: wp
   use fw_case_forces, only: element_rows
   use fw_contact_data, only: contact_type, spring_type, memory_carried, memory_residual
   use fw_cyclic_relative, only: cyclic_relative, new_cyclic_relative
   use fw_elements, only: element_list
   use fw_error, only: error_type, fatal_error, status_input
   use fw_force_law, only: law_facts
   use fw_laws, only: facts_of, pairs_are_rigid
   use fw_model, only: model_type
   use fw_relative, only: relative_type, new_relative
   use fw_side, only: add_side, largest_weight, terms_of
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: joint_type, new_joint, turn_joint

   type :: joint_type
      !> Rows of pairs and springs, and the coordinates that they are combinations of.
      type(relative_type) :: relative
      !> Row of each component of each pair, 0 where it is absent or can never move (3, n_pairs).
      integer, allocatable :: row(:, :)
      !> Row of each spring (n_springs).
      integer, allocatable :: spring_row(:)
      !> Rows of the inputs of other elements, for each kind; elements share rows of the same dofs.
      type(element_rows), allocatable :: element_row(:)
      !> Components that nothing ever moves (3, n_pairs), and how many of them were dropped.
      logical, allocatable :: idle(:, :)
      integer :: n_idle = 0
      !> Whether the solution has odd harmonics only (u(t + T/2) = -u(t)).
      logical :: half_wave_symmetric = .false.
      !> Of a cyclic structure: the coordinates of every nodal diameter, and, where all sectors are
      !> solved for, which row of which sector each is (from 0), see `lay_out_all`.
      type(cyclic_relative) :: cyclic
      !> The same without rows in which sectors differ, where there are such.
      type(cyclic_relative), allocatable :: tuned
      integer, allocatable :: row_in_sector(:), sector(:)
      !> Of a structure that is its only sector: the same as of one that is none.
      type(relative_type), allocatable :: alone
   contains
      procedure :: wave_weights
   end type joint_type

contains

   subroutine new_joint(model, contact, springs, elements, skip_idle, self, error)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      !> Leave out components that nothing moves.
      logical, intent(in) :: skip_idle
      type(joint_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: side_1(:), side_2(:), sector_2(:), first(:)
      logical, allocatable :: moving(:), rigid(:)
      integer :: i, c, k, n_pairs, n_rows, n_springs, n_others, n_own

      ! Before the rows are numbered: what never moves needs none.
      call find_moving_dofs(model, contact, springs, elements, moving)
      allocate (self%row(3, contact%n_pairs), source=0)
      allocate (self%idle(3, contact%n_pairs), source=.false.)
      ! Pairs and springs of all sectors are those of the first.
      n_pairs = contact%n_pairs/model%cyclic%n_solved()
      n_springs = springs%n_springs/model%cyclic%n_solved()
      allocate (side_1(0), side_2(0), sector_2(0))
      n_rows = 0
      ! Rigid pairs first: their displacements are to be coordinates, on which those of others may
      ! depend.
      rigid = pairs_are_rigid(contact)
      first = [pack([(i, i=1, n_pairs)], rigid(:n_pairs)), &
               pack([(i, i=1, n_pairs)], .not. rigid(:n_pairs))]
      do k = 1, n_pairs
         i = first(k)
         do c = 1, 3
            ! Ground against ground: the component is absent.
            if (contact%side_1(c, i) == 0 .and. contact%side_2(c, i) == 0) cycle
            self%idle(c, i) = .not. any(moving(dofs_of(model, [contact%side_1(c, i), &
                                                               contact%side_2(c, i)])))
            if (self%idle(c, i) .and. skip_idle) then
               self%n_idle = self%n_idle + 1
               cycle
            end if
            n_rows = n_rows + 1
            self%row(c, i) = n_rows
            side_1 = [side_1, contact%side_1(c, i)]
            side_2 = [side_2, contact%side_2(c, i)]
            sector_2 = [sector_2, sector_of(contact%sector_2, i)]
         end do
      end do
      self%spring_row = [(n_rows + i, i=1, n_springs)]
      if (n_springs > 0) then
         side_1 = [side_1, springs%side_1(:n_springs)]
         side_2 = [side_2, springs%side_2(:n_springs)]
         sector_2 = [sector_2, (sector_of(springs%sector_2, i), i=1, n_springs)]
      end if
      n_others = n_rows + n_springs
      call list_elements(elements, n_others, side_1, side_2, sector_2, self%element_row)
      call check_differ(model, side_1, side_2, sector_2, error)
      if (allocated(error)) return
      n_own = 0
      if (allocated(model%cyclic%deviation)) n_own = size(model%cyclic%deviation%rows, 1)
      if (model%cyclic%is_mistuned) call repeat_rows(model%cyclic%n_sectors, n_pairs, n_rows, &
                                                     size(side_1) - n_others + n_own, self)
      self%half_wave_symmetric = symmetric(model, contact, springs, elements, self)
      if (model%cyclic%is_cyclic) then
         if (n_own > 0) then
            allocate (self%tuned)
            call new_cyclic_relative(model, side_1, side_2, sector_2, self%tuned)
            call new_cyclic_relative(model, side_1, side_2, sector_2, self%cyclic, &
                                     model%cyclic%deviation%rows)
         else
            call new_cyclic_relative(model, side_1, side_2, sector_2, self%cyclic)
         end if
         if (.not. model%cyclic%is_alone) return
         allocate (self%alone)
         call new_relative(model%n_dof, side_1, side_2, self%alone, model%rows)
         return
      end if
      call new_relative(model%n_dof, side_1, side_2, self%relative, model%rows)
      call check_independent(contact, self, error)
   end subroutine new_joint

   !> Rows of the model may say the same displacement by other numbers, which a reader sees of dofs.
   subroutine check_differ(model, side_1, side_2, sector_2, error)
      type(model_type), intent(in) :: model
      integer, intent(in) :: side_1(:), side_2(:), sector_2(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: round_off = 1.0e-10_wp
      real(wp) :: row(model%n_dof)
      integer :: r

      if (.not. allocated(model%rows)) return
      do r = 1, size(side_1)
         if (sector_2(r) /= 0) cycle
         row = 0.0_wp
         call add_side(side_1(r), 1.0_wp, row, model%rows)
         call add_side(side_2(r), -1.0_wp, row, model%rows)
         if (maxval(abs(row)) > round_off*largest_weight(side_1(r), model%rows)) cycle
         call fatal_error(error, 'sides '//to_text(side_1(r))//' and '//to_text(side_2(r))// &
                          ' of a pair, a spring or another element are the same displacement '// &
                          'by model%row: they must differ', status_input)
         return
      end do
   end subroutine check_differ

   !> The dofs that sides are made of.
   pure function dofs_of(model, sides) result(dofs)
      type(model_type), intent(in) :: model
      integer, intent(in) :: sides(:)
      integer, allocatable :: dofs(:)
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)
      integer :: i

      allocate (dofs(0))
      do i = 1, size(sides)
         call terms_of(sides(i), dof, weight, model%rows)
         dofs = [dofs, dof]
      end do
   end function dofs_of

   !> Rows of the inputs of elements, behind those that there are: one for each difference of dofs.
   pure subroutine list_elements(elements, n_before, side_1, side_2, sector_2, element_row)
      type(element_list), intent(in) :: elements
      !> Rows of pairs and springs.
      integer, intent(in) :: n_before
      integer, allocatable, intent(inout) :: side_1(:), side_2(:), sector_2(:)
      type(element_rows), allocatable, intent(out) :: element_row(:)
      integer :: c, i, k, r

      if (.not. allocated(elements%slot)) then
         allocate (element_row(0))
         return
      end if
      allocate (element_row(size(elements%slot)))
      do k = 1, size(elements%slot)
         associate (group => elements%slot(k)%group)
            allocate (element_row(k)%row(group%n_in, group%n_elements), source=0)
            do i = 1, group%n_elements
               do c = 1, group%n_in
                  associate (one => group%row_side_1(c, i), two => group%row_side_2(c, i), &
                             sector => group%row_sector_2(c, i))
                     if (one == 0 .and. two == 0) cycle
                     do r = n_before + 1, size(side_1)
                        if (side_1(r) == one .and. side_2(r) == two .and. &
                            sector_2(r) == sector) exit
                     end do
                     if (r > size(side_1)) then
                        side_1 = [side_1, one]
                        side_2 = [side_2, two]
                        sector_2 = [sector_2, sector]
                     end if
                     element_row(k)%row(c, i) = r
                  end associate
               end do
            end do
         end associate
      end do
   end subroutine list_elements

   !> Rows of the pairs of all sectors, sector after sector, then those of the springs, then those
   !> of other elements.
   pure subroutine repeat_rows(n_sectors, n_pairs, n_rows, n_others, self)
      integer, intent(in) :: n_sectors
      !> Pairs of a sector, and their rows; rows of elements that are neither pairs nor springs.
      integer, intent(in) :: n_pairs, n_rows, n_others
      type(joint_type), intent(inout) :: self
      integer, allocatable :: first(:, :), others(:, :), springs(:)
      integer :: i, j, k, last, n

      first = self%row(:, :n_pairs)
      springs = self%spring_row
      n = size(springs)
      deallocate (self%spring_row)
      allocate (self%spring_row(n*n_sectors))
      last = n_sectors*(n_rows + n)
      allocate (self%row_in_sector(last + n_others*n_sectors))
      allocate (self%sector(last + n_others*n_sectors))
      do j = 0, n_sectors - 1
         self%row(:, j*n_pairs + 1:(j + 1)*n_pairs) = merge(first + j*n_rows, 0, first > 0)
         self%idle(:, j*n_pairs + 1:(j + 1)*n_pairs) = self%idle(:, :n_pairs)
         self%spring_row(j*n + 1:(j + 1)*n) = [(n_sectors*n_rows + j*n + i, i=1, n)]
         self%row_in_sector(j*n_rows + 1:(j + 1)*n_rows) = [(i, i=1, n_rows)]
         self%row_in_sector(self%spring_row(j*n + 1:(j + 1)*n)) = springs
         self%sector(j*n_rows + 1:(j + 1)*n_rows) = j
         self%sector(self%spring_row(j*n + 1:(j + 1)*n)) = j
         self%row_in_sector(last + j*n_others + 1:last + (j + 1)*n_others) = &
            [(n_rows + n + i, i=1, n_others)]
         self%sector(last + j*n_others + 1:last + (j + 1)*n_others) = j
      end do
      do k = 1, size(self%element_row)
         others = self%element_row(k)%row
         associate (rows => self%element_row(k))
            deallocate (rows%row)
            allocate (rows%row(size(others, 1), size(others, 2)*n_sectors))
            do j = 0, n_sectors - 1
               rows%row(:, j*size(others, 2) + 1:(j + 1)*size(others, 2)) = &
                  merge(others - n_rows - n + last + j*n_others, 0, others > 0)
            end do
         end associate
      end do
      self%n_idle = n_sectors*self%n_idle
   end subroutine repeat_rows

   !> A row of a sector in a nodal diameter k = 0 .. n_sectors - 1, as a combination of the
   !> coordinates of a sector.
   pure function wave_weights(self, n_sectors, k, row) result(weight)
      class(joint_type), intent(in) :: self
      integer, intent(in) :: n_sectors, k, row
      complex(wp), allocatable :: weight(:)

      weight = self%cyclic%weights(merge(k - n_sectors, k, 2*k > n_sectors), row)
   end function wave_weights

   !> The sector that side 2 of an element lies in, counted from its own; 0 where none is given.
   pure integer function sector_of(sector_2, element) result(sector)
      integer, allocatable, intent(in) :: sector_2(:)
      integer, intent(in) :: element

      sector = 0
      if (allocated(sector_2)) sector = sector_2(element)
   end function sector_of

   !> Give the rows of a cyclic structure the weights that they have in the harmonics in use.
   subroutine turn_joint(model, contact, harmonic, self, error)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: harmonic(:)
      type(joint_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: component(*) = [character(2) :: 't1', 't2', 'n']
      type(law_facts) :: facts
      integer, allocatable :: diameter(:)
      integer :: h, i, k, n, row
      integer :: place(2)
      logical, allocatable :: rigid(:, :)

      if (.not. model%cyclic%is_cyclic) return
      if (model%cyclic%is_mistuned) then
         call self%cyclic%lay_out_all(model%cyclic, self%row_in_sector, self%sector, self%relative)
         ! Waves of all nodal diameters run around sectors that differ.
         diameter = [(k, k=0, model%cyclic%n_sectors/2)]
      else
         call self%cyclic%lay_out(model%cyclic, harmonic, self%relative)
         diameter = model%cyclic%nodal_diameter(harmonic)
      end if
      facts = facts_of(contact)
      if (.not. facts%needs_independent .or. contact%n_pairs == 0) return
      n = contact%n_pairs/model%cyclic%n_solved()
      rigid = spread(pairs_are_rigid(contact), 1, 3)
      do h = 1, size(diameter)
         k = diameter(h)
         row = self%cyclic%first_dependent(k, [(any(self%row(:, :n) == i .and. rigid(:, :n)), &
                                                i=1, self%cyclic%n_rows)])
         if (row == 0) cycle
         place = findloc(self%row, row)
         call fatal_error(error, '&contact pair '//to_text(place(2))//', '// &
                          trim(component(place(1)))//': in nodal diameter '//to_text(k)// &
                          ' its relative displacement vanishes or follows from that of earlier '// &
                          'pairs, so rigid contact forces are not determined; remove the '// &
                          'pair, use law = ''penalty'', or give a body compliance', status_input)
         return
      end do
   end subroutine turn_joint

   !> Dofs that a load can reach through the matrices, the pairs and the springs (0:n_dof; entry
   !> 0, the ground, never moves). What no load reaches stays at rest exactly.
   subroutine find_moving_dofs(model, contact, springs, elements, moving)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      logical, intent(out), allocatable :: moving(:)
      real(wp) :: speed(contact%n_pairs, 2)
      integer :: i, c, n_moving, p
      logical :: interferes

      allocate (moving(0:model%n_dof), source=.false.)
      if (model%cyclic%has_nodal()) then
         ! Modal coordinates join everything.
         moving(1:) = .true.
         return
      end if
      moving(1:) = sum(abs(model%load_columns()), dim=2) > 0.0_wp
      if (allocated(model%cyclic%speed)) then
         if (allocated(model%cyclic%speed%growth%load)) moving(1:) = moving(1:) .or. &
            any(abs(model%cyclic%speed%growth%load) > 0.0_wp, dim=2)
      end if
      speed = contact%speeds()
      do i = 1, contact%n_pairs
         ! An interference pushes both sides.
         interferes = contact%gap(i) < 0.0_wp
         ! With the speed it may come to do so.
         if (allocated(contact%gap_rotation)) interferes = interferes .or. &
            contact%gap_rotation(i) < 0.0_wp
         ! As does an obstacle that moves.
         if (allocated(contact%gap_harmonic)) interferes = interferes .or. &
            any(abs(contact%gap_cosine(i, :)) > 0.0_wp) .or. &
            any(abs(contact%gap_sine(i, :)) > 0.0_wp)
         if (interferes) moving(dofs_of(model, [contact%side_1(3, i), contact%side_2(3, i)])) = &
            .true.
         ! A side that slides drags both along the face, whatever else rests.
         do c = 1, 2
            if (abs(speed(i, c)) > 0.0_wp) moving(dofs_of(model, [contact%side_1(c, i), &
                                                                 contact%side_2(c, i)])) = .true.
         end do
         ! A traction that the assembly has left does so along the face.
         if (is_strained(contact, i)) moving(dofs_of(model, [contact%side_1(:2, i), &
                                                            contact%side_2(:2, i)])) = .true.
      end do
      ! The ground passes no motion on.
      moving(0) = .false.
      do
         ! Until nothing more is reached: each round goes one element further at least.
         n_moving = count(moving)
         do i = 1, model%n_dof
            if (.not. moving(i)) cycle
            moving(1:) = moving(1:) .or. abs(model%mass(:, i)) > 0.0_wp .or. &
                         abs(model%stiffness(:, i)) > 0.0_wp .or. abs(model%damping(:, i)) > 0.0_wp
            call couple_by(model%cyclic%coriolis)
            call couple_by(model%cyclic%circulatory)
            call couple_by(model%cyclic%structural)
            if (allocated(model%cyclic%deviation)) call couple_rows(model%cyclic%deviation%rows)
            if (.not. allocated(model%cyclic%speed)) cycle
            associate (speed => model%cyclic%speed)
               call couple_by(speed%coriolis)
               call couple_by(speed%circulatory)
               if (.not. allocated(speed%growth%stiffness)) cycle
               do p = 1, size(speed%growth%stiffness, 3)
                  moving(1:) = moving(1:) .or. abs(speed%growth%stiffness(:, i, p)) > 0.0_wp
               end do
            end associate
         end do
         do i = 1, contact%n_pairs
            do c = 1, 3
               call couple([contact%side_1(c, i), contact%side_2(c, i)])
            end do
         end do
         do i = 1, springs%n_springs
            call couple([springs%side_1(i), springs%side_2(i)])
         end do
         call couple_elements()
         if (allocated(model%cyclic%air)) then
            associate (touched => any(abs(model%cyclic%air%modes) > 0.0_wp, dim=1))
               if (any(touched .and. moving(1:))) moving(1:) = moving(1:) .or. touched
            end associate
         end if
         if (allocated(model%cyclic%left)) then
            do i = 1, size(model%cyclic%left)
               call couple([model%cyclic%left(i), model%cyclic%right(i)])
            end do
         end if
         if (count(moving) == n_moving) exit
      end do

   contains

      !> What dof i moves by a matrix that may not be there.
      subroutine couple_by(matrix)
         real(wp), allocatable, intent(in) :: matrix(:, :)

         if (allocated(matrix)) moving(1:) = moving(1:) .or. abs(matrix(:, i)) > 0.0_wp
      end subroutine couple_by

      !> What dof i moves by rows, all of which are taken for coupled.
      subroutine couple_rows(rows)
         real(wp), intent(in) :: rows(:, :)

         if (all(abs(rows(:, i)) <= 0.0_wp)) return
         moving(1:) = moving(1:) .or. any(abs(rows) > 0.0_wp, dim=1)
      end subroutine couple_rows

      !> All dofs of some sides hang together.
      subroutine couple(sides)
         integer, intent(in) :: sides(:)
         integer, allocatable :: dofs(:)

         dofs = dofs_of(model, sides)
         if (any(moving(dofs))) moving(dofs) = .true.
      end subroutine couple

      !> All inputs of an element hang together.
      subroutine couple_elements()
         integer :: e, k

         if (.not. allocated(elements%slot)) return
         do k = 1, size(elements%slot)
            associate (group => elements%slot(k)%group)
               do e = 1, group%n_elements
                  call couple([group%row_side_1(:, e), group%row_side_2(:, e)])
               end do
            end associate
         end do
      end subroutine couple_elements

   end subroutine find_moving_dofs

   !> Whether a pair may be strained where it stands.
   pure logical function is_strained(contact, pair)
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: pair

      is_strained = contact%memory == memory_residual
      if (allocated(contact%slider_1)) is_strained = is_strained .or. &
         abs(contact%slider_1(pair)) > 0.0_wp
      if (allocated(contact%slider_2)) is_strained = is_strained .or. &
         abs(contact%slider_2(pair)) > 0.0_wp
   end function is_strained

   !> Half-wave symmetry is exact where nothing static acts, nor a load of an even harmonic, normal
   !> loads are constant, springs are odd, and no pair carries a static force over from an earlier
   !> point of the sweep.
   logical function symmetric(model, contact, springs, elements, joint)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      type(element_list), intent(in) :: elements
      type(joint_type), intent(in) :: joint
      type(law_facts) :: facts

      symmetric = all(abs(model%load_static) <= 0.0_wp)
      if (allocated(model%cyclic%speed)) then
         if (allocated(model%cyclic%speed%growth%load)) symmetric = symmetric .and. &
            all(abs(model%cyclic%speed%growth%load) <= 0.0_wp)
      end if
      if (model%waves%n_waves() > 0) symmetric = symmetric .and. &
         all(modulo(model%waves%harmonic, 2) == 1)
      if (contact%n_pairs > 0) then
         facts = facts_of(contact)
         symmetric = symmetric .and. facts%is_odd .and. all(joint%row(3, :) == 0) .and. &
                     all(contact%memory /= [memory_carried, memory_residual]) .and. &
                     .not. (allocated(contact%slider_1) .or. allocated(contact%slider_2))
      end if
      if (springs%n_springs > 0) symmetric = symmetric .and. all(modulo(springs%power, 2) == 1)
      symmetric = symmetric .and. elements%are_odd()
   end function symmetric

   !> Rigid contact forces are determined only where the pairs move independently of each other.
   subroutine check_independent(contact, self, error)
      type(contact_type), intent(in) :: contact
      type(joint_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      character(*), parameter :: component(*) = [character(2) :: 't1', 't2', 'n']
      type(law_facts) :: facts
      logical :: rigid(contact%n_pairs)
      integer :: i, c

      facts = facts_of(contact)
      if (.not. facts%needs_independent) return
      rigid = pairs_are_rigid(contact)
      do i = 1, contact%n_pairs
         do c = 1, 3
            if (self%row(c, i) == 0 .or. .not. rigid(i)) cycle
            if (self%relative%independent(self%row(c, i))) cycle
            call fatal_error(error, '&contact pair '//to_text(i)//', '//trim(component(c))// &
                             ': its relative displacement follows from that of earlier pairs, '// &
                             'so rigid contact forces are not determined; remove the pair, '// &
                             'use law = ''penalty'', or give a body compliance', status_input)
            return
         end do
      end do
   end subroutine check_independent

end module fw_joint
