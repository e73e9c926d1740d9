!> Modes of a cyclic structure in the nodal diameter of its first harmonic, with its joint in a
!> linear state: what fw_joint_modes finds of other structures.
module fw_sector_modes
   use fw_body, only: body_type
   use fw_cyclic_data, only: nodal_matrices, nodal_speed
   use fw_error, only: error_type
   use fw_hermitian, only: is_regular, solve_hermitian_eigen
   use fw_kinds, only: wp
   use fw_laws, only: build_law
   use fw_modes, only: least_width, mode_type
   use fw_pair_law, only: pair_law
   use fw_sector, only: add_sector_spring, sector_at, sector_rows, speed_at
   use fw_sector_uncondensed, only: add_multiple
   use fw_whirl_modes, only: find_whirl, most_whirling, wave_matrices, wave_of
   implicit none (type, external)
   private

   public :: find_sector_modes

   !> As of fw_modes and fw_joint_modes, with the same reasons.
   real(wp), parameter :: massless = 1.0e-13_wp, hold = 1.0e6_wp
   real(wp), parameter :: shift_trials(*) = [0.0_wp, 1.0e-3_wp, 1.0_wp]

contains

   !> The modes with frequencies within a range; none where the pencil has no solution.
   subroutine find_sector_modes(case, harmonic, first_component, range, modes)
      class(body_type), intent(in) :: case
      !> Of which the loads act, in its nodal diameter.
      integer, intent(in) :: harmonic
      !> Components of the pairs from this one on are held; 4: none.
      integer, intent(in) :: first_component
      !> Lowest and highest frequency [rad/s].
      real(wp), intent(in) :: range(2)
      type(mode_type), allocatable, intent(out) :: modes(:)
      type(nodal_matrices) :: nodal
      type(error_type), allocatable :: error
      complex(wp), allocatable :: shapes(:, :), load(:)
      real(wp), allocatable :: theta(:)
      integer, allocatable :: in_range(:)
      real(wp) :: shift, square
      integer :: i, j, k, trial
      logical :: done

      allocate (modes(0))
      allocate (in_range(0))
      k = abs(case%model%cyclic%nodal_diameter(harmonic))
      if (.not. case%model%cyclic%holds(k)) return
      call sector_at(case%model, k, nodal, error)
      if (allocated(error)) return
      call hold_joint(case, k, first_component, nodal%stiffness)
      if (nodal%has_whirl() .or. allocated(case%model%cyclic%speed)) then
         call find_waves(case, nodal, harmonic, range, modes)
         return
      end if
      do trial = merge(1, 2, is_regular(nodal%stiffness)), size(shift_trials)
         shift = shift_trials(trial)*norm2(abs(nodal%stiffness))/ &
                 max(norm2(abs(nodal%mass)), tiny(1.0_wp))
         call solve_hermitian_eigen(nodal%mass, nodal%stiffness + shift*nodal%mass, theta, shapes, &
                                    done)
         if (done) exit
      end do
      if (.not. done) return
      do j = size(theta), 1, -1
         if (theta(j) <= massless*theta(size(theta))) exit
         square = 1.0_wp/theta(j) - shift
         if (square < range(1)**2 .or. square > range(2)**2 .or. square <= 0.0_wp) cycle
         in_range = [in_range, j]
      end do
      load = load_in(nodal, harmonic, case%model%cyclic%nodal_diameter(harmonic) < 0, &
                     0.5_wp*sum(range))
      deallocate (modes)
      allocate (modes(size(in_range)))
      do i = 1, size(in_range)
         j = in_range(i)
         call describe(sqrt(1.0_wp/theta(j) - shift), shapes(:, j)/sqrt(theta(j)), nodal, load, &
                       modes(i))
      end do
   end subroutine find_sector_modes

   !> The load of a harmonic as it acts on the matrices of 0 to N/2: where the harmonic takes their
   !> conjugates, the conjugate of its own.
   pure function load_in(nodal, harmonic, conjugated, s) result(load)
      type(nodal_matrices), intent(in) :: nodal
      integer, intent(in) :: harmonic
      logical, intent(in) :: conjugated
      !> Its frequency [rad/s].
      real(wp), intent(in) :: s
      complex(wp) :: load(size(nodal%load, 1)), i
      integer :: w

      i = merge((0.0_wp, -1.0_wp), (0.0_wp, 1.0_wp), conjugated)
      load = (0.0_wp, 0.0_wp)
      if (harmonic == 1) load = nodal%load(:, 2) - i*nodal%load(:, 3)
      do w = 1, nodal%waves%n_waves()
         load = load + nodal%waves%factor(w, harmonic, s)* &
                (nodal%load(:, 2*w + 2) - i*nodal%load(:, 2*w + 3))
      end do
   end function load_in

   !> Where waves in both directions differ: those the way of the harmonic.
   subroutine find_waves(case, nodal, harmonic, range, modes)
      class(body_type), intent(in) :: case
      type(nodal_matrices), intent(in) :: nodal
      integer, intent(in) :: harmonic
      real(wp), intent(in) :: range(2)
      type(mode_type), allocatable, intent(inout) :: modes(:)
      type(wave_matrices) :: wave
      type(nodal_speed) :: speed
      complex(wp), allocatable :: root(:), right(:, :), left(:, :), load(:), observe(:, :)
      complex(wp) :: slope
      integer, allocatable :: chosen(:)
      logical :: conjugated
      integer :: i, j

      if (size(nodal%mass, 1) > most_whirling) return
      conjugated = case%model%cyclic%nodal_diameter(harmonic) < 0
      call wave_of(nodal, nodal%stiffness, conjugated, wave)
      if (allocated(case%model%cyclic%speed)) then
         call speed_at(case%model, abs(case%model%cyclic%nodal_diameter(harmonic)), speed)
         ! Of a range without end the speeds that the matrices are known at.
         call follow_speed(speed, harmonic, conjugated, &
                           min(0.5_wp*sum(range), harmonic*speed%order* &
                               case%model%cyclic%speed%growth%highest), wave)
      end if
      call find_whirl(wave, root, right, left)
      load = load_in(nodal, harmonic, conjugated, 0.5_wp*sum(range))
      observe = nodal%observe
      if (conjugated) then
         load = conjg(load)
         observe = conjg(observe)
      end if
      chosen = pack([(i, i=1, size(root))], aimag(root) >= range(1) .and. aimag(root) <= range(2))
      deallocate (modes)
      allocate (modes(size(chosen)))
      do j = 1, size(chosen)
         i = chosen(j)
         ! Near a root Z(lambda) is (lambda - root) y^H Z' x.
         slope = dot_product(left(:, i), 2.0_wp*root(i)*matmul(wave%mass, right(:, i)) + &
                             matmul(wave%damping, right(:, i)))
         modes(j)%omega = aimag(root(i))
         modes(j)%width = -2.0_wp*real(root(i), wp)
         modes(j)%amplitude = abs(matmul(observe, right(:, i)))* &
                              abs(dot_product(left(:, i), load))/ &
                              max(abs(slope)*0.5_wp*max(abs(modes(j)%width), &
                                                        least_width*modes(j)%omega), tiny(1.0_wp))
      end do
   end subroutine find_waves

   !> Critical speeds: with lambda = i n omega and Omega = omega/p the forces of the speed are some
   !> of lambda and of its square. Higher powers of Omega are replaced by the tangent in Omega**2 at
   !> the middle of the range, to which roots are near.
   pure subroutine follow_speed(speed, harmonic, conjugated, middle, wave)
      type(nodal_speed), intent(in) :: speed
      integer, intent(in) :: harmonic
      !> Whether the wave runs the other way than the matrices.
      logical, intent(in) :: conjugated
      !> Frequency of the harmonic [rad/s].
      real(wp), intent(in) :: middle
      type(wave_matrices), intent(inout) :: wave
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      complex(wp), allocatable :: level(:, :), slope(:, :)
      real(wp) :: np, x
      integer :: p

      np = harmonic*speed%order
      call add_multiple(speed%coriolis, -i/np, conjugated, wave%mass)
      call add_multiple(speed%circulatory, -i/np, conjugated, wave%damping)
      if (speed%n_powers() == 0) return
      ! x: square of the speed there.
      x = (middle/np)**2
      allocate (level, slope, mold=wave%mass)
      level = (0.0_wp, 0.0_wp)
      slope = (0.0_wp, 0.0_wp)
      do p = 1, speed%n_powers()
         slope = slope + p*x**(p - 1)*speed%stiffness(:, :, p)
         if (p > 1) level = level + (1 - p)*x**p*speed%stiffness(:, :, p)
      end do
      call add_multiple(slope, -(1.0_wp + i*speed%loss)/np**2, conjugated, wave%mass)
      call add_multiple(level, 1.0_wp + i*speed%loss, conjugated, wave%stiffness)
   end subroutine follow_speed

   !> Linear springs, and what the contact holds.
   subroutine hold_joint(case, k, first_component, stiffness)
      class(body_type), intent(in) :: case
      integer, intent(in) :: k, first_component
      complex(wp), intent(inout) :: stiffness(:, :)
      class(pair_law), allocatable :: law
      complex(wp), allocatable :: rows(:, :)
      real(wp) :: rigid, spring
      integer :: c, i

      associate (springs => case%springs, contact => case%contact)
         call sector_rows(case%model, k, springs%side_1, springs%side_2, springs%sector_2, rows)
         do i = 1, springs%n_springs/case%model%cyclic%n_solved()
            if (springs%power(i) == 1) call add_sector_spring(rows(i, :), springs%coefficient(i), &
                                                              stiffness)
         end do
         rigid = hold*maxval(abs(stiffness))
         call build_law(contact, contact%side_1 /= 0 .or. contact%side_2 /= 0, law)
         do c = first_component, 3
            call sector_rows(case%model, k, contact%side_1(c, :), contact%side_2(c, :), &
                             contact%sector_2, rows)
            ! Of all sectors, those of the first.
            do i = 1, contact%n_pairs/contact%n_alike
               spring = rigid
               if (.not. law%prediction%takes(i) .and. law%prediction%order_of(i, c) == 0) then
                  spring = law%prediction%stiffness(i, c)
               end if
               call add_sector_spring(rows(i, :), spring, stiffness)
            end do
         end do
      end associate
   end subroutine hold_joint

   !> A mode of unit modal mass.
   pure subroutine describe(omega, shape_of, nodal, load, mode)
      real(wp), intent(in) :: omega
      complex(wp), intent(in) :: shape_of(:), load(:)
      type(nodal_matrices), intent(in) :: nodal
      type(mode_type), intent(out) :: mode

      mode%omega = omega
      if (allocated(nodal%damping)) mode%width = real(dot_product(shape_of, &
                                                    matmul(nodal%damping, shape_of)), wp)
      mode%amplitude = abs(matmul(nodal%observe, shape_of))*abs(dot_product(shape_of, load))/ &
                       (omega*max(mode%width, least_width*omega))
   end subroutine describe

end module fw_sector_modes
