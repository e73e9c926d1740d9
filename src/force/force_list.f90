!> The nonlinear forces of a case: laws one after another, and the rows of the relative
!> displacements that their elements act on. Laws whose prediction takes the balance come last, for
!> they count the forces of the others.
!>
!> The list is written once; each law leaves what it evaluates in a workspace of its own, at the
!> same place in an array of workspaces.
module fw_force_list
   use fw_force_law, only: force_law, force_workspace
   use fw_fourier, only: fourier_type
   implicit none (type, external)
   private

   public :: force_list, force_entry

   type :: force_entry
      class(force_law), allocatable :: law
      !> Row of each component of each element, 0 where there is none (n_components, n_elements).
      integer, allocatable :: row(:, :)
      !> The same in the order of inputs and forces: all first components, then the others.
      integer, allocatable :: rows(:)
      !> Of those the ones whose inputs are without the balance, and those that take it; 0 for the
      !> others.
      integer, allocatable :: free_rows(:), rigid_rows(:)
   end type force_entry

   type :: force_list
      integer :: n_laws = 0
      !> Place of the law of the contact pairs.
      integer :: pairs = 0
      !> Place of the law of each kind of elements, 0 where there are none (n_element_kinds), and of
      !> the springs.
      integer, allocatable :: elements(:)
      integer :: springs = 0
      type(force_entry), allocatable :: entry(:)
   contains
      procedure :: add
      procedure :: reserve
      procedure :: least_instants
      procedure :: takes_balance
   end type force_list

contains

   !> Append a law, with the rows of its elements.
   subroutine add(self, law, row)
      class(force_list), intent(inout) :: self
      class(force_law), intent(in) :: law
      integer, intent(in) :: row(:, :)
      type(force_entry), allocatable :: longer(:)
      integer :: k

      allocate (longer(self%n_laws + 1))
      do k = 1, self%n_laws
         call move_alloc(self%entry(k)%law, longer(k)%law)
         call move_alloc(self%entry(k)%row, longer(k)%row)
         call move_alloc(self%entry(k)%rows, longer(k)%rows)
         call move_alloc(self%entry(k)%free_rows, longer(k)%free_rows)
         call move_alloc(self%entry(k)%rigid_rows, longer(k)%rigid_rows)
      end do
      self%n_laws = self%n_laws + 1
      allocate (longer(self%n_laws)%law, source=law)
      longer(self%n_laws)%row = row
      call list_rows(longer(self%n_laws))
      call move_alloc(longer, self%entry)
   end subroutine add

   !> The rows of an entry in the order of inputs and forces.
   pure subroutine list_rows(entry)
      type(force_entry), intent(inout) :: entry
      logical :: takes(size(entry%row, 1), size(entry%row, 2))
      integer :: i

      do i = 1, size(takes, 2)
         takes(:, i) = entry%law%prediction%takes(i)
      end do
      entry%rows = reshape(transpose(entry%row), [size(entry%row)])
      entry%free_rows = reshape(transpose(merge(0, entry%row, takes)), [size(entry%row)])
      entry%rigid_rows = reshape(transpose(merge(entry%row, 0, takes)), [size(entry%row)])
   end subroutine list_rows

   !> Workspaces of all laws, for one that evaluates (n_laws).
   subroutine reserve(self, fourier, work)
      class(force_list), intent(in) :: self
      type(fourier_type), intent(in) :: fourier
      type(force_workspace), allocatable, intent(out) :: work(:)
      integer :: k

      allocate (work(self%n_laws))
      do k = 1, self%n_laws
         call self%entry(k)%law%reserve(fourier, work(k))
      end do
   end subroutine reserve

   !> Instants that laws which decide at instants need for harmonics 0..n_harmonics.
   pure integer function least_instants(self, n_harmonics, separates) result(n_time)
      class(force_list), intent(in) :: self
      integer, intent(in) :: n_harmonics
      !> Whether elements may separate, or their normal load varies.
      logical, intent(in) :: separates
      integer :: k, per_harmonic

      n_time = 0
      do k = 1, self%n_laws
         if (self%entry(k)%law%n_elements == 0) cycle
         associate (facts => self%entry(k)%law%facts)
            if (facts%follows_events) cycle
            per_harmonic = merge(facts%instants_with_separation, facts%instants_per_harmonic, &
                                 separates)
            n_time = max(n_time, facts%fewest_instants, &
                         per_harmonic*n_harmonics + facts%further_instants)
         end associate
      end do
   end function least_instants

   !> Whether a law takes the balance: what its pairs do depends on the forces of all others then.
   pure logical function takes_balance(self)
      class(force_list), intent(in) :: self
      integer :: k

      takes_balance = .false.
      do k = 1, self%n_laws
         takes_balance = takes_balance .or. self%entry(k)%law%prediction%takes_balance
      end do
   end function takes_balance

end module fw_force_list
