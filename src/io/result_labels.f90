!> What the datasets of a result file say of themselves: the attributes `long_name` and `units`,
!> and the names of their dimensions (DIMENSION_LABELS, as HDF5's dimension scales have them).
!>
!> Units follow the unit system of the model file, four words 'length-mass-time-force' such as
!> 'mm-tonne-s-N'. Where it says nothing of the kind, only what does not depend on it has units.
module fw_result_labels
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file
   use fw_hdf5, only: write_attribute
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: label_dataset, unit_of

   type :: label_type
      character(32) :: name
      !> A unit, or the quantity (in angle brackets) whose unit is that of the model.
      character(16) :: quantity
      !> Names of the dimensions in the order of h5py, separated by blanks.
      character(32) :: dimensions
      character(64) :: long_name
   end type label_type

   type(label_type), parameter :: labels(*) = [ &
      label_type('/omega', 'rad/s', 'point', 'angular frequency of the excitation'), &
      label_type('/coefficients', '<length>', 'point coefficient observed', &
                 'Fourier coefficients 0, c1, s1, ... of observed quantities'), &
      label_type('/amplitude', '<length>', 'point observed', &
                 'largest magnitude over the period'), &
      label_type('/converged', '', 'point', 'whether the point converged'), &
      label_type('/served_by', '', 'point', 'what gave the solution, an index into names'), &
      label_type('/iterations', '1', 'point', 'iterations of the solver'), &
      label_type('/residual', '1', 'point', 'residual over vibratory load'), &
      label_type('/seconds', 's', 'point', 'time spent on the point'), &
      label_type('/fold', '', 'point', 'whether the branch turns here'), &
      label_type('/harmonics', '1', 'point', 'harmonics of the balance'), &
      label_type('/instants', '1', 'point', 'instants of the period'), &
      label_type('/error_estimate', '1', 'point', 'bound of the relative error of the response'), &
      label_type('/floquet/stable', '', 'point', '1 stable, 0 unstable, -1 not known'), &
      label_type('/floquet/multipliers', '1', 'point multiplier part', &
                 'Floquet multipliers, real and imaginary part'), &
      label_type('/observed/name', '', 'observed', 'names of the observed quantities'), &
      label_type('/contact/force', '<force>', 'point coefficient pair direction', &
                 'Fourier coefficients of the contact forces t1, t2, n'), &
      label_type('/contact/fraction', '1', 'point pair state', &
                 'share of the period in stick, slip, open'), &
      label_type('/contact/dissipation', '<energy>', 'point pair', 'friction energy per cycle'), &
      label_type('/contact/position', '<length>', 'pair axis', 'centre of the pair x, y, z'), &
      label_type('/contact/area', '<area>', 'pair', 'area of the pair'), &
      label_type('/contact/patch', '', 'pair', 'patch that the pair belongs to'), &
      label_type('/history/observed', '<length>', 'point instant observed', &
                 'observed quantities over one period'), &
      label_type('/history/force', '<force>', 'point instant pair direction', &
                 'contact forces t1, t2, n over one period'), &
      label_type('/history/relative_displacement', '<length>', 'point instant pair direction', &
                 'relative displacement t1, t2, n over one period'), &
      label_type('/wear/cycles', '1', 'step', 'cycles of vibration'), &
      label_type('/wear/depth', '<length>', 'step pair', 'wear depth'), &
      label_type('/wear/depth_halved', '<length>', 'pair', &
                 'final wear depth with steps of half the size'), &
      label_type('/wear/rate', '<length>', 'step pair', 'wear depth per cycle'), &
      label_type('/wear/energy', '<energy>', 'step pair', 'accumulated friction energy'), &
      label_type('/wear/volume', '<volume>', 'step patch', 'worn volume of the patch')]

contains

   !> Write the attributes of a dataset that exists; one that is not known gets none.
   subroutine label_dataset(file, name, unit_system, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      !> Unit system of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: units
      integer :: i

      do i = 1, size(labels)
         if (labels(i)%name == name) exit
      end do
      if (i > size(labels)) return
      call write_attribute(file, name, 'long_name', trim(labels(i)%long_name), error)
      if (allocated(error)) return
      call write_attribute(file, name, 'DIMENSION_LABELS', words_of(labels(i)%dimensions, ' '), &
                           error)
      if (allocated(error)) return
      units = unit_of(trim(labels(i)%quantity), unit_system)
      if (len(units) > 0) call write_attribute(file, name, 'units', units, error)
   end subroutine label_dataset

   !> The unit of a quantity: '<length>', '<area>', '<volume>', '<force>' or '<energy>' of the
   !> unit system, '' where that is not known; anything else is a unit already.
   function unit_of(quantity, unit_system) result(unit)
      character(*), intent(in) :: quantity
      character(:), allocatable, intent(in) :: unit_system
      character(:), allocatable :: unit
      integer, parameter :: length = 1, force = 4
      type(string_type), allocatable :: words(:)

      unit = quantity
      if (index(quantity, '<') /= 1) return
      unit = ''
      if (.not. allocated(unit_system)) return
      words = words_of(unit_system, '-')
      if (size(words) /= force) return
      select case (quantity)
      case ('<length>')
         unit = words(length)%text
      case ('<area>')
         unit = words(length)%text//'^2'
      case ('<volume>')
         unit = words(length)%text//'^3'
      case ('<force>')
         unit = words(force)%text
      case ('<energy>')
         unit = words(force)%text//' '//words(length)%text
      case default ! a number
      end select
   end function unit_of

   !> The words of a text, in order.
   function words_of(text, separator) result(words)
      character(*), intent(in) :: text
      character, intent(in) :: separator
      type(string_type), allocatable :: words(:)
      integer :: first, i, last, n

      n = 1
      do i = 1, len_trim(text)
         if (text(i:i) == separator) n = n + 1
      end do
      allocate (words(n))
      first = 1
      do i = 1, n
         last = index(text(first:), separator)
         if (last == 0 .or. i == n) last = len_trim(text) - first + 2
         words(i)%text = text(first:first + last - 2)
         first = first + last
      end do
   end function words_of

end module fw_result_labels
