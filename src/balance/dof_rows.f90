!> Springs and contact pairs as rows of the dofs of the model, with what they are at the point that
!> a balance was evaluated at: also components that the balance leaves out, as nothing moves them.
module fw_dof_rows
   use fw_balance_state, only: balance_state
   use fw_contact_data, only: contact_type, spring_type
   use fw_force_law, only: pair_mixed, pair_open
   use fw_kinds, only: wp
   use fw_side, only: terms_of
   implicit none (type, external)
   private

   public :: dof_row, list_rows, strains

   type :: dof_row
      !> Signed numbers of dofs and rows of the model, 0 for ground.
      integer :: side(2) = 0
      !> The dofs of both, and the weights of side 1 less side 2.
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)
      !> What a motion finds there in proportion to itself [force/length].
      real(wp) :: stiffness = 0.0_wp
      !> It does not move at all: a rigid pair that bears.
      logical :: is_held = .false.
      !> Forces are not in proportion to a motion: slip, contact for a part of the period, a
      !> nonlinear spring.
      logical :: is_mixed = .false.
      !> Whose forces these are.
      integer :: law = 0, element = 0, component = 0
   contains
      procedure :: elongation
      procedure :: add_to
      procedure :: take_from
      procedure :: add_force
      procedure :: is_like
   end type dof_row

contains

   !> Rows of all springs, then of all components of pairs that are there.
   subroutine list_rows(system, contact, springs, of_model, rows)
      type(balance_state), intent(in) :: system
      type(contact_type), intent(in) :: contact
      type(spring_type), intent(in) :: springs
      !> Rows of the model, as in fw_side.
      real(wp), allocatable, intent(in) :: of_model(:, :)
      type(dof_row), allocatable, intent(out) :: rows(:)
      integer :: c, i, n

      allocate (rows(springs%n_springs + 3*contact%n_pairs))
      n = springs%n_springs
      do i = 1, n
         rows(i) = row_of_spring(system, springs, i)
      end do
      do i = 1, contact%n_pairs
         do c = 1, 3
            if (contact%side_1(c, i) == 0 .and. contact%side_2(c, i) == 0) cycle
            n = n + 1
            rows(n) = row_of_pair(system, contact, i, c)
         end do
      end do
      rows = rows(:n)
      do i = 1, n
         call take_sides(of_model, rows(i))
      end do
   end subroutine list_rows

   !> Side 1 less side 2; negative numbers count the other way.
   pure subroutine take_sides(of_model, row)
      real(wp), allocatable, intent(in) :: of_model(:, :)
      type(dof_row), intent(inout) :: row
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)

      call terms_of(row%side(1), row%dof, row%weight, of_model)
      call terms_of(-row%side(2), dof, weight, of_model)
      row%dof = [row%dof, dof]
      row%weight = [row%weight, weight]
   end subroutine take_sides

   !> Springs come first in the list of laws.
   pure type(dof_row) function row_of_spring(system, springs, i) result(row)
      type(balance_state), intent(in) :: system
      type(spring_type), intent(in) :: springs
      integer, intent(in) :: i

      row%side = [springs%side_1(i), springs%side_2(i)]
      row%law = 1
      row%element = i
      row%component = 1
      row%is_mixed = springs%power(i) /= 1
      ! Of the law, whose constants may have moved since the case was read.
      if (.not. row%is_mixed) row%stiffness = &
         system%problem%forces%entry(1)%law%slope_at(i, 0.0_wp)
   end function row_of_spring

   pure type(dof_row) function row_of_pair(system, contact, i, c) result(row)
      type(balance_state), intent(in) :: system
      type(contact_type), intent(in) :: contact
      integer, intent(in) :: i, c

      row%side = [contact%side_1(c, i), contact%side_2(c, i)]
      row%law = system%problem%forces%pairs
      row%element = i
      row%component = c
      associate (entry => system%problem%forces%entry(system%problem%forces%pairs), &
                 work => system%work(system%problem%forces%pairs))
         if (work%state(i) == pair_open) return
         row%is_mixed = work%state(i) == pair_mixed
         ! Without friction a pair that stays closed is a spring along its normal, and nothing else.
         if (.not. contact%mu(i) > 0.0_wp) then
            if (c < 3) row%is_mixed = .false.
            if (c < 3) return
            row%is_mixed = row%is_mixed .and. &
                           (entry%law%facts%is_curved .or. .not. work%always_closed(i))
         end if
         associate (p => entry%law%prediction)
            row%is_held = p%takes(i)
            if (p%takes(i) .or. p%order_of(i, c) > 0) return
            row%stiffness = p%stiffness(i, c)
            if (entry%row(c, i) > 0) return
         end associate
      end associate
      if (c < 3 .and. allocated(contact%tangential_stiffness)) then
         row%stiffness = contact%tangential_stiffness(i)
      else if (c == 3 .and. allocated(contact%normal_stiffness)) then
         row%stiffness = contact%normal_stiffness(i)
      end if
   end function row_of_pair

   !> B u of the columns of u (n_dof, n).
   pure function elongation(self, u) result(values)
      class(dof_row), intent(in) :: self
      real(wp), intent(in) :: u(:, :)
      real(wp) :: values(size(u, 2))
      integer :: k

      values = 0.0_wp
      do k = 1, size(self%dof)
         values = values + self%weight(k)*u(self%dof(k), :)
      end do
   end function elongation

   !> Add B^T k B to a matrix, and its absolute values to the sizes of what is summed up.
   pure subroutine add_to(self, matrix, sizes)
      class(dof_row), intent(in) :: self
      real(wp), intent(inout) :: matrix(:, :), sizes(:, :)
      integer :: j, k

      do j = 1, size(self%dof)
         do k = 1, size(self%dof)
            associate (row => self%dof(j), column => self%dof(k), &
                       part => self%weight(j)*self%weight(k)*self%stiffness)
               matrix(row, column) = matrix(row, column) + part
               sizes(row, column) = sizes(row, column) + abs(part)
            end associate
         end do
      end do
   end subroutine add_to

   !> product = product - B^T k B u.
   pure subroutine take_from(self, u, product)
      class(dof_row), intent(in) :: self
      real(wp), intent(in) :: u(:, :)
      real(wp), intent(inout) :: product(:, :)
      integer :: k

      do k = 1, size(self%dof)
         associate (row => product(self%dof(k), :))
            row = row - self%weight(k)*self%stiffness*self%elongation(u)
         end associate
      end do
   end subroutine take_from

   !> load = load + B^T force.
   pure subroutine add_force(self, force, load)
      class(dof_row), intent(in) :: self
      !> Coefficients of a cosine and a sine.
      real(wp), intent(in) :: force(2)
      complex(wp), intent(inout) :: load(:)
      integer :: k

      do k = 1, size(self%dof)
         associate (entry => load(self%dof(k)))
            entry = entry + self%weight(k)*cmplx(force(1), -force(2), wp)
         end associate
      end do
   end subroutine add_force

   !> Whether a motion strains one of the springs and pairs that resist it.
   pure logical function strains(v, rows)
      !> (n_dof)
      complex(wp), intent(in) :: v(:)
      type(dof_row), intent(in) :: rows(:)
      !> Part of the largest displacement that counts as moving.
      real(wp), parameter :: moves = 1.0e-8_wp
      real(wp) :: parts(size(v), 2)
      integer :: i

      parts(:, 1) = real(v, wp)
      parts(:, 2) = aimag(v)
      strains = .false.
      do i = 1, size(rows)
         if (.not. abs(rows(i)%stiffness) > 0.0_wp) cycle
         strains = strains .or. norm2(rows(i)%elongation(parts)) > moves*maxval(abs(v))
      end do
   end function strains

   !> Whether rows are as stiff as others were.
   elemental logical function is_like(self, other)
      class(dof_row), intent(in) :: self
      type(dof_row), intent(in) :: other

      is_like = (self%is_held .eqv. other%is_held) .and. &
                abs(self%stiffness - other%stiffness) <= 0.0_wp
   end function is_like

end module fw_dof_rows
