!> Time of one product with the condensed stiffness, from complex matrices and from real blocks, and
!> of going to a frequency. Writes one line of comma-separated values for each size; the choice in
!> src/model/plain_structure.f90 rests on it.
program products
   use, intrinsic :: iso_fortran_env, only: int64, output_unit
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_plain_structure, only: new_plain_structure, plain_structure
   use fw_relative, only: new_relative, relative_type
   use fw_structure_operator, only: structure_state
   use fw_threads, only: thread_scope
   implicit none (type, external)

   integer, parameter :: coordinates(*) = [24, 48, 96, 144, 288, 576]
   integer, parameter :: internal(*) = [24, 48, 96]
   integer, parameter :: harmonics(*) = [3, 7, 17]
   !> Time of one sample [s], and samples of which the median counts.
   real(wp), parameter :: sample_seconds = 5.0e-3_wp
   integer, parameter :: n_samples = 5
   type(thread_scope) :: scope
   integer :: h, i, m

   call scope%enter(1)
   write (output_unit, '(a)') 'n_coordinates,n_internal,n_harmonics,formed,real,formed_at,real_at'
   do m = 1, size(coordinates)
      do i = 1, size(internal)
         do h = 1, size(harmonics)
            call compare(coordinates(m), internal(i), harmonics(h))
         end do
      end do
   end do
   call scope%leave()

contains

   !> Measure one size and write its line.
   subroutine compare(m, n_internal, n_harmonics)
      integer, intent(in) :: m, n_internal, n_harmonics
      type(model_type) :: model
      type(relative_type) :: relative
      type(plain_structure) :: structure
      class(structure_state), allocatable :: state
      type(error_type), allocatable :: error
      real(wp) :: seconds(2), at_seconds(2)
      integer :: i, way

      model = random_model(m + n_internal)
      call new_relative(model%n_dof, [(i, i=1, m)], [(0, i=1, m)], relative)
      do way = 1, 2
         call new_plain_structure(model, relative, [(i, i=0, n_harmonics)], [1.0_wp, 2.0_wp], &
                                  structure, error, forms_blocks=way == 1)
         if (allocated(error)) error stop 'products: no structure'
         call structure%new_state(state)
         call measure(structure, state, seconds(way), at_seconds(way))
      end do
      write (output_unit, '(3(i0, ","), 3(es10.3, ","), es10.3)') m, n_internal, n_harmonics, &
         seconds, at_seconds
   end subroutine compare

   !> Masses between stiff springs in a line, with some of everything else, damped.
   function random_model(n) result(model)
      integer, intent(in) :: n
      type(model_type) :: model
      real(wp) :: some(n, n)
      integer :: i

      call random_number(some)
      model%n_dof = n
      model%stiffness = 0.5_wp*(some + transpose(some))/n
      do i = 1, n
         model%stiffness(i, i) = model%stiffness(i, i) + 2.0_wp
      end do
      model%mass = 0.1_wp*model%stiffness
      model%damping = 0.01_wp*model%stiffness
      do i = 1, n
         model%mass(i, i) = model%mass(i, i) + 1.0_wp
      end do
      allocate (model%load_static(n), model%load_cosine(n), model%load_sine(n), source=1.0_wp)
      allocate (model%observe_matrix(1, n), source=0.0_wp)
   end function random_model

   !> Median time of a product, and of going to a frequency [s].
   subroutine measure(structure, state, seconds, at_seconds)
      type(plain_structure), intent(in) :: structure
      class(structure_state), intent(inout) :: state
      real(wp), intent(out) :: seconds, at_seconds
      real(wp), allocatable :: q(:), product(:)
      type(error_type), allocatable :: error
      integer(int64) :: start, now, rate
      real(wp) :: samples(n_samples)
      integer :: i, k, n

      n = structure%n_coordinates*structure%n_coefficients
      allocate (q(n), product(n), source=1.0_wp)
      do i = 1, n_samples
         call system_clock(start, rate)
         call structure%at(state, 1.0_wp + 0.1_wp*i, 0.0_wp, error)
         call system_clock(now)
         samples(i) = real(now - start, wp)/real(rate, wp)
      end do
      at_seconds = median(samples)
      do i = 1, n_samples
         k = 0
         call system_clock(start)
         do
            call structure%multiply(state, q, product)
            k = k + 1
            call system_clock(now)
            if (now - start > sample_seconds*rate) exit
         end do
         samples(i) = real(now - start, wp)/real(rate*k, wp)
      end do
      seconds = median(samples)
   end subroutine measure

   real(wp) function median(samples)
      real(wp), intent(in) :: samples(:)
      integer :: i

      median = samples(1)
      do i = 1, size(samples)
         if (count(samples < samples(i)) <= size(samples)/2) median = max(median, samples(i))
      end do
      do i = 1, size(samples)
         if (count(samples <= samples(i)) > size(samples)/2) median = min(median, samples(i))
      end do
   end function median

end program products
