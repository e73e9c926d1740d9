!> Keys that there were, and what says the same now: told where a case still has one of them. And
!> keys that are looked for where they are not: what a model alone says.
module fw_former_keys
   implicit none (type, external)
   private

   public :: hint_of_former_key

   type :: former_key
      character(12) :: group
      character(20) :: name
      !> What to do, naming the key to use.
      character(150) :: remedy
   end type former_key

   character(*), parameter :: of_levels = 'use harmonics%accuracy, which chooses the harmonics '// &
      'of each point by the error of the response, or give harmonics%n_harmonics'
   character(*), parameter :: of_pieces = &
      'use sweep%start, sweep%end and sweep%n_points of the '// &
      'part that is wanted, or let --workers cut the sweep (workers in Python)'

   character(*), parameter :: of_bodies = 'bodies are those of the model file (/body, made by '// &
      'fretwear.damper); &body gives other masses alone'

   type(former_key), parameter :: former(*) = [ &
      former_key('body', 'name', of_bodies), former_key('body', 'radius', of_bodies), &
      former_key('body', 'inertia', of_bodies), former_key('body', 'dof', of_bodies), &
      former_key('body', 'n_bodies', of_bodies), former_key('body', 'direction', of_bodies), &
      former_key('harmonics', 'adaptive', of_levels), &
      former_key('harmonics', 'adaptive_tolerance', of_levels), &
      former_key('sweep', 'frequencies', 'is read as sweep%values: keep one of the two'), &
      former_key('sweep', 'first_point', of_pieces), &
      former_key('sweep', 'last_point', of_pieces), &
      former_key('sweep', 'lead_points', of_pieces), &
      former_key('solver', 'jacobian', 'the derivative is the analytic one: leave it out, '// &
                 'and choose the solver by solver%kind and solver%linear')]

contains

   !> `; use ...`, or nothing where there never was such a key.
   pure function hint_of_former_key(group, name) result(hint)
      character(*), intent(in) :: group, name
      character(:), allocatable :: hint
      integer :: i

      hint = ''
      do i = 1, size(former)
         if (former(i)%group /= group .or. former(i)%name /= name) cycle
         hint = '; '//trim(former(i)%remedy)
      end do
   end function hint_of_former_key

end module fw_former_keys
