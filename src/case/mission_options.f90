!> Options of a mission (group &mission): blocks of cycles in other conditions, flown over and over
!> while the joint wears.
module fw_mission_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, at_most, from_to, operator(.and.)
   use fw_kinds, only: wp
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: mission_options

   integer, parameter :: most_blocks = 10000

   !> Blocks of operation, how often they are flown, and how flights are leapt over.
   type :: mission_options
      !> Blocks of a flight; 0: no mission.
      integer :: n_blocks = 0
      !> Cycles of each block in a flight (n_blocks).
      real(wp), allocatable :: cycles(:)
      integer :: n_flights = 1
      !> What each block has of its own, `group%key=value` parted by semicolons, and its name
      !> (n_blocks).
      type(string_type), allocatable :: change(:), name(:)
      !> Flights that are taken together (0: as many as the error allows).
      integer :: flights_per_jump = 0
   contains
      procedure :: bind_keys
      procedure :: is_wanted
      procedure :: keeps_order
      procedure :: title
   end type mission_options

contains

   !> The keys of group &mission.
   subroutine bind_keys(self, keys, are_texts)
      class(mission_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether changes and names are texts.
      logical, intent(out) :: are_texts
      logical, allocatable :: is_text(:)
      real(wp), parameter :: most_cycles = 1.0e300_wp
      character(*), parameter :: of_wear = "analysis = 'wear'"

      call keys%open('mission', 'wear over blocks of cycles in other conditions')
      call keys%bind(key('n_blocks', 'of a flight; 0: no mission', from_to(0, most_blocks), &
                         only=of_wear), self%n_blocks)
      call keys%set_size('n_blocks', self%n_blocks)
      call keys%bind(key('cycles', 'of each block in a flight', &
                         above(0.0_wp) .and. at_most(most_cycles), shape='n_blocks', &
                         absent='required with n_blocks'), self%cycles, needed=self%n_blocks > 0)
      call keys%bind(key('n_flights', 'how often all blocks are flown', at_least(1)), &
                     self%n_flights)
      call keys%bind_list(key('change', &
                              'settings of each block as of --set, parted by semicolons', &
                              absent='nothing', shape='n_blocks'), 'texts', most_blocks, &
                          self%change, is_text)
      are_texts = all(is_text)
      call keys%bind_list(key('name', 'of each block', absent='block 1, block 2, ..', &
                              shape='n_blocks'), 'texts', most_blocks, self%name, is_text)
      are_texts = are_texts .and. all(is_text)
      call keys%bind(key('flights_per_jump', &
                         'taken together; 1: all in their order, 0: by wear%error_tolerance', &
                         at_least(0)), self%flights_per_jump)
   end subroutine bind_keys

   pure logical function is_wanted(self)
      class(mission_options), intent(in) :: self

      is_wanted = self%n_blocks > 0
   end function is_wanted

   !> Whether every flight is flown by itself, its blocks in their order.
   pure logical function keeps_order(self)
      class(mission_options), intent(in) :: self

      keeps_order = self%flights_per_jump == 1
   end function keeps_order

   !> A block in messages: its number and its name.
   pure function title(self, block) result(text)
      class(mission_options), intent(in) :: self
      integer, intent(in) :: block
      character(80) :: text

      write (text, '(a, i0)') 'block ', block
      if (.not. allocated(self%name)) return
      if (block <= size(self%name)) text = trim(text)//" '"//self%name(block)%text//"'"
   end function title

end module fw_mission_options
