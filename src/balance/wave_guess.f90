!> The first guess where equal sectors are told apart: each harmonic in its nodal diameters, of
!> which contact that is the same in all sectors does not couple any two. What pairs add while they
!> stick is replaced by its mean over the sectors; their gaps and the loads are those of each.
submodule(fw_guess) fw_wave_guess
   use fw_hermitian, only: cholesky
   implicit none (type, external)

   complex(wp), parameter :: zero = (0.0_wp, 0.0_wp)

contains

   module procedure waves_are_held
      complex(wp) :: slope(size(system%problem%joint%cyclic%coordinate))
      logical :: fixed(system%problem%structure%n_slots)
      integer :: i, k, row

      slope = (0.0_wp, 0.0_wp)
      fixed = .false.
      do k = 1, system%problem%forces%n_laws
         associate (entry => system%problem%forces%entry(k))
            if (k == system%problem%forces%pairs) then
               if (.not. closed) cycle
               do i = 1, system%problem%n_pairs
                  row = entry%row(3, i)
                  if (row == 0) cycle
                  if (entry%law%prediction%takes(i)) then
                     fixed(system%problem%structure%slot( &
                           system%problem%incidence%coordinate_of(row))) = .true.
                  else
                     call add_slope(cmplx(entry%law%prediction%stiffness(i, 3), kind=wp))
                  end if
               end do
            else if (.not. closed) then
               call add_elements(k)
            end if
         end associate
      end do
      waves_are_held = holds_waves(system, slope, fixed)

   contains

      !> Each row for itself.
      subroutine add_elements(k)
         integer, intent(in) :: k
         real(wp) :: mean(system%problem%forces%entry(k)%law%n_components, &
                          system%problem%forces%entry(k)%law%n_components)
         integer :: c, i

         associate (entry => system%problem%forces%entry(k))
            do i = 1, entry%law%n_elements
               call find_mean_slopes(system, k, i, mean)
               do c = 1, size(mean, 1)
                  row = entry%row(c, i)
                  if (row == 0) cycle
                  call add_slope(cmplx(mean(c, c)*entry%law%prediction%stiffness(i, c), kind=wp))
               end do
            end do
         end associate
      end subroutine add_elements

      subroutine add_slope(added)
         complex(wp), intent(in) :: added

         associate (r => system%problem%joint%row_in_sector(row))
            slope(r) = slope(r) + added/system%problem%structure%n_alike
         end associate
      end subroutine add_slope

   end procedure waves_are_held

   !> With the mean of what their pairs add; a coordinate is held where
   !> most of its sectors hold it.
   module procedure solve_sectors
      complex(wp), allocatable :: q(:, :), force(:), slope(:)
      real(wp), allocatable :: product(:)
      logical :: held(system%problem%structure%n_slots)
      integer :: h, m

      m = system%problem%structure%n_coordinates
      allocate (q(m, system%problem%fourier%n_retained), source=(0.0_wp, 0.0_wp))
      tension = 0.0_wp
      do h = 1, system%problem%fourier%n_retained
         if (system%is_interrupted()) exit
         force = system%structure_state%load(:, h)
         if (system%problem%fourier%harmonic(h) > 0) force = system%load_share*force
         call close_sectors(system, closed, h, rest, slope, force, held, q(:, h))
         call wave_solution(system, h, slope, force, held, q(:, h))
      end do
      call to_real(system%problem%fourier, m, q, x)
      if (.not. system%problem%fourier%has_constant()) return
      allocate (product(m))
      call static_product(system, q(:, 1), product)
      call find_tension(system, rest, system%load(:, 1) - product, q(:, 1), tension)
   end procedure solve_sectors

   !> Z_0 q.
   subroutine static_product(system, q, product)
      type(balance_state), intent(in) :: system
      complex(wp), intent(in) :: q(:)
      real(wp), intent(out) :: product(:)
      complex(wp), allocatable :: sectors(:, :), waves(:, :), matrix(:, :)
      complex(wp), allocatable :: rows(:, :), own(:, :, :)
      integer :: j, r

      r = system%problem%structure%n_own()
      associate (structure => system%problem%structure)
         allocate (sectors(structure%n_slots, structure%n_alike))
         allocate (waves(structure%n_slots, structure%n_alike))
         allocate (matrix(structure%n_slots, structure%n_slots))
         do j = 1, structure%n_alike
            sectors(:, j) = q(structure%coordinate(:, j))
         end do
         allocate (rows(r, structure%n_alike), own(r, r, structure%n_alike))
         call structure%read_own(sectors, rows)
         call structure%own_block(system%structure_state, 1, own)
         call structure%find_waves(sectors, waves)
         do j = 1, structure%n_alike
            call structure%wave_block(system%structure_state, 1, j - 1, matrix)
            waves(:, j) = matmul(matrix, waves(:, j))
         end do
         call structure%add_waves(waves, sectors)
         do j = 1, structure%n_alike
            rows(:, j) = matmul(own(:, :, j), rows(:, j))
         end do
         call structure%add_own(rows, sectors)
         do j = 1, structure%n_alike
            product(structure%coordinate(:, j)) = real(sectors(:, j), wp)
         end do
      end associate
   end subroutine static_product

   !> What closed pairs add to the rows of a sector, and which coordinates of it they hold.
   subroutine close_sectors(system, closed, h, rest, slope, force, held, q)
      type(balance_state), intent(in) :: system
      logical, intent(in) :: closed(:)
      integer, intent(in) :: h
      type(rest_type), intent(in) :: rest
      !> Mean over the sectors (rows of a sector).
      complex(wp), allocatable, intent(out) :: slope(:)
      complex(wp), intent(inout) :: force(:), q(:)
      logical, intent(out) :: held(:)
      integer :: i, c, j, row, n_held(size(held))
      complex(wp) :: gap, own

      allocate (slope(size(system%problem%joint%cyclic%coordinate)), source=(0.0_wp, 0.0_wp))
      n_held = 0
      associate (law => system%problem%forces%entry(system%problem%forces%pairs)%law, &
                 n => system%problem%structure%n_alike)
         do i = 1, size(closed)
            if (.not. closed(i)) cycle
            do c = 1, 3
               row = system%problem%joint%row(c, i)
               if (row == 0 .or. .not. law%slope_at_rest(i, c) > 0.0_wp) cycle
               gap = gap_of(system, h, i, c, rest)
               if (law%prediction%takes(i)) then
                  j = system%problem%incidence%coordinate_of(row)
                  n_held(system%problem%structure%slot(j)) = &
                     n_held(system%problem%structure%slot(j)) + 1
                  q(j) = -gap
               else
                  own = elastic_slope(system, law, i, c, system%problem%fourier%harmonic(h), &
                                      rest)
                  call system%problem%incidence%scatter_harmonic(row, h, -own*gap, force)
                  j = system%problem%joint%row_in_sector(row)
                  slope(j) = slope(j) + own/n
               end if
            end do
         end do
         held = 2*n_held > n
      end associate
   end subroutine close_sectors


   !> Amplitudes of one harmonic, of given slopes of rows and held coordinates.
   subroutine wave_solution(system, h, slope, force, held, q)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: h
      !> What pairs that stick add to the rows of a sector, mean over the sectors (rows of a sector)
      !> [force/length].
      complex(wp), intent(in) :: slope(:)
      !> (n_coordinates).
      complex(wp), intent(in) :: force(:)
      !> Which coordinates of a sector are held (n_slots); their values in q on entry, all values on
      !> leaving.
      logical, intent(in) :: held(:)
      complex(wp), intent(inout) :: q(:)
      complex(wp), allocatable :: matrix(:, :), sectors(:, :), loads(:, :), values(:, :)
      integer :: j, k, m, n, r
      real(wp) :: largest
      !> A wave without a load but round-off has none.
      real(wp), parameter :: round_off = 1.0e-13_wp

      associate (structure => system%problem%structure)
         m = structure%n_slots
         n = structure%n_alike
         allocate (matrix(m, m), sectors(m, n), loads(m, n), values(m, n))
         do j = 1, n
            sectors(:, j) = force(structure%coordinate(:, j))
         end do
         call structure%find_waves(sectors, loads)
         do j = 1, n
            sectors(:, j) = merge(q(structure%coordinate(:, j)), zero, held)
         end do
         call structure%find_waves(sectors, values)
         largest = max(maxval(abs(loads)), tiny(1.0_wp))
         do k = 0, n - 1
            if (all(abs(loads(:, k + 1)) <= round_off*largest) .and. &
                all(abs(values(:, k + 1)) <= 0.0_wp)) then
               values(:, k + 1) = zero
               cycle
            end if
            call structure%wave_block(system%structure_state, h, k, matrix)
            do r = 1, size(slope)
               if (abs(slope(r)) > 0.0_wp) call add_wave_row(system, r, k, slope(r), matrix)
            end do
            call solve_free(matrix, loads(:, k + 1), held, values(:, k + 1))
         end do
         call structure%add_waves(values, sectors)
         do j = 1, n
            q(structure%coordinate(:, j)) = sectors(:, j)
         end do
      end associate
   end subroutine wave_solution

   !> matrix + B_k^H slope B_k of a row of a sector.
   subroutine add_wave_row(system, row, k, slope, matrix)
      type(balance_state), intent(in) :: system
      integer, intent(in) :: row, k
      complex(wp), intent(in) :: slope
      complex(wp), intent(inout) :: matrix(:, :)
      complex(wp), allocatable :: weight(:)
      integer :: j, n

      weight = system%problem%joint%wave_weights(system%problem%structure%n_alike, k, row)
      n = size(weight)
      do j = 1, n
         matrix(:n, j) = matrix(:n, j) + conjg(weight)*slope*weight(j)
      end do
   end subroutine add_wave_row

   !> Whether the structure holds static loads of every nodal diameter, with slopes of rows and held
   !> coordinates as above.
   logical function holds_waves(system, slope, held) result(holds)
      type(balance_state), intent(in) :: system
      complex(wp), intent(in) :: slope(:)
      logical, intent(in) :: held(:)
      complex(wp), allocatable :: matrix(:, :), part(:, :)
      integer, allocatable :: free(:)
      integer :: j, k, m, r

      m = system%problem%structure%n_slots
      free = pack([(j, j=1, m)], .not. held)
      allocate (matrix(m, m))
      holds = .true.
      do k = 0, system%problem%structure%n_alike/2
         call system%problem%structure%wave_block(system%structure_state, 1, k, matrix)
         do r = 1, size(slope)
            if (abs(slope(r)) > 0.0_wp) call add_wave_row(system, r, k, slope(r), matrix)
         end do
         part = matrix(free, free)
         holds = holds .and. cholesky(part)
      end do
   end function holds_waves

end submodule fw_wave_guess
