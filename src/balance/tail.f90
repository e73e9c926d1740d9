!> The harmonics of the answer above those of a balance: what the structure answers to the contact
!> forces there, which are known from one event to the next,
!>
!>   u_n = -Z_n**-1 B^T lambda_n,   Z_n = K - (n omega)**2 M + i n omega C,   H < n <= n_tail.
!>
!> Z_n is that of all dofs and factored anew for each harmonic: this is done once a point, for
!> models of some hundred dofs.
module fw_tail
   use fw_contact_data, only: contact_type
   use fw_fourier, only: coefficient_count
   use fw_balance_state, only: balance_state
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type
   use fw_model, only: model_type
   use fw_point, only: point_type
   use fw_recovery, only: largest_magnitude
   use fw_side, only: terms_of
   implicit none (type, external)
   private

   public :: recover_tail

contains

   !> Lengthen the coefficients of a point, and those of its contact forces, to n_tail harmonics,
   !> where the system was evaluated last.
   subroutine recover_tail(system, model, contact, omega, n_tail, point)
      type(balance_state), intent(inout) :: system
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      !> Angular frequency [rad/s].
      real(wp), intent(in) :: omega
      integer, intent(in) :: n_tail
      type(point_type), intent(inout) :: point
      real(wp), allocatable :: force(:, :, :)
      complex(wp), allocatable :: answer(:)
      integer :: i, n, n_first

      ! 2 H + 1 rows: the first harmonic without coefficients is H + 1.
      n_first = (size(point%coefficients, 1) + 1)/2
      if (n_tail < n_first) return
      allocate (force(system%problem%n_pairs, 3, coefficient_count(n_tail)), source=0.0_wp)
      associate (pairs => system%problem%forces%pairs)
         call system%problem%forces%entry(pairs)%law%tail(system%work(pairs), n_tail, force)
      end associate
      call lengthen(point%coefficients, coefficient_count(n_tail))
      ! Nothing is fed back: the forces stay those of the balance.
      do n = n_first, n_tail
         call answer_to(model, contact, n*omega, force(:, :, 2*n:2*n + 1), answer)
         point%coefficients(2*n, :) = real(answer, wp)
         point%coefficients(2*n + 1, :) = -aimag(answer)
      end do
      point%amplitude = [(largest_magnitude(point%coefficients(:, i)), &
                          i=1, size(point%coefficients, 2))]
      if (allocated(point%force)) call lengthen_force(point, force)
   end subroutine recover_tail

   !> Observed quantities under the contact forces of one harmonic, complex amplitudes.
   subroutine answer_to(model, contact, s, force, answer)
      type(model_type), intent(in) :: model
      type(contact_type), intent(in) :: contact
      !> n omega [rad/s].
      real(wp), intent(in) :: s
      !> Cosine and sine coefficients (n_pairs, 3, 2).
      real(wp), intent(in) :: force(:, :, :)
      complex(wp), allocatable, intent(out) :: answer(:)
      type(complex_lu_type) :: lu
      complex(wp), allocatable :: u(:, :)
      logical :: singular

      allocate (u(model%n_dof, 1), source=(0.0_wp, 0.0_wp))
      ! u_r = u(side 1) - u(side 2): the load is -B^T lambda, on side 1, and its reaction on side 2.
      call add_forces(model, contact%side_1, -1.0_wp, force, u(:, 1))
      call add_forces(model, contact%side_2, 1.0_wp, force, u(:, 1))
      call lu%reserve(model%n_dof)
      lu%matrix = cmplx(model%stiffness - s**2*model%mass, s*model%damping + &
                        model%loss_factor*model%stiffness, wp)
      call lu%factor(singular)
      ! An undamped mode at this very harmonic: nothing is said of it.
      if (singular) u = (0.0_wp, 0.0_wp)
      if (.not. singular) call lu%solve(1, u)
      answer = matmul(model%observe_matrix, u(:, 1))
   end subroutine answer_to

   !> Add the forces on one side of all pairs to the dofs.
   pure subroutine add_forces(model, side, sign_of_side, force, load)
      type(model_type), intent(in) :: model
      integer, intent(in) :: side(:, :)
      real(wp), intent(in) :: sign_of_side, force(:, :, :)
      complex(wp), intent(inout) :: load(:)
      integer, allocatable :: dof(:)
      real(wp), allocatable :: weight(:)
      integer :: c, i

      do i = 1, size(side, 2)
         do c = 1, 3
            call terms_of(side(c, i), dof, weight, model%rows)
            load(dof) = load(dof) + sign_of_side*weight* &
                        cmplx(force(i, c, 1), -force(i, c, 2), wp)
         end do
      end do
   end subroutine add_forces

   !> More rows, filled with zeros.
   pure subroutine lengthen(values, n)
      real(wp), allocatable, intent(inout) :: values(:, :)
      integer, intent(in) :: n
      real(wp), allocatable :: longer(:, :)

      allocate (longer(n, size(values, 2)), source=0.0_wp)
      longer(:size(values, 1), :) = values
      call move_alloc(longer, values)
   end subroutine lengthen

   !> Coefficients of the contact forces: those of the balance stay as they are, behind them comes
   !> the tail. `force` is (n_pairs, 3, coefficient), that of a point (3, n_pairs, coefficient).
   pure subroutine lengthen_force(point, force)
      type(point_type), intent(inout) :: point
      real(wp), intent(in) :: force(:, :, :)
      real(wp), allocatable :: longer(:, :, :)
      integer :: k

      allocate (longer(3, size(force, 1), size(force, 3)))
      do k = 1, size(force, 3)
         longer(:, :, k) = transpose(force(:, :, k))
      end do
      longer(:, :, :size(point%force, 3)) = point%force
      call move_alloc(longer, point%force)
   end subroutine lengthen_force

end module fw_tail
