!> What Python asks of input: the structure of a case as it is computed, with what the namelist
!> adds, scales and overrides, and the keys of a namelist that need not be a valid case any more.
module fw_python_parts
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_case, only: case_type
   use fw_cyclic_data, only: nodal_matrices
   use fw_error, only: error_type, fatal_error, status_usage
   use fw_kinds, only: wp
   use fw_namelist, only: parse_namelist
   use fw_namelist_data, only: namelist_type
   use fw_point_quantities, only: point_quantities, quantity_type
   use fw_sector, only: damp_modes, sector_at
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: case_part, namelist_words, quantity_lines

   character(*), parameter :: names = 'mass, stiffness, damping, load/static, load/cosine, '// &
                              'load/sine, load/wave_harmonic, load/wave_power, load/wave, '// &
                              'coriolis, circulatory, structural_damping, speed_order, '// &
                              'modal_damping, aero/modes, aero/stiffness, '// &
                              'contact/side_1, contact/side_2, contact/gap, '// &
                              'contact/depth, contact/mu, contact/normal_load, '// &
                              'contact/residual, contact/slider_1, contact/slider_2, '// &
                              'contact/tangential_stiffness, contact/normal_stiffness, '// &
                              'spring/coefficient, observe/matrix, n_springs, solver_tolerance'

contains

   !> A part of a case that was read, by the name of its dataset in a model file where there is
   !> one; the last index runs fastest. Nothing where the case has no such part.
   subroutine case_part(case, name, values, error)
      type(case_type), intent(in) :: case
      character(*), intent(in) :: name
      real(wp), allocatable, intent(out) :: values(:)
      !> status_usage for a name that is not known.
      type(error_type), allocatable, intent(out) :: error

      associate (model => case%model, contact => case%contact)
         select case (name)
         case ('mass')
            if (allocated(model%mass)) values = flat(model%mass)
         case ('stiffness')
            if (allocated(model%stiffness)) values = flat(model%stiffness)
         case ('damping')
            if (allocated(model%damping)) values = flat(model%damping)
         case ('load/static')
            if (allocated(model%load_static)) values = model%load_static
         case ('load/cosine')
            if (allocated(model%load_cosine)) values = model%load_cosine
         case ('load/sine')
            if (allocated(model%load_sine)) values = model%load_sine
         case ('load/wave_harmonic')
            if (allocated(model%waves%harmonic)) values = real(model%waves%harmonic, wp)
         case ('load/wave_power')
            if (allocated(model%waves%power)) values = real(model%waves%power, wp)
         case ('load/wave')
            if (allocated(model%load_wave)) values = flat(model%load_wave)
         case ('coriolis')
            if (allocated(model%cyclic%coriolis)) values = flat(transpose(model%cyclic%coriolis))
         case ('circulatory')
            ! Its symmetric part is in the stiffness.
            if (allocated(model%cyclic%circulatory)) then
               values = flat(transpose(model%cyclic%circulatory))
            end if
         case ('structural_damping')
            if (allocated(model%cyclic%structural)) then
               values = flat(model%cyclic%structural)
            else if (model%loss_factor > 0.0_wp) then
               values = flat(model%loss_factor*model%stiffness)
            end if
         case ('speed_order')
            values = [case%sweep%speed_order]
         case ('modal_damping')
            ! Of sectors: that of other structures is in the damping.
            if (model%cyclic%modal_damping > 0.0_wp) then
               call find_modal_damping(case, values, error)
               if (allocated(error)) return
            end if
         case ('aero/modes')
            if (allocated(model%cyclic%air)) values = flat(transpose(model%cyclic%air%modes))
         case ('aero/stiffness')
            if (allocated(model%cyclic%air)) values = air_stiffness(case)
         case ('observe/matrix')
            if (allocated(model%observe_matrix)) values = flat(transpose(model%observe_matrix))
         case ('contact/side_1')
            if (allocated(contact%side_1)) values = flat(real(contact%side_1, wp))
         case ('contact/side_2')
            if (allocated(contact%side_2)) values = flat(real(contact%side_2, wp))
         case ('contact/gap')
            if (allocated(contact%gap)) values = contact%gap
         case ('contact/depth')
            if (allocated(contact%depth)) values = contact%depth
         case ('contact/mu')
            if (allocated(contact%mu)) values = contact%mu
         case ('contact/normal_load')
            if (allocated(contact%normal_load)) values = contact%normal_load
         case ('contact/residual')
            if (allocated(contact%residual)) values = contact%residual
         case ('contact/slider_1')
            if (allocated(contact%slider_1)) values = contact%slider_1
         case ('contact/slider_2')
            if (allocated(contact%slider_2)) values = contact%slider_2
         case ('contact/tangential_stiffness')
            if (allocated(contact%tangential_stiffness)) values = contact%tangential_stiffness
         case ('contact/normal_stiffness')
            if (allocated(contact%normal_stiffness)) values = contact%normal_stiffness
         case ('spring/coefficient')
            if (allocated(case%springs%coefficient)) values = case%springs%coefficient
         case ('n_springs')
            values = [real(case%springs%n_springs, wp)]
         case ('solver_tolerance')
            values = [case%solver%tolerance]
         case default
            call fatal_error(error, "a case has no part '"//name//"': must be one of "//names, &
                             status_usage)
         end select
      end associate
      if (.not. allocated(values)) allocate (values(0))
   end subroutine case_part

   !> Damping of modes in harmonics 1 .. H, of the free dofs of the sector (H, n, n, 2), real and
   !> imaginary part.
   subroutine find_modal_damping(case, values, error)
      type(case_type), intent(in) :: case
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices) :: nodal
      real(wp), allocatable :: part(:, :, :)
      integer :: h, k

      allocate (values(0))
      do h = 1, case%harmonics%n_harmonics
         k = case%model%cyclic%nodal_diameter(h)
         call sector_at(case%model, abs(k), nodal, error)
         if (allocated(error)) return
         if (allocated(nodal%damping)) deallocate (nodal%damping)
         call damp_modes(case%model, abs(k), case%model%cyclic%modal_damping, nodal, error)
         if (allocated(error)) return
         if (k < 0) nodal%damping = conjg(nodal%damping)
         allocate (part(2, size(nodal%damping, 1), size(nodal%damping, 1)))
         part(1, :, :) = transpose(real(nodal%damping, wp))
         part(2, :, :) = transpose(aimag(nodal%damping))
         values = [values, [part]]
         deallocate (part)
      end do
   end subroutine find_modal_damping

   !> Stiffness of the air in harmonics 1 .. H (H, a, a, 2), real and imaginary part; NaN where it
   !> is not known.
   pure function air_stiffness(case) result(values)
      type(case_type), intent(in) :: case
      real(wp), allocatable :: values(:)
      complex(wp), allocatable :: stiffness(:, :)
      real(wp), allocatable :: parts(:, :, :, :)
      integer :: a, h

      associate (cyclic => case%model%cyclic)
         a = size(cyclic%air%matrix, 1)
         allocate (parts(2, a, a, case%harmonics%n_harmonics), &
                   source=ieee_value(1.0_wp, ieee_quiet_nan))
         do h = 1, case%harmonics%n_harmonics
            call cyclic%air_stiffness(cyclic%nodal_diameter(h), stiffness)
            if (.not. allocated(stiffness)) cycle
            parts(1, :, :, h) = transpose(real(stiffness, wp))
            parts(2, :, :, h) = transpose(aimag(stiffness))
         end do
      end associate
      values = reshape(parts, [size(parts)])
   end function air_stiffness

   !> Every key of a namelist as it is written there: 'group%key', how many values, the values.
   subroutine namelist_words(text, words, error)
      character(*), intent(in) :: text
      type(string_type), allocatable, intent(out) :: words(:)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_type) :: input
      integer :: i, k, n

      allocate (words(0))
      ! The texts of the reader serve one thread at a time.
      !$omp critical (fretwear_io)
      call parse_namelist(text, 'namelist', input, error)
      if (.not. allocated(error)) then
         do i = 1, input%n_entries
            associate (entry => input%entries(i))
               call append(words, entry%group//'%'//entry%key)
               call append(words, to_text(sum(entry%values%repeat)))
               do k = 1, size(entry%values)
                  do n = 1, entry%values(k)%repeat
                     call append(words, entry%values(k)%text)
                  end do
               end do
            end associate
         end do
      end if
      !$omp end critical (fretwear_io)
   end subroutine namelist_words

   !> The quantities of a point: a line each, with the name and the shape of its array, where -1 is
   !> a size that only the numbers tell.
   subroutine quantity_lines(case, text)
      type(case_type), intent(in) :: case
      character(:), allocatable, intent(out) :: text
      type(quantity_type), allocatable :: list(:)
      integer, allocatable :: sizes(:)
      integer :: i, k

      call point_quantities(list)
      text = ''
      do i = 1, size(list)
         text = text//trim(list(i)%name)
         sizes = list(i)%row_shape(case)
         do k = size(sizes), 1, -1
            text = text//' '//to_text(sizes(k))
         end do
         text = text//new_line('a')
      end do
   end subroutine quantity_lines

   pure function flat(array) result(values)
      real(wp), intent(in) :: array(:, :)
      real(wp) :: values(size(array))

      values = reshape(array, [size(array)])
   end function flat

end module fw_python_parts
