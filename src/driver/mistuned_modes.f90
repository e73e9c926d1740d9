!> Natural frequencies of all sectors of a case whose sectors differ, with its contact open, and
!> closed: every pair as its springs, which may differ from sector to sector, or held.
module fw_mistuned_modes
   use fw_body, only: body_type
   use fw_closed_joint, only: closed_joint
   use fw_closed_pairs, only: add_springs, is_held, takes_part
   use fw_cyclic_data, only: nodal_matrices
   use fw_deviation, only: mass_part, stiffness_part
   use fw_error, only: error_type, fatal_error, status_input
   use fw_hermitian, only: congruence, product_of
   use fw_kinds, only: wp
   use fw_laws, only: build_law
   use fw_pair_law, only: pair_law
   use fw_ring_modes, only: ring_pencil
   use fw_sector, only: add_sector_spring, close_sector, sector_at, sector_rows
   use fw_sector_relative, only: held_basis, new_sector_relative, sector_relative
   implicit none (type, external)
   private

   public :: mistuned_modes, find_mistuned_modes

   type :: mistuned_modes
      !> In ascending order [rad/s], NaN where there are fewer (n_modes).
      real(wp), allocatable :: open(:), closed(:)
      !> Shares of nodal diameters 0 .. N/2 (N/2 + 1, n_modes).
      real(wp), allocatable :: open_content(:, :), closed_content(:, :)
   end type mistuned_modes

   !> Rows of a sector: of pairs, with what holds them in each sector (n, n_sectors).
   type :: closed_rows
      integer, allocatable :: side_1(:), side_2(:), sector_2(:)
      real(wp), allocatable :: stiffness(:, :)
      logical, allocatable :: is_held(:)
   end type closed_rows

contains

   subroutine find_mistuned_modes(case, n_modes, modes, error, dense_up_to)
      class(body_type), intent(in) :: case
      !> Frequencies of all sectors together.
      integer, intent(in) :: n_modes
      type(mistuned_modes), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      !> Unknowns up to which all modes are found at once, in place of the usual ones.
      integer, intent(in), optional :: dense_up_to
      type(closed_rows) :: rows
      type(ring_pencil) :: pencil

      associate (n => case%model%cyclic%n_sectors)
         allocate (modes%open(n_modes), modes%closed(n_modes))
         allocate (modes%open_content(n/2 + 1, n_modes), modes%closed_content(n/2 + 1, n_modes))
      end associate
      if (case%model%cyclic%splits_waves()) then
         call fatal_error(error, '&cyclic mistuned = .true.: natural frequencies of all '// &
                          'sectors are those without Coriolis forces and forces of the air: '// &
                          'leave rotation_speed and /aero out, or mistuned', status_input)
         return
      end if
      allocate (rows%side_1(0), rows%side_2(0), rows%sector_2(0), rows%is_held(0))
      allocate (rows%stiffness(0, case%model%cyclic%n_sectors))
      call find(modes%open, modes%open_content)
      if (allocated(error)) return
      if (case%contact%n_pairs == 0) then
         modes%closed = modes%open
         modes%closed_content = modes%open_content
         return
      end if
      call list_pairs(case, rows)
      call find(modes%closed, modes%closed_content)

   contains

      subroutine find(frequency, content)
         real(wp), intent(out) :: frequency(:), content(:, :)

         call put_together(case, rows, pencil, error)
         if (allocated(error)) return
         if (present(dense_up_to)) pencil%dense_up_to = dense_up_to
         call pencil%solve(case%model%cyclic, frequency, content, error)
      end subroutine find

   end subroutine find_mistuned_modes

   !> Rows of the pairs of a sector, and their stiffness in all of them.
   subroutine list_pairs(case, rows)
      class(body_type), intent(in) :: case
      !> Of one sector, held or with their stiffness in each.
      type(closed_rows), intent(out) :: rows
      class(pair_law), allocatable :: law
      integer :: c, i, j, n, n_pairs
      real(wp), allocatable :: longer(:, :)
      real(wp) :: own(case%model%cyclic%n_sectors)

      associate (contact => case%contact)
         n = case%model%cyclic%n_sectors
         n_pairs = contact%n_pairs/n
         call build_law(contact, contact%side_1 /= 0 .or. contact%side_2 /= 0, law)
         allocate (rows%side_1(0), rows%side_2(0), rows%sector_2(0), rows%is_held(0))
         allocate (rows%stiffness(0, n))
         do c = 1, 3
            do i = 1, n_pairs
               if (.not. takes_part(contact, i, c)) cycle
               rows%side_1 = [rows%side_1, contact%side_1(c, i)]
               rows%side_2 = [rows%side_2, contact%side_2(c, i)]
               rows%sector_2 = [rows%sector_2, contact%sector_2(i)]
               rows%is_held = [rows%is_held, is_held(contact, law, i, c)]
               own = [(law%prediction%stiffness(i + (j - 1)*n_pairs, c), j=1, n)]
               allocate (longer(size(rows%side_1), n))
               longer(:size(longer, 1) - 1, :) = rows%stiffness
               longer(size(longer, 1), :) = own
               call move_alloc(longer, rows%stiffness)
            end do
         end do
      end associate
   end subroutine list_pairs

   !> Waves of all nodal diameters, and what sectors have beside each other.
   subroutine put_together(case, rows, pencil, error)
      class(body_type), intent(in) :: case
      !> Of the pairs that are closed.
      type(closed_rows), intent(in) :: rows
      !> Ready to be solved.
      type(ring_pencil), intent(out) :: pencil
      type(error_type), allocatable, intent(out) :: error
      type(closed_joint) :: springs
      type(nodal_matrices) :: nodal
      complex(wp), allocatable :: basis(:, :), pairs(:, :)
      real(wp), allocatable :: others(:, :)
      integer, allocatable :: differing(:)
      type(sector_relative) :: relative
      real(wp) :: mean(size(rows%side_1))
      integer :: a, j, k, n, n_own, r

      associate (cyclic => case%model%cyclic)
         n = cyclic%n_sectors
         n_own = 0
         if (allocated(cyclic%deviation)) n_own = size(cyclic%deviation%rows, 1)
         allocate (others(n_own, case%model%n_dof))
         if (n_own > 0) others = cyclic%deviation%rows
         mean = sum(rows%stiffness, dim=2)/n
         differing = pack([(a, a=1, size(mean))], .not. rows%is_held .and. &
                          maxval(rows%stiffness, dim=2) - minval(rows%stiffness, dim=2) > 0.0_wp)
         r = n_own + size(differing)
         pencil%n_sectors = n
         allocate (pencil%wave(n))
         allocate (pencil%stiffness(r, r, n), pencil%mass(r, r, n), source=0.0_wp)
         if (n_own > 0) then
            pencil%stiffness(:n_own, :n_own, :) = cyclic%deviation%part(:, :, :, stiffness_part)
            pencil%mass(:n_own, :n_own, :) = cyclic%deviation%part(:, :, :, mass_part)
         end if
         do a = 1, size(differing)
            pencil%stiffness(n_own + a, n_own + a, :) = rows%stiffness(differing(a), :) - &
                                                        mean(differing(a))
         end do
         call add_springs(case%springs, cyclic%n_solved(), springs)
         do k = 0, n/2
            call sector_at(case%model, k, nodal, error)
            if (allocated(error)) return
            associate (wave => pencil%wave(k + 1))
               wave%stiffness = nodal%stiffness
               wave%mass = nodal%mass
               call close_sector(case%model, springs, k, wave%stiffness, basis)
               call sector_rows(case%model, k, rows%side_1, rows%side_2, rows%sector_2, pairs, &
                                others)
               do a = 1, size(mean)
                  if (.not. rows%is_held(a)) call add_sector_spring(pairs(a, :), mean(a), &
                                                                    wave%stiffness)
               end do
               allocate (wave%rows(r, size(wave%mass, 1)), source=(0.0_wp, 0.0_wp))
               wave%rows(:n_own, :size(pairs, 2)) = pairs(size(mean) + 1:, :)
               wave%rows(n_own + 1:, :size(pairs, 2)) = pairs(differing, :)
               if (any(rows%is_held)) then
                  call new_sector_relative(pairs(pack([(a, a=1, size(mean))], rows%is_held), :), &
                                           relative)
                  call held_basis(relative, size(nodal%mass, 1), basis)
                  wave%stiffness = congruence(basis, wave%stiffness, basis)
                  wave%mass = congruence(basis, wave%mass, basis)
                  wave%rows = product_of(wave%rows, basis)
               end if
            end associate
            j = modulo(n - k, n)
            if (j <= n/2) cycle
            pencil%wave(j + 1)%stiffness = conjg(pencil%wave(k + 1)%stiffness)
            pencil%wave(j + 1)%mass = conjg(pencil%wave(k + 1)%mass)
            pencil%wave(j + 1)%rows = conjg(pencil%wave(k + 1)%rows)
         end do
      end associate
   end subroutine put_together

end module fw_mistuned_modes
