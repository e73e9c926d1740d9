!> Harmonics that meet a mode without damping of the structure as its linear springs and stuck pairs
!> hold it: no equation determines that motion. Without a load on it it is taken for none; with one
!> it grows without bound. Modes of the structure alone are the concern of the structure.
module fw_undetermined
   use fw_balance_state, only: balance_state
   use fw_force_law, only: pair_mixed
   use fw_kinds, only: wp
   use fw_linalg, only: complex_lu_type, is_positive_definite
   use fw_plain_structure, only: plain_structure
   use fw_stuck_modes, only: add_slopes
   implicit none (type, external)
   private

   public :: find_undetermined, damps_all

   !> Of the sizes of K and theta M: eigenvalues are good to some thousand times epsilon.
   real(wp), parameter :: round_off = 1.0e-12_wp
   !> Parts of a load, and of the motion at a joint, that are none.
   real(wp), parameter :: no_load = 1.0e-12_wp, no_motion = 1.0e-8_wp
   !> Coordinates whose blocks take no time beside what solves for them.
   integer, parameter :: most_coordinates = 500

contains

   !> Whether there is nothing to look for: no motion of the coordinates is without damping, or they
   !> are those of sectors, or too many.
   logical function damps_all(system)
      type(balance_state), intent(in) :: system
      complex(wp), allocatable :: k(:, :), m(:, :), c(:, :), observe(:, :)
      integer :: h, n

      damps_all = .true.
      n = system%problem%structure%n_coordinates
      if (n == 0 .or. n > most_coordinates) return
      select type (structure => system%problem%structure)
      type is (plain_structure)
         do h = 1, system%problem%fourier%n_retained
            if (system%problem%fourier%harmonic(h) > 0) exit
         end do
         if (h > system%problem%fourier%n_retained) return
         allocate (k(n, n), m(n, n), c(n, n), observe(structure%n_observed, n))
         call structure%parts(h, k, m, c, observe)
         damps_all = is_positive_definite(real(c, wp))
      end select
   end function damps_all

   !> Where the system was evaluated last: motions that no load drives, and those that one drives.
   subroutine find_undetermined(system, n_idle, n_driven)
      type(balance_state), intent(in) :: system
      integer, intent(out) :: n_idle, n_driven
      integer :: h

      n_idle = 0
      n_driven = 0
      associate (problem => system%problem)
         do h = 1, problem%fourier%n_retained
            if (problem%fourier%harmonic(h) > 0) call look_at(system, h, n_idle, n_driven)
         end do
      end associate
   end subroutine find_undetermined

   subroutine look_at(system, h, n_idle, n_driven)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      integer, intent(inout) :: n_idle, n_driven
      complex(wp), dimension(system%problem%structure%n_coordinates, &
                             system%problem%structure%n_coordinates) :: block, k, m, c
      complex(wp) :: observe(system%problem%structure%n_observed, size(block, 1))
      logical :: held(size(block, 1))
      integer, allocatable :: kept(:)
      integer :: j

      call system%problem%structure%block(system%structure_state, h, block)
      call system%problem%structure%parts(h, k, m, c, observe)
      held = .false.
      call add_slopes(system, h, 1, block, held)
      call add_slopes(system, h, 1, k, held)
      kept = pack([(j, j=1, size(held))], .not. held)
      if (size(kept) == 0) return
      associate (s => system%frequency()*system%problem%fourier%harmonic(h))
         call judge(system, h, kept, block(kept, kept), abs(k(kept, kept)) + &
                    s**2*abs(m(kept, kept)), system%structure_state%load(kept, h), n_idle, n_driven)
      end associate
   end subroutine look_at

   !> Inverse iteration from the load, which finds what it drives, and from a vector of no meaning.
   subroutine judge(system, h, kept, matrix, sizes, load, n_idle, n_driven)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h, kept(:)
      complex(wp), intent(in) :: matrix(:, :), load(:)
      !> Of elastic and inertial forces.
      real(wp), intent(in) :: sizes(:, :)
      integer, intent(inout) :: n_idle, n_driven
      type(complex_lu_type) :: lu
      complex(wp) :: v(size(load))
      logical :: singular
      integer :: j, n

      n = size(load)
      call lu%reserve(n)
      lu%matrix(:n, :n) = matrix
      call lu%factor(singular)
      if (singular) then
         ! Any pivot will do: far below what tells a mode.
         lu%matrix(:n, :n) = matrix
         do j = 1, n
            lu%matrix(j, j) = matrix(j, j) + epsilon(1.0_wp)*sizes(j, j)
         end do
         call lu%factor(singular)
         if (singular) return
      end if
      if (any(abs(load) > 0.0_wp)) then
         v = load
         if (meets(system, h, kept, lu, matrix, sizes, v)) then
            if (abs(dot_product(v, load)) > no_load*norm2(abs(load))) then
               n_driven = n_driven + 1
               return
            end if
            n_idle = n_idle + 1
            return
         end if
      end if
      v = [(cmplx(cos(real(j**2, wp)), sin(real(3*j, wp)), wp), j=1, n)]
      if (meets(system, h, kept, lu, matrix, sizes, v)) n_idle = n_idle + 1
   end subroutine judge

   !> Whether v tends to a motion without forces, which moves no nonlinear spring.
   logical function meets(system, h, kept, lu, matrix, sizes, v)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h, kept(:)
      type(complex_lu_type), intent(in) :: lu
      complex(wp), intent(in) :: matrix(:, :)
      real(wp), intent(in) :: sizes(:, :)
      complex(wp), intent(inout) :: v(:)
      complex(wp) :: column(size(v), 1)
      integer :: j

      meets = .false.
      do j = 1, 3
         column(:, 1) = v
         call lu%solve(1, column)
         if (.not. norm2(abs(column)) > 0.0_wp) return
         v = column(:, 1)/maxval(abs(column))
         v = v/norm2(abs(v))
      end do
      meets = abs(dot_product(v, matmul(matrix, v))) <= &
              round_off*dot_product(abs(v), matmul(sizes, abs(v)))
      if (meets) meets = .not. is_nonlinear(system, h, kept, v)
   end function meets

   !> Whether a motion moves what is not linear, a spring or a pair that slips or parts, or makes a
   !> force there.
   logical function is_nonlinear(system, h, kept, v)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h, kept(:)
      complex(wp), intent(in) :: v(:)
      complex(wp) :: row(system%problem%structure%n_coordinates)
      complex(wp), dimension(size(row)) :: force, whole
      integer :: c, i, k

      is_nonlinear = .false.
      whole = (0.0_wp, 0.0_wp)
      whole(kept) = v
      call force_of(system, h, whole, force)
      do k = 1, system%problem%forces%n_laws
         associate (entry => system%problem%forces%entry(k))
            do i = 1, size(entry%row, 2)
               if (is_linear(system, k, i)) cycle
               do c = 1, size(entry%row, 1)
                  if (entry%row(c, i) == 0) cycle
                  row = (0.0_wp, 0.0_wp)
                  call system%problem%incidence%scatter_harmonic(entry%row(c, i), h, &
                                                                 (1.0_wp, 0.0_wp), row)
                  is_nonlinear = is_nonlinear .or. abs(dot_product(row, whole)) > no_motion
                  if (entry%law%prediction%takes_balance) is_nonlinear = is_nonlinear .or. &
                     abs(force(system%problem%incidence%coordinate_of(entry%row(c, i)))) > no_motion
               end do
            end do
         end associate
      end do
   end function is_nonlinear

   !> Forces of the structure, over the largest of its stiffness.
   subroutine force_of(system, h, whole, force)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      complex(wp), intent(in) :: whole(:)
      complex(wp), intent(out) :: force(:)
      complex(wp) :: block(size(whole), size(whole))

      call system%problem%structure%block(system%structure_state, h, block)
      force = matmul(block, whole)/max(maxval(abs(block)), tiny(1.0_wp))
   end subroutine force_of

   !> Whether a force is in proportion to the motion about the mean position.
   pure logical function is_linear(system, law, element)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: law, element
      real(wp) :: slopes(2)

      if (law == system%problem%forces%pairs) then
         is_linear = system%work(law)%state(element) /= pair_mixed
      else
         associate (entry => system%problem%forces%entry(law))
            slopes = [entry%law%slope_at(element, 1.0_wp), entry%law%slope_at(element, 2.0_wp)]
         end associate
         is_linear = abs(slopes(2) - slopes(1)) <= epsilon(1.0_wp)*abs(slopes(1))
      end if
   end function is_linear


end module fw_undetermined
