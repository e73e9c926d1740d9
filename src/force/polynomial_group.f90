!> Group &polynomial: forces that are polynomials of the dofs, term by term.
!>
!> Terms that share dofs are one element, whose rows are these dofs, where that is cheaper than an
!> element for each set of dofs that stands in a term.
module fw_polynomial_group
   use fw_element_group, only: element_group, group_name_length
   use fw_force_law, only: force_law
   use fw_key, only: key, key_visitor
   use fw_key_range, only: side_numbers, from_to
   use fw_kinds, only: wp
   use fw_term_law, only: element_term, most_factors, new_terms
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: polynomial_group

   character(*), parameter :: of_words(*) = [character(6) :: 'energy', 'force'], &
      of_file = 'of the file', or_needed = 'of the file, else required'
   integer, parameter :: of_energy = 1, of_force = 2
   !> More terms are taken for a mistake.
   integer, parameter :: most = 1000000

   !> Forces that are polynomials of several dofs, term by term or as a potential.
   type, extends(element_group) :: polynomial_group
      !> What the terms are, a number in `of_words`.
      integer :: of = of_energy
      !> Signed dofs of each term, repeated for powers, 0: none (8, n_terms), and the row of a force
      !> (n_terms).
      integer, allocatable :: factors(:, :), dof(:)
      type(element_term), allocatable :: term(:)
   contains
      procedure :: name
      procedure :: count_key
      procedure :: bind_count
      procedure :: bind_keys
      procedure :: n_held
      procedure :: find_fault
      procedure :: settle
      procedure :: make_law
      procedure :: is_odd
      procedure :: is_linear
   end type polynomial_group

   !> Dofs that stand together, in ascending order.
   type :: dof_set
      integer, allocatable :: dof(:)
   end type dof_set

contains

   pure function name(self)
      class(polynomial_group), intent(in) :: self
      character(group_name_length) :: name

      name = 'polynomial'
      associate (unused => self)
      end associate
   end function name

   !> The key that says how many there are.
   pure function count_key(self)
      class(polynomial_group), intent(in) :: self
      character(group_name_length) :: count_key

      count_key = 'n_terms'
      associate (unused => self)
      end associate
   end function count_key

   !> What has to be known before the other keys have their sizes.
   subroutine bind_count(self, keys)
      class(polynomial_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('polynomial', 'forces that are polynomials of several dofs')
      call keys%bind(key('n_terms', '0 switches the terms of a file off', from_to(0, most), &
                         absent=of_file), self%n_given)
      call keys%set_size('n_terms', self%n_given)
   end subroutine bind_count

   subroutine bind_keys(self, keys)
      class(polynomial_group), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      logical :: needed

      needed = self%n_given > 0 .and. .not. allocated(self%factors)
      call keys%bind_word(key('of', 'terms are a potential, or a force on one dof each', &
                              absent=of_file), self%of, of_words)
      call keys%bind(key('factors', 'dofs of the product, repeated for powers; 0: none', &
                         side_numbers(), shape='8 x n_terms', repeats=.false., absent=or_needed), &
                     self%factors, needed)
      call keys%bind(key('coefficient', 'of each product', shape='n_terms', repeats=.false., &
                         absent=or_needed), self%coefficient, needed)
      call keys%bind(key('dof', 'that the force acts on, on the side of the stiffness', &
                         side_numbers(), shape='n_terms', repeats=.false., absent=or_needed, &
                         only="of = 'force'"), self%dof, &
                     self%n_given > 0 .and. self%of == of_force .and. .not. allocated(self%dof))
   end subroutine bind_keys

   pure integer function n_held(self)
      class(polynomial_group), intent(in) :: self

      n_held = 0
      if (allocated(self%factors)) n_held = size(self%factors, 2)
   end function n_held

   !> The first value that no polynomial has, with its key.
   pure subroutine find_fault(self, key, text)
      class(polynomial_group), intent(in) :: self
      character(24), intent(out) :: key
      character(160), intent(out) :: text
      integer :: i

      key = ''
      text = ''
      if (self%of == of_energy .and. allocated(self%dof)) then
         key = 'dof'
         text = "is given with of = 'energy', whose forces act on the dofs of the factors: "// &
                "leave it out, or take of = 'force'"
         return
      end if
      do i = 1, self%n_given
         if (all(self%factors(:, i) == 0)) then
            key = 'factors'
            text = 'of term '//to_text(i)//' are all 0: must name a dof at least'
         else if (self%of == of_energy .and. count(self%factors(:, i) /= 0) == 1) then
            key = 'factors'
            text = 'of term '//to_text(i)//' are one dof: a potential of degree 1 is a '// &
                   'constant force; give it as load%static'
         else if (self%of == of_force) then
            if (self%dof(i) /= 0) cycle
            key = 'dof'
            text = 'of term '//to_text(i)//' is 0, the ground: must be a dof'
         else
            cycle
         end if
         return
      end do
   end subroutine find_fault

   !> The cheaper of two ways to make elements of the terms, set by set.
   subroutine settle(self)
      class(polynomial_group), intent(inout) :: self
      type(dof_set), allocatable :: sets(:)
      integer :: e, i

      allocate (sets(self%n_given))
      do i = 1, self%n_given
         sets(i)%dof = sorted(pack(abs(self%factors(:, i)), self%factors(:, i) /= 0))
         if (self%of == of_force) sets(i)%dof = sorted([sets(i)%dof, abs(self%dof(i))])
      end do
      call merge_sets(sets)
      call self%reserve_rows(maxval([1, (size(sets(e)%dof), e=1, size(sets))]), size(sets))
      do e = 1, size(sets)
         self%row_side_1(:size(sets(e)%dof), e) = sets(e)%dof
      end do
      if (allocated(self%term)) deallocate (self%term)
      allocate (self%term(self%n_given))
      do i = 1, self%n_given
         call make_term(self, sets, i)
      end do
   end subroutine settle

   !> Sets that hang together become one where one square of them all is less than the sum of those
   !> of the sets, of which parts of others do not count.
   subroutine merge_sets(sets)
      type(dof_set), allocatable, intent(inout) :: sets(:)
      type(dof_set), allocatable :: part(:), joined(:)
      integer, allocatable :: label(:)
      integer :: i

      call find_labels(sets, label)
      allocate (joined(0))
      do i = 1, size(sets)
         if (all(label(i) /= label(:i - 1))) then
            part = pack(sets, label == label(i))
            call join(part)
            joined = [joined, part]
         end if
      end do
      call move_alloc(joined, sets)
   end subroutine merge_sets

   !> The same number for sets that hang together by shared dofs.
   subroutine find_labels(sets, label)
      type(dof_set), intent(in) :: sets(:)
      integer, allocatable, intent(out) :: label(:)
      integer :: i, least, most_dof
      integer, allocatable :: of_dof(:)
      logical :: changed

      most_dof = maxval([0, (maxval(sets(i)%dof), i=1, size(sets))])
      of_dof = [(i, i=1, most_dof)]
      do
         changed = .false.
         do i = 1, size(sets)
            least = minval(of_dof(sets(i)%dof))
            changed = changed .or. any(of_dof(sets(i)%dof) /= least)
            of_dof(sets(i)%dof) = least
         end do
         if (.not. changed) exit
      end do
      label = [(of_dof(sets(i)%dof(1)), i=1, size(sets))]
   end subroutine find_labels

   !> One set of all, where that has fewer numbers in its derivative, or there are very many.
   subroutine join(sets)
      type(dof_set), allocatable, intent(inout) :: sets(:)
      integer, parameter :: very_many = 1000
      type(dof_set) :: whole
      integer :: i, n

      allocate (whole%dof(0))
      do i = 1, size(sets)
         if (.not. holds(whole%dof, sets(i)%dof)) whole%dof = sorted([whole%dof, sets(i)%dof])
      end do
      if (size(sets) <= very_many) then
         call drop_held(sets)
         n = 0
         do i = 1, size(sets)
            n = n + size(sets(i)%dof)**2
         end do
         if (size(whole%dof)**2 > n) return
      end if
      sets = [whole]
   end subroutine join

   !> Leave out sets that are parts of others.
   subroutine drop_held(sets)
      type(dof_set), allocatable, intent(inout) :: sets(:)
      logical :: kept(size(sets))
      integer :: i, j

      kept = .true.
      do i = 1, size(sets)
         do j = 1, size(sets)
            if (i == j .or. .not. kept(j)) cycle
            kept(i) = .not. holds(sets(j)%dof, sets(i)%dof)
            if (.not. kept(i)) exit
         end do
      end do
      sets = pack(sets, kept)
   end subroutine drop_held

   !> Whether all dofs of a set stand in another.
   pure logical function holds(other, dof)
      integer, intent(in) :: other(:), dof(:)
      integer :: j

      holds = all([(any(other == dof(j)), j=1, size(dof))])
   end function holds

   !> Different numbers in ascending order.
   pure function sorted(numbers) result(list)
      integer, intent(in) :: numbers(:)
      integer, allocatable :: list(:)
      integer, allocatable :: rest(:)

      allocate (list(0))
      rest = numbers
      do while (size(rest) > 0)
         list = [list, minval(rest)]
         rest = pack(rest, rest > minval(rest))
      end do
   end function sorted

   !> A term by the rows of its element, the first that has all its dofs.
   pure subroutine make_term(self, sets, i)
      type(polynomial_group), intent(inout) :: self
      type(dof_set), intent(in) :: sets(:)
      integer, intent(in) :: i
      integer, allocatable :: dof(:)
      integer :: e, k, m

      dof = pack(abs(self%factors(:, i)), self%factors(:, i) /= 0)
      associate (term => self%term(i))
         term%given = i
         if (self%of == of_force) dof = [dof, abs(self%dof(i))]
         do e = 1, size(sets)
            if (holds(sets(e)%dof, dof)) exit
         end do
         term%element = e
         term%sign = 1.0_wp
         if (modulo(count(self%factors(:, i) < 0), 2) == 1) term%sign = -1.0_wp
         if (self%of == of_force) then
            term%on = findloc(sets(e)%dof, abs(self%dof(i)), dim=1)
            if (self%dof(i) < 0) term%sign = -term%sign
         end if
         do k = 1, most_factors
            if (self%factors(k, i) == 0) cycle
            m = findloc(term%input(:term%n), findloc(sets(e)%dof, abs(self%factors(k, i)), dim=1), &
                        dim=1)
            if (m == 0) then
               term%n = term%n + 1
               m = term%n
               term%input(m) = findloc(sets(e)%dof, abs(self%factors(k, i)), dim=1)
            end if
            term%power(m) = term%power(m) + 1
         end do
      end associate
   end subroutine make_term

   subroutine make_law(self, n_sectors, law)
      class(polynomial_group), intent(in) :: self
      integer, intent(in) :: n_sectors
      class(force_law), allocatable, intent(out) :: law

      allocate (law, source=new_terms(self%n_in, self%n_elements, n_sectors, self%term, &
                                      self%coefficient))
   end subroutine make_law

   !> Whether all powers are odd: even harmonics may be left out then.
   pure logical function is_odd(self)
      class(polynomial_group), intent(in) :: self

      is_odd = all(modulo(degrees(self), 2) == 1)
   end function is_odd

   !> Whether nothing depends on the amplitude.
   pure logical function is_linear(self)
      class(polynomial_group), intent(in) :: self

      is_linear = all(degrees(self) == 1)
   end function is_linear

   !> Degrees of the forces (n_given).
   pure function degrees(self)
      type(polynomial_group), intent(in) :: self
      integer :: degrees(self%n_given)

      degrees = count(self%factors /= 0, dim=1) - merge(1, 0, self%of == of_energy)
   end function degrees

end module fw_polynomial_group
