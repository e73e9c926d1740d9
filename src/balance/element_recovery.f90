!> Forces and work of elements that are neither pairs nor springs, of a solved vibration.
module fw_element_recovery
   use fw_balance_state, only: balance_state
   use fw_fourier, only: coefficient_count
   use fw_kinds, only: pi, wp
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: recover_elements

contains

   !> Of every kind, at the motion x where the system was evaluated last.
   subroutine recover_elements(system, x, n_harmonics, point)
      type(balance_state), intent(inout) :: system
      real(wp), intent(in), contiguous :: x(:)
      integer, intent(in) :: n_harmonics
      type(point_type), intent(inout) :: point
      integer :: k

      if (.not. allocated(system%problem%forces%elements)) return
      allocate (point%elements(size(system%problem%forces%elements)))
      do k = 1, size(point%elements)
         if (system%problem%forces%elements(k) > 0) call recover_kind( &
            system, system%problem%forces%elements(k), size(system%balance, 1), x, n_harmonics, &
            point%elements(k)%force, point%elements(k)%work)
      end do
   end subroutine recover_elements

   !> Work over a cycle, taken from the structure: sum_n pi n (f_c u_s - f_s u_c).
   subroutine recover_kind(system, law, m, q, n_harmonics, force, work)
      type(balance_state), intent(inout) :: system
      integer, intent(in) :: law, m, n_harmonics
      real(wp), intent(in) :: q(m, *)
      !> (input, element, coefficient), and (element).
      real(wp), allocatable, intent(out) :: force(:, :, :), work(:)
      real(wp), allocatable :: u(:, :, :)
      integer :: c, h, i, k, n, nc

      associate (f => system%work(law)%force, fourier => system%problem%fourier)
         nc = fourier%n_coefficients
         allocate (u, mold=f)
         call system%problem%incidence%gather(system%problem%forces%entry(law)%rows, m, nc, q, u)
         allocate (force(size(f, 2), size(f, 1), coefficient_count(n_harmonics)), source=0.0_wp)
         allocate (work(size(f, 1)), source=0.0_wp)
         do h = 1, fourier%n_retained
            n = fourier%harmonic(h)
            k = fourier%column(h)
            if (n > n_harmonics) cycle
            do c = 0, merge(0, 1, n == 0)
               force(:, :, max(1, 2*n) + c) = transpose(f(:, :, k + c))
            end do
            if (n == 0) cycle
            do i = 1, size(work)
               work(i) = work(i) + pi*n*sum(f(i, :, k)*u(i, :, k + 1) - f(i, :, k + 1)*u(i, :, k))
            end do
         end do
      end associate
   end subroutine recover_kind

end module fw_element_recovery
