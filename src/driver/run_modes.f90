!> Runs analysis 'modes', and lists the natural frequencies that a sweep covers.
module fw_run_modes
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use fw_analysis, only: analysis, run_type
   use fw_case, only: analyses, case_type
   use fw_cyclic_group, only: mistuned_group, modes_group
   use fw_error, only: error_type
   use fw_kinds, only: pi, wp
   use fw_mistuned_modes, only: find_mistuned_modes, mistuned_modes
   use fw_natural_modes, only: find_natural_modes, natural_modes
   use fw_remarks, only: remark_unused
   use fw_solver_options, only: unit_hertz, unit_words
   use fw_text, only: string_type, to_text
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: modes_analysis, list_in_range

   type, extends(analysis) :: modes_analysis
   contains
      procedure :: start
      procedure :: check
   end type modes_analysis

   !> Frequencies of a line of a table, and dofs up to which a check looks for them: eigenvalues
   !> take seconds from there on.
   integer, parameter :: most_shown = 6, most_checked = 500
   !> Frequencies looked at for those within the range of a sweep.
   integer, parameter :: most_listed = 60

contains

   !> Find, write and tabulate the natural frequencies of all nodal diameters.
   subroutine start(self, case, run, error)
      class(modes_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(natural_modes) :: modes
      type(modes_group) :: group
      character(:), allocatable :: text, name
      integer :: j

      associate (unused => self)
      end associate
      call remark_unused(case, run%summary%remarks)
      if (case%model%cyclic%is_mistuned) then
         call list_all_sectors(case, run, error)
         return
      end if
      call find_natural_modes(case, min(case%model%cyclic%n_modes, most_of(case)), modes, error)
      if (allocated(error)) return
      group%nodal_diameter = modes%nodal_diameter
      group%open = modes%open
      group%closed = modes%closed
      if (allocated(modes%open_damping)) then
         group%open_damping = modes%open_damping
         group%closed_damping = modes%closed_damping
      end if
      call run%writer%add(group, error)
      if (allocated(error)) return
      allocate (run%table(0))
      text = 'natural frequencies ['//trim(unit_words(case%sweep%unit))//']'
      if (case%model%cyclic%has_sectors()) text = text//' of each nodal diameter'
      call append(run%table, text)
      do j = 1, size(modes%nodal_diameter)
         name = ''
         if (case%model%cyclic%has_sectors()) name = to_text(modes%nodal_diameter(j))//' '
         call line_of(case, modes%open(:, j), -1.0_wp, huge(1.0_wp), text)
         call append(run%table, name//'open'//text)
         if (case%contact%n_pairs == 0) cycle
         call line_of(case, modes%closed(:, j), -1.0_wp, huge(1.0_wp), text)
         call append(run%table, name//'closed'//text)
      end do
   end subroutine start

   !> Those of all sectors together.
   subroutine list_all_sectors(case, run, error)
      type(case_type), intent(in) :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(mistuned_modes) :: modes
      type(mistuned_group) :: group
      character(:), allocatable :: text
      integer :: n

      n = case%model%cyclic%n_sectors*min(case%model%cyclic%n_modes, most_of(case))
      call find_mistuned_modes(case, n, modes, error)
      if (allocated(error)) return
      group%open = reshape(modes%open, [n, 1])
      group%closed = reshape(modes%closed, [n, 1])
      group%open_content = modes%open_content
      group%closed_content = modes%closed_content
      call run%writer%add(group, error)
      if (allocated(error)) return
      allocate (run%table(0))
      call append(run%table, 'natural frequencies ['//trim(unit_words(case%sweep%unit))// &
                  '] of all sectors')
      call line_of(case, modes%open, -1.0_wp, huge(1.0_wp), text)
      call append(run%table, 'open'//text)
      if (case%contact%n_pairs == 0) return
      call line_of(case, modes%closed, -1.0_wp, huge(1.0_wp), text)
      call append(run%table, 'closed'//text)
   end subroutine list_all_sectors

   !> No vibration is built.
   subroutine check(self, case, error)
      class(modes_analysis), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_case => case)
      end associate
   end subroutine check

   !> No more modes than coordinates.
   pure integer function most_of(case)
      type(case_type), intent(in) :: case
      integer :: k

      most_of = case%model%n_dof
      if (.not. case%model%cyclic%has_nodal()) return
      do k = 1, size(case%model%cyclic%nodal)
         if (allocated(case%model%cyclic%nodal(k)%mass)) most_of = &
            max(most_of, size(case%model%cyclic%nodal(k)%mass, 1))
      end do
   end function most_of

   !> The frequencies within the range of a sweep, as comments of a namelist: of the nodal
   !> diameters that its harmonics have, or of all sectors together.
   subroutine list_in_range(case, lines)
      type(case_type), intent(in) :: case
      type(string_type), allocatable, intent(out) :: lines(:)
      type(natural_modes) :: modes
      type(error_type), allocatable :: ignored
      character(:), allocatable :: name, text
      character(:), allocatable :: of_what
      real(wp) :: range(2)
      integer :: j

      allocate (lines(0))
      if (.not. analyses(case%analysis)%has_points) return
      of_what = ''
      if (case%model%cyclic%is_mistuned) of_what = ' of all sectors'
      if (case%model%cyclic%n_solved()*most_of(case) > most_checked) then
         call append(lines, '! natural frequencies'//of_what//": see analysis 'modes' (more "// &
                     'than '//to_text(most_checked)//' dofs)')
         return
      end if
      if (analyses(case%analysis)%is_free) then
         range = [0.0_wp, huge(1.0_wp)]
      else
         range = case%sweep%range()
         if (range(2) <= 0.0_wp) range(2) = range(1)
      end if
      if (case%model%cyclic%is_mistuned) then
         call find_all_sectors(case, modes, ignored)
      else
         call find_natural_modes(case, min(most_listed, most_of(case)), modes, ignored, &
                                 diameters_of(case))
      end if
      if (allocated(ignored)) return
      text = of_what//' within the sweep'
      if (analyses(case%analysis)%is_free) text = of_what
      call append(lines, '! natural frequencies ['//trim(unit_words(case%sweep%unit))//']'// &
                  text//':')
      do j = 1, size(modes%nodal_diameter)
         call line_of(case, modes%open(:, j), range(1), range(2), text)
         name = ''
         if (case%model%cyclic%has_sectors() .and. .not. case%model%cyclic%is_mistuned) name = &
            'nodal diameter '//to_text(modes%nodal_diameter(j))//' '
         call append(lines, '!   '//name//'open'//text)
         if (case%contact%n_pairs == 0) cycle
         call line_of(case, modes%closed(:, j), range(1), range(2), text)
         call append(lines, '!   '//name//'closed'//text)
      end do
   end subroutine list_in_range

   !> Those of all sectors, in place of those of a nodal diameter.
   subroutine find_all_sectors(case, modes, error)
      type(case_type), intent(in) :: case
      type(natural_modes), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      type(mistuned_modes) :: all
      integer :: n

      n = case%model%cyclic%n_sectors*min(most_listed, most_of(case))
      call find_mistuned_modes(case, n, all, error)
      if (allocated(error)) return
      modes%nodal_diameter = [0]
      modes%open = reshape(all%open, [n, 1])
      modes%closed = reshape(all%closed, [n, 1])
   end subroutine find_all_sectors

   !> Nodal diameters of the harmonics, each once, without sign where waves both ways are alike.
   pure function diameters_of(case) result(list)
      type(case_type), intent(in) :: case
      integer, allocatable :: list(:)
      integer :: h, k

      allocate (list(0))
      do h = 1, case%harmonics%n_harmonics
         k = case%model%cyclic%nodal_diameter(h)
         if (.not. case%model%cyclic%splits_waves()) k = abs(k)
         if (.not. any(list == k)) list = [list, k]
      end do
   end function diameters_of

   !> Frequencies between two in the unit of the sweep.
   subroutine line_of(case, frequency, first, last, text)
      type(case_type), intent(in) :: case
      real(wp), intent(in) :: frequency(:)
      real(wp), intent(in) :: first, last
      character(:), allocatable, intent(out) :: text
      character(14) :: number
      real(wp) :: factor
      integer :: i, n

      factor = 1.0_wp
      if (case%sweep%unit == unit_hertz) factor = 0.5_wp/pi
      text = ''
      n = 0
      do i = 1, size(frequency)
         ! Where there are fewer: a comparison of what is no number would be an invalid operation.
         if (ieee_is_nan(frequency(i))) cycle
         if (frequency(i) < first .or. frequency(i) > last) cycle
         n = n + 1
         if (n > most_shown) cycle
         write (number, '(es13.5)') factor*frequency(i)
         text = text//' '//trim(adjustl(number))
      end do
      if (n > most_shown) text = text//' and '//to_text(n - most_shown)//' more'
      if (n == 0) text = ' none'
   end subroutine line_of

end module fw_run_modes
