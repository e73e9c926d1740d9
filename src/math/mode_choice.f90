!> The linear mode of a number, or nearest to a frequency, among those that oscillate: in ascending
!> order of omega, damping, Coriolis forces and those of the air included (fw_self_excited_modes).
module fw_mode_choice
   use fw_hermitian, only: congruence, product_of
   use fw_kinds, only: wp
   use fw_self_excited_mode, only: mode_pencil, refine_mode, self_excited_mode
   use fw_self_excited_modes, only: mode_search
   implicit none (type, external)
   private

   public :: modes_at_rest, mode_choice, choose_mode, list_modes, mode_from_rest

   !> Modes of K and M alone, of the Hermitian part of K.
   type :: modes_at_rest
      !> Ascending [rad/s], above 0 (n_modes); shapes of any size (n, n_modes).
      real(wp), allocatable :: omega(:)
      complex(wp), allocatable :: shape(:, :)
      !> Rigid motions (n, n_rigid).
      complex(wp), allocatable :: rigid_motions(:, :)
      !> K + shift M is positive definite.
      real(wp) :: shift = 0.0_wp
   end type modes_at_rest

   type :: mode_choice
      !> False where no eigenvalues were found.
      logical :: done = .false.
      !> Its number; how many there are, at least, and how many do not oscillate of those looked at.
      integer :: number = 0, n_modes = 0, n_overdamped = 0
      type(self_excited_mode) :: mode
      !> Number of another of the same frequency and damping, 0: none.
      integer :: twin = 0
      !> The mode at rest from which Newton's method comes to it, 0: from `mode` alone.
      integer :: from_rest = 0
      !> How exact `mode` is, as a part of its frequency.
      real(wp) :: part = 1.0e-6_wp
   end type mode_choice

   !> Two modes nearer than this part of their frequency are one: the plane of the motion is free.
   real(wp), parameter :: same = 1.0e-6_wp
   !> What Newton's method leaves.
   real(wp), parameter :: round_off = 1.0e-8_wp
   !> Dofs above which modes are first sought among motions of modes at rest, of so many beyond the
   !> one in question, and what that leaves of frequency and damping.
   integer, parameter :: most_dofs = 120, more_at_rest = 80
   real(wp), parameter :: of_projection = 5.0e-2_wp
   !> Dofs up to which all modes are listed.
   integer, parameter :: most_listed = 60
   !> Frequencies below this part of the lowest one at rest are those of rigid motions.
   real(wp), parameter :: far_below = 1.0e-5_wp

contains

   subroutine choose_mode(pencil, rest, number, near, choice)
      type(mode_pencil), intent(in) :: pencil
      type(modes_at_rest), intent(in) :: rest
      integer, intent(in) :: number
      !> 0: by number [rad/s].
      real(wp), intent(in) :: near
      type(mode_choice), intent(out) :: choice
      type(mode_search) :: search
      complex(wp), allocatable :: basis(:, :), u(:)
      integer :: j

      choice%number = number
      ! Rigid motions alone are no modes.
      choice%done = size(rest%omega) == 0
      if (choice%done) return
      search%number = number
      search%near = near
      if (is_proportional(pencil, rest, n_looked_at(rest, search))) then
         call list_at_rest(pencil, rest, search)
      else
         call search_all(pencil, rest, search, basis)
      end if
      choice%done = search%works
      choice%n_modes = search%n_found
      choice%n_overdamped = search%n_overdamped
      if (near > 0.0_wp .and. search%n_found > 0) choice%number = search%nearest_to(near)
      if (.not. choice%done .or. choice%number > search%n_found) return
      choice%mode = search%found(choice%number)
      do j = 1, search%n_found
         if (j == choice%number) cycle
         if (search%found(j)%is_nearly(choice%mode, same)) choice%twin = j
      end do
      choice%from_rest = choice%mode%at_rest
      if (choice%from_rest == 0) then
         if (rest_leads_to(rest, search, choice, allocated(basis))) choice%from_rest = choice%number
      end if
      if (.not. allocated(basis)) return
      choice%part = of_projection
      u = matmul(basis, choice%mode%shape)
      call move_alloc(u, choice%mode%shape)
   end subroutine choose_mode

   !> Frequencies of all modes that oscillate; of a large structure those at rest.
   subroutine list_modes(pencil, rest, omega)
      type(mode_pencil), intent(in) :: pencil
      type(modes_at_rest), intent(in) :: rest
      !> Ascending [rad/s].
      real(wp), allocatable, intent(out) :: omega(:)
      type(mode_search) :: search
      complex(wp), allocatable :: basis(:, :)
      integer :: j

      omega = rest%omega
      if (size(omega) == 0 .or. size(pencil%m, 1) > most_listed) return
      search%number = huge(search%number)
      if (is_proportional(pencil, rest, size(omega))) then
         call list_at_rest(pencil, rest, search)
      else
         call search_all(pencil, rest, search, basis)
      end if
      if (search%works) omega = [(search%found(j)%omega, j=1, search%n_found)]
   end subroutine list_modes

   !> Whether damping leaves the shapes as they are, and nothing else acts: then the modes at rest
   !> are all modes.
   logical function is_proportional(pencil, rest, n_modes)
      type(mode_pencil), intent(in) :: pencil
      type(modes_at_rest), intent(in) :: rest
      !> Those that are looked at, from the lowest on.
      integer, intent(in) :: n_modes
      complex(wp), allocatable :: cu(:, :), mu(:, :)
      real(wp) :: ratio
      integer :: j

      associate (k => pencil%k)
         is_proportional = norm2(abs(k - conjg(transpose(k)))) <= round_off*norm2(abs(k))
      end associate
      if (.not. is_proportional) return
      cu = product_of(pencil%c, rest%shape(:, :n_modes))
      mu = product_of(pencil%m, rest%shape(:, :n_modes))
      do j = 1, n_modes
         associate (c => cu(:, j), m => mu(:, j))
            ratio = real(dot_product(m, c), wp)/real(dot_product(m, m), wp)
            is_proportional = norm2(abs(c - ratio*m)) <= &
                              round_off*max(norm2(abs(c)), round_off*rest%omega(j)*norm2(abs(m)))
         end associate
         if (.not. is_proportional) return
      end do
   end function is_proportional

   !> Those of the modes at rest that oscillate.
   subroutine list_at_rest(pencil, rest, search)
      type(mode_pencil), intent(in) :: pencil
      type(modes_at_rest), intent(in) :: rest
      type(mode_search), intent(inout) :: search
      type(self_excited_mode) :: mode
      integer :: j

      do j = 1, size(rest%omega)
         mode = mode_from_rest(pencil, rest%omega(j), rest%shape(:, j))
         mode%at_rest = j
         call search%keep(mode)
         if (search%has_enough()) return
      end do
   end subroutine list_at_rest

   !> A mode at rest, and the self-excitation that its damping asks for.
   function mode_from_rest(pencil, omega, shape_of) result(mode)
      type(mode_pencil), intent(in) :: pencil
      real(wp), intent(in) :: omega
      complex(wp), intent(in) :: shape_of(:)
      type(self_excited_mode) :: mode

      mode%omega = omega
      mode%shape = shape_of
      mode%self_excitation = real(dot_product(shape_of, matmul(pencil%c, shape_of)), wp)/ &
                             real(dot_product(shape_of, matmul(pencil%m, shape_of)), wp)
   end function mode_from_rest

   !> All modes of a small structure; of a large one those of its lowest modes at rest together.
   subroutine search_all(pencil, rest, search, basis)
      type(mode_pencil), intent(in) :: pencil
      type(modes_at_rest), intent(in) :: rest
      type(mode_search), intent(inout) :: search
      !> Only of a large one (n, n_basis).
      complex(wp), allocatable, intent(out) :: basis(:, :)

      search%shift = rest%shift
      if (size(pencil%m, 1) <= most_dofs) then
         search%pencil = pencil
      else
         basis = joined(rest%rigid_motions, rest%shape(:, :n_looked_at(rest, search)))
         search%pencil%k = congruence(basis, pencil%k, basis)
         search%pencil%m = congruence(basis, pencil%m, basis)
         search%pencil%c = congruence(basis, pencil%c, basis)
      end if
      call search%find(far_below*rest%omega(1), rest%omega)
   end subroutine search_all

   !> Modes at rest that say which is which: all of a small structure.
   pure integer function n_looked_at(rest, search) result(n)
      type(modes_at_rest), intent(in) :: rest
      type(mode_search), intent(in) :: search

      n = size(rest%omega)
      if (size(rest%shape, 1) <= most_dofs) return
      n = min(n, max(search%number, count(rest%omega < search%near)) + more_at_rest)
   end function n_looked_at

   !> Columns beside columns.
   pure function joined(a, b) result(both)
      complex(wp), intent(in) :: a(:, :), b(:, :)
      complex(wp) :: both(size(a, 1), size(a, 2) + size(b, 2))

      both(:, :size(a, 2)) = a
      both(:, size(a, 2) + 1:) = b
   end function joined

   !> Whether Newton's method from the mode at rest of the same number comes to the one in question.
   logical function rest_leads_to(rest, search, choice, is_projected) result(leads)
      type(modes_at_rest), intent(in) :: rest
      type(mode_search), intent(in) :: search
      type(mode_choice), intent(in) :: choice
      !> The search is in coordinates of the modes at rest, after rigid motions.
      logical, intent(in) :: is_projected
      type(self_excited_mode) :: mode
      complex(wp) :: shape_of(size(search%pencil%m, 1))
      integer :: j

      j = choice%number
      leads = j <= size(rest%omega)
      if (.not. leads) return
      ! Of one frequency at rest any shape in their plane is a mode there, of no use here.
      leads = count(abs(rest%omega - rest%omega(j)) <= same*rest%omega(j)) == 1
      if (.not. leads) return
      if (is_projected) then
         shape_of = (0.0_wp, 0.0_wp)
         shape_of(size(rest%rigid_motions, 2) + j) = (1.0_wp, 0.0_wp)
      else
         shape_of = rest%shape(:, j)
      end if
      mode = mode_from_rest(search%pencil, rest%omega(j), shape_of)
      call refine_mode(search%pencil, conjg(shape_of), mode, leads)
      leads = leads .and. mode%is_nearly(choice%mode, round_off)
   end function rest_leads_to

end module fw_mode_choice
