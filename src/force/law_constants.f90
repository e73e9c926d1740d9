!> Constants of pairs that only some laws have, by the names of their keys: a law declares its own
!> in `bind_keys` and takes their values when it is built, and nobody else knows them.
module fw_law_constants
   use fw_key, only: key_type, key_visitor
   use fw_key_range, only: range_type
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: law_constants, level_values

   type :: constant_type
      character(24) :: name = ''
      !> Number of the law that declared it first, and of all that did.
      integer :: law = 0
      integer, allocatable :: laws(:)
      !> What its values may be.
      type(range_type) :: range
      !> One for each pair; not allocated where none was given.
      real(wp), allocatable :: values(:)
   end type constant_type

   type :: law_constants
      !> Number of the law that declares keys now, and its word.
      integer :: law = 0
      character(24) :: word = ''
      !> Whether laws are only asked for the names of their keys: before any is read, so that each
      !> key can name all the laws that have it.
      logical :: is_asked = .false.
      !> Whether that law is one of the case, which takes what the model offers.
      logical :: is_in_use = .true.
      !> Whether others have pairs of the case too, whose values do not count.
      logical :: is_partial = .false.
      type(constant_type), allocatable, private :: constant(:)
      !> The keys of all laws that were asked; `only` says which have them: law = 'one', 'another'.
      type(key_type), allocatable :: named(:)
      !> Whether a law that was asked needs them.
      logical, allocatable, private :: named_is_needed(:)
      !> What the model has, with the number of the law that took it (0: none).
      type(constant_type), allocatable, private :: offered(:)
   contains
      procedure :: bind
      procedure :: offer
      procedure :: offer_all
      procedure :: first_unused
      procedure :: set
      procedure :: get
      procedure :: has
      procedure :: of_pairs
      procedure :: first_of_others
      procedure :: is_of_law
      procedure :: is_taken
      procedure :: first_wrong
      procedure :: level
   end type law_constants

contains

   !> Declare a constant for each pair. What laws share is declared by each, and read once.
   subroutine bind(self, keys, key, needed)
      class(law_constants), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      type(key_type), intent(in) :: key
      !> Whether the case has to give it where the model does not.
      logical, intent(in) :: needed
      type(constant_type) :: new
      type(key_type) :: shown
      logical :: is_needed
      integer :: k

      if (self%is_asked) then
         call note_law(self, key, needed)
         return
      end if
      if (.not. allocated(self%constant)) allocate (self%constant(0))
      k = place_of(self%constant, key%name)
      if (k > 0) then
         self%constant(k)%laws = [self%constant(k)%laws, self%law]
         return
      end if
      shown = key
      is_needed = needed
      k = 0
      if (allocated(self%named)) k = findloc(self%named%name, key%name, dim=1)
      if (k > 0) then
         shown%only = self%named(k)%only
         is_needed = needed .or. (self%is_in_use .and. self%named_is_needed(k))
      end if
      new%name = key%name
      new%law = self%law
      new%laws = [self%law]
      new%range = key%range
      ! Values of pairs whose law has no such constant are not looked at: see first_wrong.
      if (self%is_partial) shown%range = range_type()
      k = 0
      ! For another law the values of the model would look as if the case had given them.
      if (self%is_in_use) k = place_of(self%offered, key%name)
      if (k > 0) then
         new%values = self%offered(k)%values
         self%offered(k)%law = self%law
      end if
      call keys%bind(shown, new%values, is_needed .and. k == 0)
      self%constant = [self%constant, new]
   end subroutine bind

   !> The mean over sectors in place of the values of each.
   pure subroutine level(self, n_alike)
      class(law_constants), intent(inout) :: self
      !> Sectors that the pairs are of, one after another.
      integer, intent(in) :: n_alike
      integer :: k

      if (.not. allocated(self%constant)) return
      do k = 1, size(self%constant)
         call level_values(n_alike, self%constant(k)%values)
      end do
   end subroutine level

   !> The same of one value for each pair.
   pure subroutine level_values(n_alike, values)
      integer, intent(in) :: n_alike
      !> (n_pairs); nothing is done where it is not allocated.
      real(wp), allocatable, intent(inout) :: values(:)
      real(wp), allocatable :: sectors(:, :)

      if (.not. allocated(values) .or. n_alike < 2) return
      sectors = reshape(values, [size(values)/n_alike, n_alike])
      ! Equal ones stay as they are, to the bit.
      if (all(abs(sectors - spread(sectors(:, 1), 2, n_alike)) <= 0.0_wp)) return
      values = reshape(spread(sum(sectors, dim=2)/n_alike, 2, n_alike), [size(values)])
   end subroutine level_values

   !> The law that declares now has this constant.
   subroutine note_law(self, key, needed)
      class(law_constants), intent(inout) :: self
      type(key_type), intent(in) :: key
      logical, intent(in) :: needed
      integer :: k

      if (.not. allocated(self%named)) allocate (self%named(0), self%named_is_needed(0))
      k = findloc(self%named%name, key%name, dim=1)
      if (k > 0) then
         self%named(k)%only = trim(self%named(k)%only)//", '"//trim(self%word)//"'"
         self%named_is_needed(k) = self%named_is_needed(k) .or. needed
      else
         self%named = [self%named, key]
         self%named_is_needed = [self%named_is_needed, needed]
         self%named(size(self%named))%only = "law = '"//trim(self%word)//"'"
      end if
   end subroutine note_law

   !> What the model has for a constant (n_pairs): it holds where the case gives none.
   subroutine offer(self, name, values)
      class(law_constants), intent(inout) :: self
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      type(constant_type) :: new
      integer :: k

      if (.not. allocated(self%offered)) allocate (self%offered(0))
      new%name = name
      k = place_of(self%offered, name)
      if (k == 0) then
         self%offered = [self%offered, new]
         k = size(self%offered)
      end if
      self%offered(k)%values = values
   end subroutine offer

   !> All that another one offers, repeated where it is of the pairs of one sector of some.
   subroutine offer_all(self, other, n_pairs, n_sectors)
      class(law_constants), intent(inout) :: self
      type(law_constants), intent(in) :: other
      !> Of a sector.
      integer, intent(in) :: n_pairs, n_sectors
      integer :: j, k

      if (.not. allocated(other%offered)) return
      do k = 1, size(other%offered)
         associate (values => other%offered(k)%values)
            call self%offer(trim(other%offered(k)%name), &
                            [(values, j=1, merge(n_sectors, 1, size(values) == n_pairs))])
         end associate
      end do
   end subroutine offer_all

   !> A constant of the model that the law of the case has not taken; blank where there is none.
   pure subroutine first_unused(self, name)
      class(law_constants), intent(in) :: self
      ! allow(C072): a text of the caller
      character(*), intent(out) :: name
      integer :: k

      name = ''
      if (.not. allocated(self%offered)) return
      k = findloc(self%offered%law, 0, dim=1)
      if (k > 0) name = self%offered(k)%name
   end subroutine first_unused

   !> Give a constant its values, without a reader.
   subroutine set(self, name, values)
      class(law_constants), intent(inout) :: self
      character(*), intent(in) :: name
      !> (n_pairs).
      real(wp), intent(in) :: values(:)
      type(constant_type) :: new
      integer :: k

      if (.not. allocated(self%constant)) allocate (self%constant(0))
      k = place_of(self%constant, name)
      if (k == 0) then
         new%name = name
         new%law = self%law
         new%laws = [self%law]
         self%constant = [self%constant, new]
         k = size(self%constant)
      end if
      self%constant(k)%values = values
   end subroutine set

   !> Values of a constant (n_pairs); where none were given the default, zero if there is none.
   pure function get(self, name, n_pairs, default) result(values)
      class(law_constants), intent(in) :: self
      character(*), intent(in) :: name
      integer, intent(in) :: n_pairs
      real(wp), intent(in), optional :: default
      real(wp) :: values(n_pairs)
      integer :: k

      values = 0.0_wp
      if (present(default)) values = default
      k = place_of(self%constant, name)
      if (k == 0) return
      if (.not. allocated(self%constant(k)%values)) return
      if (size(self%constant(k)%values) == n_pairs) values = self%constant(k)%values
   end function get

   !> Whether values of a constant were given.
   pure logical function has(self, name)
      class(law_constants), intent(in) :: self
      character(*), intent(in) :: name
      integer :: k

      k = place_of(self%constant, name)
      has = .false.
      if (k > 0) has = allocated(self%constant(k)%values)
   end function has

   !> Whether one of some laws declares a constant, of those whose keys were asked for first.
   pure logical function is_of_law(self, laws, name)
      class(law_constants), intent(in) :: self
      !> Their numbers.
      integer, intent(in) :: laws(:)
      character(*), intent(in) :: name
      integer :: k

      is_of_law = .false.
      k = place_of(self%constant, name)
      if (k > 0) is_of_law = any(self%constant(k)%law == laws)
   end function is_of_law

   !> Whether pairs of the law of a number take a constant.
   pure logical function is_taken(self, law, name)
      class(law_constants), intent(in) :: self
      integer, intent(in) :: law
      character(*), intent(in) :: name
      integer :: k

      k = place_of(self%constant, name)
      is_taken = .false.
      if (k > 0) is_taken = any(self%constant(k)%laws == law)
   end function is_taken

   !> The first value that a pair of several laws takes and that it may not have; pair 0 where
   !> there is none.
   subroutine first_wrong(self, law_of, name, pair, value, range)
      class(law_constants), intent(in) :: self
      !> Number of the law of each pair.
      integer, intent(in) :: law_of(:)
      ! allow(C072): a text of the caller
      character(*), intent(out) :: name
      integer, intent(out) :: pair
      real(wp), intent(out) :: value
      type(range_type), intent(out) :: range
      integer :: k

      pair = 0
      name = ''
      value = 0.0_wp
      if (.not. allocated(self%constant)) return
      do k = 1, size(self%constant)
         associate (constant => self%constant(k))
            if (.not. allocated(constant%values)) cycle
            if (size(constant%values) /= size(law_of)) cycle
            do pair = 1, size(law_of)
               if (.not. any(constant%laws == law_of(pair))) cycle
               if (constant%range%holds(constant%values(pair))) cycle
               name = constant%name
               value = constant%values(pair)
               range = constant%range
               return
            end do
         end associate
      end do
      pair = 0
   end subroutine first_wrong

   !> The values of some pairs alone.
   pure type(law_constants) function of_pairs(self, pair) result(own)
      class(law_constants), intent(in) :: self
      !> Their numbers.
      integer, intent(in) :: pair(:)
      integer :: k

      if (.not. allocated(self%constant)) return
      own%constant = self%constant
      do k = 1, size(own%constant)
         if (.not. allocated(own%constant(k)%values)) cycle
         if (size(own%constant(k)%values) < maxval([pair, 0])) cycle
         own%constant(k)%values = own%constant(k)%values(pair)
      end do
   end function of_pairs

   !> A constant that was given but that only other laws than `laws` declare, and the first of
   !> these; law 0 where there is none.
   subroutine first_of_others(self, laws, name, other)
      class(law_constants), intent(in) :: self
      integer, intent(in) :: laws(:)
      ! allow(C072): a text of the caller
      character(*), intent(out) :: name
      integer, intent(out) :: other
      integer :: k

      name = ''
      other = 0
      if (.not. allocated(self%constant)) return
      do k = 1, size(self%constant)
         if (any(self%constant(k)%law == laws)) cycle
         if (.not. allocated(self%constant(k)%values)) cycle
         name = self%constant(k)%name
         other = self%constant(k)%law
         return
      end do
   end subroutine first_of_others

   !> Place of a name in a list of constants, 0 where it has none of that name.
   pure integer function place_of(list, name) result(place)
      type(constant_type), allocatable, intent(in) :: list(:)
      character(*), intent(in) :: name

      place = 0
      if (.not. allocated(list)) return
      ! A loop that runs through leaves place = 0, no such name.
      do place = size(list), 1, -1
         if (list(place)%name == name) return
      end do
   end function place_of

end module fw_law_constants
