!> What makes a model of the calling program one of equal sectors: interfaces, complex matrices of
!> nodal diameters and forces of the air, by the names that they have in a model file.
!>
!> Complex numbers are pairs of reals, real and imaginary part, and matrices come row after row, as
!> the bytes of a file stand.
module fw_memory_sectors
   use fw_cyclic_data, only: influence_type
   use fw_cyclic_parts, only: add_influence, check_physical, check_rows, cyclic_parts, &
      finish_influence, nodal_parts
   use fw_kinds, only: wp
   use fw_text, only: to_text
   use fw_values, only: read_integer
   implicit none (type, external)
   private

   public :: is_sector_part, put_sector_integers, put_sector_reals, check_memory_sectors

   character(*), parameter :: nodal = 'nodal_diameter/', air_by_sector = 'aero/sector/', &
      air_by_diameter = 'aero/nodal_diameter/'

contains

   !> Whether a name is of these parts.
   pure logical function is_sector_part(name)
      character(*), intent(in) :: name

      is_sector_part = index(name, 'cyclic/') == 1 .or. index(name, nodal) == 1 .or. &
                       index(name, 'aero/') == 1 .or. name == 'contact/sector_2'
   end function is_sector_part

   !> Sectors, interfaces, and the sectors of side 2 of the pairs.
   subroutine put_sector_integers(name, values, n_pairs, parts, message)
      character(*), intent(in) :: name
      integer, intent(in) :: values(:)
      integer, intent(in) :: n_pairs
      type(cyclic_parts), intent(inout) :: parts
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message

      select case (name)
      case ('cyclic/n_sectors')
         if (size(values) /= 1) then
            call miscount(size(values), 1, message)
         else if (values(1) < 1) then
            message = 'is '//to_text(values(1))//': must be at least 1'
         else if (allocated(parts%nodal) .or. allocated(parts%air)) then
            message = 'comes after nodal diameters or forces of the air: put it before them'
         else
            parts%n_sectors = values(1)
         end if
      case ('cyclic/left')
         parts%left = values
      case ('cyclic/right')
         parts%right = values
      case default ! 'contact/sector_2'
         if (size(values) /= n_pairs) then
            call miscount(size(values), n_pairs, message)
         else
            parts%sector_2 = values
         end if
      end select
   end subroutine put_sector_integers

   !> Matrices, loads and rows of nodal diameters, and forces of the air.
   subroutine put_sector_reals(name, values, n_dof, parts, message)
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n_dof
      type(cyclic_parts), intent(inout) :: parts
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      integer :: k, slash

      if (index(name, 'aero/') == 1) then
         call put_air(name, values, n_dof, parts, message)
         return
      end if
      slash = index(name(len(nodal) + 1:), '/')
      call take_number(name(len(nodal) + 1:len(nodal) + slash - 1), 0, parts%n_sectors/2, k, &
                       message)
      if (allocated(message)) return
      if (.not. allocated(parts%nodal)) allocate (parts%nodal(parts%n_sectors/2 + 1))
      parts%n_physical = n_dof
      call put_diameter(name(len(nodal) + slash + 1:), values, n_dof, parts%nodal(k + 1), message)
   end subroutine put_sector_reals

   !> A part of a nodal diameter; its mass comes first and gives the order.
   subroutine put_diameter(key, values, n_dof, parts, message)
      character(*), intent(in) :: key
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n_dof
      type(nodal_parts), intent(inout) :: parts
      character(:), allocatable, intent(out) :: message
      integer :: n

      if (key == 'mass') then
         n = nint(sqrt(0.5_wp*real(size(values), wp)))
         if (2*n*n /= size(values)) then
            message = 'has '//to_text(size(values))//' values: must be 2 n**2, the real and '// &
                      'the imaginary part of a square matrix'
         else
            call check_physical(n_dof, n, 'this matrix', message)
            if (allocated(message)) message = 'does not fit n_dof, which '//message
         end if
         if (.not. allocated(message)) parts%mass = complex_rows(values, n)
         return
      end if
      if (.not. allocated(parts%mass)) then
         message = 'comes before the mass of its nodal diameter: put that first'
         return
      end if
      n = size(parts%mass, 1)
      select case (key)
      case ('stiffness')
         call take_square(values, n, parts%stiffness, message)
      case ('damping')
         call take_square(values, n, parts%damping, message)
      case ('stiffness_rotation')
         call take_square(values, n, parts%stiffness_rotation, message)
      case ('coriolis')
         call take_square(values, n, parts%coriolis, message)
      case ('load/static')
         call take_load(values, n, parts%load_static, message)
      case ('load/cosine')
         call take_load(values, n, parts%load_cosine, message)
      case ('load/sine')
         call take_load(values, n, parts%load_sine, message)
      case ('load/static_rotation')
         call take_load(values, n, parts%load_static_rotation, message)
      case default ! 'observe/matrix'
         if (modulo(size(values), 2*n) /= 0) then
            message = 'has '//to_text(size(values))//' values: must be a multiple of '// &
                      to_text(2*n)//', a row for each observed quantity'
         else
            parts%observe = complex_rows(values, n)
         end if
      end select
   end subroutine put_diameter

   subroutine take_square(values, n, matrix, message)
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n
      complex(wp), allocatable, intent(inout) :: matrix(:, :)
      character(:), allocatable, intent(out) :: message

      call miscount(size(values), 2*n*n, message)
      if (.not. allocated(message)) matrix = complex_rows(values, n)
   end subroutine take_square

   subroutine take_load(values, n, load, message)
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n
      complex(wp), allocatable, intent(inout) :: load(:)
      character(:), allocatable, intent(out) :: message

      call miscount(size(values), 2*n, message)
      if (.not. allocated(message)) load = cmplx(values(1::2), values(2::2), wp)
   end subroutine take_load

   !> Rows of n complex numbers.
   pure function complex_rows(values, n) result(matrix)
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n
      complex(wp), allocatable :: matrix(:, :)

      matrix = transpose(reshape(cmplx(values(1::2), values(2::2), wp), [n, size(values)/(2*n)]))
   end function complex_rows

   !> Forces of the air by a sector or a nodal diameter, or the motions that they are of.
   subroutine put_air(name, values, n_dof, parts, message)
      character(*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: n_dof
      type(cyclic_parts), intent(inout) :: parts
      character(:), allocatable, intent(out) :: message
      logical :: by_diameter
      integer :: a, m, start

      if (.not. allocated(parts%air)) allocate (parts%air)
      if (name == 'aero/modes') then
         if (size(values) == 0 .or. modulo(size(values), n_dof) /= 0) then
            message = 'has '//to_text(size(values))//' values: must be a multiple of '// &
                      to_text(n_dof)//', the dofs'
         else
            parts%air%modes = transpose(reshape(values, [n_dof, size(values)/n_dof]))
         end if
         return
      end if
      by_diameter = index(name, air_by_diameter) == 1
      start = merge(len(air_by_diameter), len(air_by_sector), by_diameter) + 1
      call take_number(name(start:), 1 - parts%n_sectors, parts%n_sectors - 1, m, message)
      if (allocated(message)) return
      a = nint(sqrt(0.5_wp*real(size(values), wp)))
      if (allocated(parts%air%number) .and. (parts%air%by_diameter .neqv. by_diameter)) then
         message = 'is given beside the other kind, by sector and by nodal diameter: must be '// &
                   'one of both'
      else if (2*a*a /= size(values)) then
         message = 'has '//to_text(size(values))//' values: must be 2 a**2, the real and the '// &
                   'imaginary part of a square matrix'
      else
         call forget(parts%air, m)
         call add_influence(parts%air, m, parts%n_sectors, complex_rows(values, a), message)
         parts%air%by_diameter = by_diameter
      end if
   end subroutine put_air

   !> A matrix that is given again replaces the one before it.
   pure subroutine forget(air, number)
      type(influence_type), intent(inout) :: air
      integer, intent(in) :: number
      logical, allocatable :: stays(:)
      integer, allocatable :: kept(:)
      integer :: j

      if (.not. allocated(air%number)) return
      stays = air%number /= number
      if (all(stays)) return
      kept = pack([(j, j=1, size(stays))], stays)
      air%matrix = air%matrix(:, :, kept)
      air%number = air%number(kept)
   end subroutine forget

   !> What the parts must be to each other once all are there.
   subroutine check_memory_sectors(n_dof, n_names, has_rows, has_sector, parts, message)
      integer, intent(in) :: n_dof
      !> Observed quantities; rows of the displacements go with them.
      integer, intent(in) :: n_names
      logical, intent(in) :: has_rows
      !> Whether there are matrices of a sector.
      logical, intent(in) :: has_sector
      type(cyclic_parts), intent(inout) :: parts
      !> What is wrong; not allocated where nothing is.
      character(:), allocatable, intent(out) :: message
      integer :: n_left, n_right

      n_left = 0
      n_right = 0
      if (allocated(parts%left)) n_left = size(parts%left)
      if (allocated(parts%right)) n_right = size(parts%right)
      if (n_left /= n_right) then
         message = 'cyclic/left and cyclic/right have '//to_text(n_left)//' and '// &
                   to_text(n_right)//' dofs: must be as many'
         return
      end if
      if (allocated(parts%nodal)) then
         call check_diameters(n_names, has_rows, has_sector, parts, message)
      else if (n_names > 0 .and. .not. has_rows) then
         message = 'observed quantities have names and no rows: give n_dof factors for each'
      end if
      if (allocated(message) .or. .not. allocated(parts%air)) return
      if (.not. allocated(parts%air%number)) then
         message = 'aero/modes comes without aero/sector/M or aero/nodal_diameter/M'
         return
      end if
      call finish_influence(parts%air, n_dof, message)
      if (allocated(message)) message = 'matrices of the air '//message
   end subroutine check_memory_sectors

   subroutine check_diameters(n_names, has_rows, has_sector, parts, message)
      integer, intent(in) :: n_names
      logical, intent(in) :: has_rows, has_sector
      type(cyclic_parts), intent(in) :: parts
      character(:), allocatable, intent(out) :: message
      logical :: has_own
      integer :: k

      if (has_sector) then
         message = 'mass or stiffness stands beside matrices of nodal diameters: must be one '// &
                   'of both'
         return
      end if
      has_own = .false.
      do k = 0, size(parts%nodal) - 1
         has_own = has_own .or. allocated(parts%nodal(k + 1)%observe)
         if (.not. allocated(parts%nodal(k + 1)%mass)) cycle
         if (allocated(parts%nodal(k + 1)%stiffness)) cycle
         message = 'the model in memory lacks '//nodal//to_text(k)//'/stiffness'
         return
      end do
      if (has_own .and. has_rows) then
         message = 'rows of observed quantities stand with the nodal diameters: give their '// &
                   'names without factors'
      else if (n_names > 0 .and. .not. has_rows) then
         call check_rows(parts, n_names, k)
         if (k >= 0) message = nodal//to_text(k)//'/observe/matrix must have a row for each of '// &
                               'the '//to_text(n_names)//' observed quantities'
      else if (has_own) then
         message = 'rows of nodal diameters observe quantities without names: give these, '// &
                   'without factors'
      end if
   end subroutine check_diameters

   !> The number at the end of a name.
   subroutine take_number(text, least, most, number, message)
      character(*), intent(in) :: text
      integer, intent(in) :: least, most
      integer, intent(out) :: number
      character(:), allocatable, intent(out) :: message
      logical :: ok

      call read_integer(text, number, ok)
      if (ok .and. number >= least .and. number <= most) return
      message = 'has '//text//': must be a number from '//to_text(least)//' to '//to_text(most)// &
                ' (give cyclic/n_sectors first)'
   end subroutine take_number

   pure subroutine miscount(given, expected, message)
      integer, intent(in) :: given, expected
      character(:), allocatable, intent(out) :: message

      if (given /= expected) message = 'has '//to_text(given)//' values: must be '// &
                                       to_text(expected)
   end subroutine miscount

end module fw_memory_sectors
