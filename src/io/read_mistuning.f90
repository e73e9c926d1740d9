!> Group &mistuning on top of what a model says of sectors that differ, and the matrices that
!> follow.
!>
!> With W the rows of blade modes, w their frequencies, d and z the deviations of frequency and
!> damping, e and m those of stiffness and mass of the blade, s the scale:
!>
!>   dK_j = W^T diag(w^2 ((1 + s d_j)^2 - 1)) W + s e_j K_b + s dK_j,
!>   dM_j = s m_j M_b + s dM_j,   dC_j = W^T diag(2 w s z_j) W + s dC_j.
module fw_read_mistuning
   use fw_cyclic_data, only: cyclic_type
   use fw_deviation, only: damping_part, deviation_type, mass_part, of_damping, of_frequency, &
      of_mass, of_sector, of_stiffness, stiffness_part
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, from_to
   use fw_kinds, only: wp
   use fw_linalg, only: solve_symmetric_eigen
   use fw_matrix_checks, only: check_matrix
   use fw_mistuning_parts, only: mistuning_parts, sector_parts
   use fw_population_options, only: population_options
   use fw_raw_model, only: raw_model
   use fw_read_population, only: take_patterns
   use fw_reader, only: reader_type
   use fw_text, only: to_text
   implicit none (type, external)
   private

   public :: read_mistuning, negative_mass

   !> More rows are taken for a mistake.
   integer, parameter :: most_rows = 100000
   !> An eigenvalue below this part of the largest, with its sign turned, is round-off.
   real(wp), parameter :: round_off = 1.0e-10_wp

   !> What the namelist gives.
   type :: mistuning_options
      integer :: n_rows = 0
      real(wp) :: scale = 1.0_wp
      !> (n_dof, n_rows), (n_rows).
      real(wp), allocatable :: rows(:, :), row_omega(:)
      !> Sector after sector.
      real(wp), allocatable :: frequency(:), damping_ratio(:), stiffness(:), mass(:)
      real(wp), allocatable :: blade_stiffness(:, :), blade_mass(:, :)
   contains
      procedure :: bind_keys
      procedure :: asks_for_sectors
   end type mistuning_options

contains

   subroutine bind_keys(self, keys)
      class(mistuning_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      character(*), parameter :: of_file = 'of the file, else none', each = ':', &
         square = 'n_dof x n_dof', where_used = 'cyclic%mistuned = .true.'

      call keys%open('mistuning', 'how sectors differ from the tuned one')
      call keys%bind(key('n_rows', 'blade modes whose frequencies differ', from_to(0, most_rows), &
                         absent='of the file'), self%n_rows)
      call keys%set_size('n_rows', self%n_rows)
      call keys%bind(key('rows', 'one after another: W of the guide', unit='M^0.5', &
                         shape='n_dof x n_rows', repeats=.false., absent=of_file), self%rows)
      call keys%bind(key('row_omega', 'their frequencies, blade alone', above(0.0_wp), &
                         unit='rad/s', shape='n_rows', repeats=.false., absent=of_file), &
                     self%row_omega)
      call keys%bind(key('frequency', &
                         'part by which frequencies of each blade are above the tuned ones: '// &
                         'n_sectors values, or all rows of each sector', shape=each, &
                         repeats=.false., absent=of_file, only=where_used), self%frequency)
      call keys%bind(key('damping_ratio', &
                         'what the damping ratios are above the tuned ones, likewise', shape=each, &
                         repeats=.false., absent=of_file, only=where_used), self%damping_ratio)
      call keys%bind(key('stiffness', &
                         'part by which the stiffness of each blade is above the tuned one: '// &
                         'n_sectors values', shape=each, repeats=.false., absent=of_file, &
                         only=where_used), self%stiffness)
      call keys%bind(key('mass', 'the same of its mass', shape=each, repeats=.false., &
                         absent=of_file, only=where_used), self%mass)
      call keys%bind(key('blade_stiffness', 'of the blade alone, symmetric', unit='F/L', &
                         shape=square, repeats=.false., absent=of_file), self%blade_stiffness)
      call keys%bind(key('blade_mass', 'of the blade alone, symmetric', unit='M', shape=square, &
                         repeats=.false., absent=of_file), self%blade_mass)
      call keys%bind(key('scale', 'multiplies all deviations', only=where_used), self%scale)
   end subroutine bind_keys

   !> Whether something else than the defaults is given, which stand in every case that is written.
   pure logical function asks_for_sectors(self) result(asks)
      class(mistuning_options), intent(in) :: self

      asks = self%n_rows > 0 .or. abs(self%scale - 1.0_wp) > 0.0_wp .or. allocated(self%rows) .or. &
             allocated(self%row_omega) .or. allocated(self%frequency) .or. &
             allocated(self%damping_ratio) .or. allocated(self%stiffness) .or. &
             allocated(self%mass) .or. allocated(self%blade_stiffness) .or. &
             allocated(self%blade_mass)
   end function asks_for_sectors

   !> What sectors have beside each other; nothing where that is nothing.
   subroutine read_mistuning(reader, raw, moves, cyclic, population)
      type(reader_type), intent(inout) :: reader
      !> The model as it was given; takes what the group says.
      type(raw_model), intent(inout) :: raw
      !> Deviations of 0 too: derivatives are taken by them, or their scale moves.
      logical, intent(in) :: moves
      !> Takes the deviation of the matrices.
      type(cyclic_type), intent(inout) :: cyclic
      !> Takes patterns, whose rows are among those of the deviation; not allocated of a case that
      !> is no population.
      type(population_options), allocatable, intent(inout) :: population
      type(mistuning_options) :: options
      logical :: keeps

      call options%bind_keys(reader)
      if (reader%failed()) return
      if (.not. cyclic%is_cyclic .and. options%asks_for_sectors()) then
         call reader%refuse('mistuning', 'scale', 'and the other keys of the group need '// &
                            'sectors: give &cyclic n_sectors, or leave the group out')
         return
      end if
      call merge_parts(reader, options, cyclic%n_sectors, raw%mistuning)
      if (reader%failed()) return
      if (allocated(population)) call take_patterns(reader, options%scale, cyclic%n_sectors, &
                                                    cyclic%is_mistuned, raw%mistuning, population)
      if (reader%failed()) return
      if (.not. cyclic%is_mistuned) then
         if (abs(options%scale) > 0.0_wp .and. raw%mistuning%deviates()) call reader%refuse( &
            'cyclic', 'mistuned', '= .false., but the sectors differ (&mistuning, or '// &
            '/mistuning of the model): must be .true., or mistuning%scale = 0 for the tuned disk')
         return
      end if
      if (.not. raw%mistuning%deviates()) return
      call check_parts(reader, options%scale, raw, cyclic%n_sectors)
      keeps = moves .or. allocated(population)
      if (reader%failed() .or. (abs(options%scale) <= 0.0_wp .and. .not. keeps)) return
      call form_deviation(options%scale, raw, keeps, cyclic)
      call check_masses(reader, raw, cyclic)
   end subroutine read_mistuning

   !> What the namelist gives stands in place of what the model says.
   subroutine merge_parts(reader, options, n_sectors, parts)
      type(reader_type), intent(inout) :: reader
      !> What the group says.
      type(mistuning_options), intent(in) :: options
      !> N.
      integer, intent(in) :: n_sectors
      !> Those of the model, with those of the group on return.
      type(mistuning_parts), intent(inout) :: parts
      integer :: r

      if (allocated(options%rows)) parts%rows = transpose(options%rows)
      if (allocated(options%row_omega)) parts%row_omega = options%row_omega
      if (allocated(options%blade_stiffness)) parts%blade_stiffness = options%blade_stiffness
      if (allocated(options%blade_mass)) parts%blade_mass = options%blade_mass
      r = 0
      if (allocated(parts%rows)) r = size(parts%rows, 1)
      if (reader%given('mistuning', 'n_rows') .and. options%n_rows /= r) then
         call reader%refuse('mistuning', 'n_rows', '= '//to_text(options%n_rows)//', but there '// &
                            'are '//to_text(r)//' rows: give rows and row_omega of as many')
         return
      end if
      call take('frequency', options%frequency, parts%frequency)
      call take('damping_ratio', options%damping_ratio, parts%damping_ratio)
      call take_one('stiffness', options%stiffness, parts%stiffness)
      call take_one('mass', options%mass, parts%mass)

   contains

      subroutine take(name, given, values)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(in) :: given(:)
         real(wp), allocatable, intent(inout) :: values(:, :)

         if (.not. allocated(given)) return
         if (r == 0) then
            call reader%refuse('mistuning', name, 'is given without rows: give rows and '// &
                               'row_omega, or a model that has them')
         else if (size(given) == n_sectors) then
            values = spread(given, 1, r)
         else if (size(given) == n_sectors*r) then
            values = reshape(given, [r, n_sectors])
         else
            call reader%refuse('mistuning', name, 'has '//to_text(size(given))//' values: must '// &
                               'be '//to_text(n_sectors)//', one for each sector, or '// &
                               to_text(n_sectors*r)//', those of all rows of each')
         end if
      end subroutine take

      subroutine take_one(name, given, values)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(in) :: given(:)
         real(wp), allocatable, intent(inout) :: values(:)

         if (.not. allocated(given)) return
         if (size(given) == n_sectors) then
            values = given
         else
            call reader%refuse('mistuning', name, 'has '//to_text(size(given))//' values: must '// &
                               'be '//to_text(n_sectors)//', one for each sector')
         end if
      end subroutine take_one

   end subroutine merge_parts

   !> What the parts must be to each other.
   subroutine check_parts(reader, scale, raw, n_sectors)
      type(reader_type), intent(inout) :: reader
      !> Of all deviations.
      real(wp), intent(in) :: scale
      !> With the parts merged.
      type(raw_model), intent(inout) :: raw
      !> N.
      integer, intent(in) :: n_sectors
      integer :: at(2), j, n, r

      n = raw%order()
      associate (parts => raw%mistuning)
         r = 0
         if (allocated(parts%rows)) r = size(parts%rows, 1)
         if (allocated(parts%frequency) .or. allocated(parts%damping_ratio)) then
            if (r == 0) then
               call reader%refuse('mistuning', 'rows', 'are missing: frequency and '// &
                                  'damping_ratio are of rows with their row_omega')
               return
            else if (.not. allocated(parts%row_omega)) then
               call reader%refuse('mistuning', 'row_omega', 'is missing: must be the frequency '// &
                                  'of each row, '//to_text(r)//' values above 0')
               return
            end if
            if (size(parts%row_omega) /= r .or. any(.not. parts%row_omega > 0.0_wp)) then
               call reader%refuse('mistuning', 'row_omega', 'has '// &
                                  to_text(size(parts%row_omega))//' values, the lowest '// &
                                  to_text(minval(parts%row_omega))//': must be '//to_text(r)// &
                                  ', as many as rows, all above 0')
               return
            end if
         end if
         if (allocated(parts%frequency)) then
            call check_shape('frequency', parts%frequency)
            if (reader%failed()) return
            if (any(1.0_wp + scale*parts%frequency <= 0.0_wp)) then
               at = minloc(scale*parts%frequency)
               call reader%refuse('mistuning', 'frequency', '= '// &
                                  to_text(parts%frequency(at(1), at(2)))//' of sector '// &
                                  to_text(at(2) - 1)//', times scale = '//to_text(scale)// &
                                  ': must stay above -1')
               return
            end if
         end if
         if (allocated(parts%damping_ratio)) call check_shape('damping_ratio', parts%damping_ratio)
         call check_blade('stiffness', parts%stiffness, parts%blade_stiffness, .false.)
         call check_blade('mass', parts%mass, parts%blade_mass, .true.)
         if (.not. allocated(parts%sector) .or. reader%failed()) return
         if (allocated(raw%cyclic%nodal)) then
            call reader%refuse('cyclic', 'mistuned', '= .true.: /mistuning/sector does not go '// &
                               'with matrices of nodal diameters; give rows, or matrices of '// &
                               'the blade')
            return
         end if
         do j = 1, size(parts%sector)
            call check_sector(reader, parts%sector(j), j - 1, n)
         end do
      end associate

   contains

      subroutine check_shape(name, values)
         character(*), intent(in) :: name
         real(wp), intent(in) :: values(:, :)

         if (size(values, 1) == r .and. size(values, 2) == n_sectors) return
         call reader%refuse('mistuning', name, 'has '//to_text(size(values, 2))//' x '// &
                            to_text(size(values, 1))//' values: must be '//to_text(n_sectors)// &
                            ' x '//to_text(r)//', sectors by rows')
      end subroutine check_shape

      subroutine check_blade(name, values, matrix, is_mass)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(in) :: values(:)
         real(wp), allocatable, intent(inout) :: matrix(:, :)
         logical, intent(in) :: is_mass
         character(:), allocatable :: message

         if (.not. allocated(values) .or. reader%failed()) return
         if (size(values) /= n_sectors) then
            call reader%refuse('mistuning', name, 'has '//to_text(size(values))//' values: '// &
                               'must be '//to_text(n_sectors)//', one for each sector')
         else if (.not. allocated(matrix)) then
            call reader%refuse('mistuning', name, 'is given without blade_'//name//': give '// &
                               'that matrix of the blade alone')
         else
            call check_matrix(matrix, n, is_mass, message)
            if (allocated(message)) call reader%refuse('mistuning', 'blade_'//name, message)
         end if
      end subroutine check_blade

   end subroutine check_parts

   subroutine check_sector(reader, own, j, n)
      type(reader_type), intent(inout) :: reader
      !> Of one sector.
      type(sector_parts), intent(inout) :: own
      !> Which, from 0, and the dofs of a sector.
      integer, intent(in) :: j, n
      character(:), allocatable :: message

      if (allocated(own%kind)) then
         if (own%kind /= 'full' .and. own%kind /= 'deviation') then
            call reader%refuse_model('mistuning/sector/'//to_text(j)//' of kind "'//own%kind// &
                                     '": must be "deviation" or "full"')
            return
         end if
      end if
      call check_one('stiffness', own%stiffness)
      call check_one('mass', own%mass)
      call check_one('damping', own%damping)

   contains

      subroutine check_one(name, matrix)
         character(*), intent(in) :: name
         real(wp), allocatable, intent(inout) :: matrix(:, :)

         if (.not. allocated(matrix)) return
         call check_matrix(matrix, n, .false., message)
         if (allocated(message)) call reader%refuse_model( &
            'a mistuning/sector/'//to_text(j)//'/'//name//' that '//message)
      end subroutine check_one

   end subroutine check_sector

   !> Rows that all sectors share, then the matrices of each on them.
   subroutine form_deviation(scale, raw, keeps, cyclic)
      !> Of all deviations.
      real(wp), intent(in) :: scale
      !> With parts that fit each other.
      type(raw_model), intent(inout) :: raw
      !> Whether it is kept where it is 0.
      logical, intent(in) :: keeps
      !> Its deviation is formed here.
      type(cyclic_type), intent(inout) :: cyclic
      type(deviation_type) :: deviation
      integer :: j

      call deviation%start(raw%order())
      associate (parts => raw%mistuning)
         if (allocated(parts%frequency) .or. allocated(parts%damping_ratio)) then
            call deviation%add_rows(parts%rows)
         end if
         if (allocated(parts%stiffness)) call deviation%add_range(parts%blade_stiffness, 0.0_wp)
         if (allocated(parts%mass)) call deviation%add_range(parts%blade_mass, 0.0_wp)
         if (allocated(parts%sector)) then
            do j = 1, size(parts%sector)
               call take_off(raw, parts%sector(j))
               call add_own(parts%sector(j)%stiffness, size_of(raw%stiffness))
               call add_own(parts%sector(j)%mass, size_of(raw%mass))
               call add_own(parts%sector(j)%damping, size_of(raw%damping))
            end do
         end if
         call deviation%settle(cyclic%n_sectors)
         call add_values(of_frequency, stiffness_part, parts%frequency)
         call add_values(of_damping, damping_part, parts%damping_ratio)
         call add_blades(of_stiffness, stiffness_part, parts%stiffness, parts%blade_stiffness)
         call add_blades(of_mass, mass_part, parts%mass, parts%blade_mass)
         if (allocated(parts%sector)) then
            do j = 1, size(parts%sector)
               call add_sector(stiffness_part, parts%sector(j)%stiffness)
               call add_sector(mass_part, parts%sector(j)%mass)
               call add_sector(damping_part, parts%sector(j)%damping)
            end do
         end if
      end associate
      call deviation%set_scale(scale)
      if (size(deviation%rows, 1) == 0) return
      if (all(abs(deviation%part) <= 0.0_wp) .and. .not. keeps) return
      cyclic%deviation = deviation

   contains

      subroutine add_own(matrix, tuned)
         real(wp), allocatable, intent(in) :: matrix(:, :)
         real(wp), intent(in) :: tuned

         if (allocated(matrix)) call deviation%add_range(matrix, tuned)
      end subroutine add_own

      !> On the rows of blade modes.
      subroutine add_values(of, part, values)
         integer, intent(in) :: of, part
         !> (n_rows, n_sectors)
         real(wp), allocatable, intent(in) :: values(:, :)
         integer :: a, sector

         if (.not. allocated(values)) return
         associate (parts => raw%mistuning)
            do sector = 1, size(values, 2)
               do a = 1, size(values, 1)
                  call deviation%add(of, part, sector - 1, values(a, sector), &
                                     merge(parts%row_omega(a)**2, 2.0_wp*parts%row_omega(a), &
                                           part == stiffness_part), row=parts%rows(a, :))
               end do
            end do
         end associate
      end subroutine add_values

      !> With a matrix that all blades share.
      subroutine add_blades(of, part, values, matrix)
         integer, intent(in) :: of, part
         !> (n_sectors)
         real(wp), allocatable, intent(in) :: values(:), matrix(:, :)
         real(wp), allocatable :: on_rows(:, :)
         integer :: sector

         if (.not. allocated(values)) return
         call deviation%bring_to_rows(matrix, on_rows)
         do sector = 1, size(values)
            call deviation%add(of, part, sector - 1, values(sector), 1.0_wp, matrix=on_rows)
         end do
      end subroutine add_blades

      !> The matrix of sector j.
      subroutine add_sector(part, matrix)
         integer, intent(in) :: part
         real(wp), allocatable, intent(in) :: matrix(:, :)
         real(wp), allocatable :: on_rows(:, :)

         if (.not. allocated(matrix)) return
         call deviation%bring_to_rows(matrix, on_rows)
         call deviation%add(of_sector, part, j - 1, 1.0_wp, 1.0_wp, matrix=on_rows)
      end subroutine add_sector

   end subroutine form_deviation

   !> Largest column.
   pure real(wp) function size_of(matrix)
      !> Symmetric.
      real(wp), allocatable, intent(in) :: matrix(:, :)

      size_of = 0.0_wp
      if (allocated(matrix)) size_of = sqrt(maxval(sum(matrix**2, dim=1)))
   end function size_of

   !> Whole matrices of a sector become what they have beside the tuned ones.
   subroutine take_off(raw, own)
      !> Its mass is that of the tuned sector.
      type(raw_model), intent(in) :: raw
      !> Of one sector.
      type(sector_parts), intent(inout) :: own

      if (.not. allocated(own%kind)) return
      if (own%kind /= 'full') return
      if (allocated(own%stiffness)) own%stiffness = own%stiffness - raw%stiffness
      if (allocated(own%mass)) own%mass = own%mass - raw%mass
      if (allocated(own%damping) .and. allocated(raw%damping)) own%damping = own%damping - &
                                                                             raw%damping
      own%kind = 'deviation'
   end subroutine take_off

   !> Masses that some sector makes negative.
   subroutine check_masses(reader, raw, cyclic)
      type(reader_type), intent(inout) :: reader
      !> Its mass is that of the tuned sector.
      type(raw_model), intent(in) :: raw
      !> With the deviation.
      type(cyclic_type), intent(in) :: cyclic
      integer :: j

      if (.not. allocated(cyclic%deviation) .or. .not. allocated(raw%mass)) return
      j = negative_mass(raw%mass, cyclic%deviation)
      if (j >= 0) call reader%refuse('mistuning', 'mass', 'of sector '//to_text(j)//' makes '// &
                                     'its mass matrix one that is not positive: must leave '// &
                                     'mass to every motion')
   end subroutine check_masses

   !> The first sector, from 0, whose mass is negative in some motion although that of the tuned one
   !> is not; -1 where there is none.
   integer function negative_mass(mass, deviation) result(sector)
      !> Of the tuned sector (n, n).
      real(wp), intent(in) :: mass(:, :)
      type(deviation_type), intent(in) :: deviation
      real(wp) :: limit
      integer :: j

      sector = -1
      associate (d => deviation)
         if (all(abs(d%part(:, :, :, mass_part)) <= 0.0_wp)) return
         limit = -round_off*sqrt(maxval(sum(mass**2, dim=1)))
         if (lowest(mass) < limit) return
         do j = 1, size(d%part, 3)
            if (lowest(mass + matmul(transpose(d%rows), matmul(d%part(:, :, j, mass_part), &
                                                               d%rows))) >= limit) cycle
            sector = j - 1
            return
         end do
      end associate
   end function negative_mass

   !> Lowest eigenvalue.
   real(wp) function lowest(matrix)
      !> Symmetric (n, n).
      real(wp), intent(in) :: matrix(:, :)
      real(wp), allocatable :: unit(:, :), values(:), vectors(:, :)
      integer :: i
      logical :: done

      allocate (unit(size(matrix, 1), size(matrix, 1)), source=0.0_wp)
      do i = 1, size(unit, 1)
         unit(i, i) = 1.0_wp
      end do
      call solve_symmetric_eigen(matrix, unit, values, vectors, done)
      lowest = 0.0_wp
      if (done) lowest = minval(values)
   end function lowest

end module fw_read_mistuning
