!> What the datasets of a result file say of themselves: the attributes `long_name` and `units`,
!> and the names of their dimensions (DIMENSION_LABELS, as HDF5's dimension scales have them).
!>
!> Units follow the unit system of the model file, four words 'length-mass-time-force' such as
!> 'mm-tonne-s-N'. Where it says nothing of the kind, only what does not depend on it has units.
module fw_result_labels
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute
   use fw_text, only: string_type
   use fw_text_list, only: words_of
   use fw_point_quantities, only: quantity_type
   implicit none (type, external)
   private

   public :: label_dataset, label_quantity

   type :: label_type
      character(64) :: name
      !> A unit, or the quantity (in angle brackets) whose unit is that of the model.
      character(16) :: quantity
      !> Names of the dimensions in the order of h5py, separated by blanks.
      character(32) :: dimensions
      character(64) :: long_name
   end type label_type

   !> What is no quantity of a point.
   type(label_type), parameter :: labels(*) = [ &
      label_type('/observed/name', '', 'observed', 'names of the observed quantities'), &
      label_type('/contact/position', '<length>', 'pair axis', 'centre of the pair x, y, z'), &
      label_type('/contact/area', '<area>', 'pair', 'area of the pair'), &
      label_type('/contact/patch', '', 'pair', 'patch that the pair belongs to'), &
      label_type('/peak/omega', 'rad/s', 'peak', 'angular frequency of the maximum'), &
      label_type('/peak/amplitude', '<length>', 'peak', 'largest magnitude over the period'), &
      label_type('/peak/bandwidth', 'rad/s', 'peak', 'width at half of the power'), &
      label_type('/peak/tolerance', '1', 'peak', 'amplitude known to this part of it'), &
      label_type('/peak/coefficients', '<length>', 'peak coefficient', &
                 'Fourier coefficients 0, c1, s1, ... of the quantity'), &
      label_type('/peak/observed', '', 'peak', 'observed quantity, its column from 0'), &
      label_type('/peak/cycle/omega', 'rad/s', 'one', 'angular frequency of this period'), &
      label_type('/peak/cycle/pair', '', 'cycle_pair', 'pairs that dissipate most, from 0'), &
      label_type('/peak/cycle/relative_displacement', '<length>', &
                 'time cycle_pair component', 'relative displacement (t1, t2, n)'), &
      label_type('/peak/cycle/force', '<force>', 'time cycle_pair component', &
                 'contact force (t1, t2, n), as the law gives it'), &
      label_type('/peak/found_by', '', 'peak', 'how it was found, an index into names'), &
      label_type('/bifurcation/omega', 'rad/s', 'bifurcation', 'angular frequency of the place'), &
      label_type('/bifurcation/parameter', '', 'bifurcation', 'value of the parameter'), &
      label_type('/bifurcation/parameter_error', '', 'bifurcation', &
                 'estimated error of the parameter'), &
      label_type('/bifurcation/error', 'rad/s', 'bifurcation', &
                 'estimated error of the frequency'), &
      label_type('/bifurcation/amplitude', '<length>', 'bifurcation observed', &
                 'largest magnitude over the period'), &
      label_type('/bifurcation/coefficients', '<length>', 'bifurcation coefficient observed', &
                 'Fourier coefficients 0, c1, s1, ... of observed quantities'), &
      label_type('/bifurcation/multiplier', '1', 'bifurcation part', &
                 'the multiplier on the unit circle, real and imaginary'), &
      label_type('/bifurcation/kind', '', 'bifurcation', &
                 'what happens there, an index into names'), &
      label_type('/bifurcation/found_by', '', 'bifurcation', &
                 'how it was found, an index into names'), &
      label_type('/cyclic/nodal_diameter', '', 'harmonic', &
                 'signed nodal diameter of each harmonic'), &
      label_type('/modes/nodal_diameter', '', 'diameter', 'nodal diameter'), &
      label_type('/modes/open', 'rad/s', 'diameter mode', &
                 'natural frequencies without contact'), &
      label_type('/modes/closed', 'rad/s', 'diameter mode', &
                 'natural frequencies with every pair closed'), &
      label_type('/modes/open_damping', '1', 'diameter mode', &
                 'damping of them, over the critical one'), &
      label_type('/modes/closed_damping', '1', 'diameter mode', &
                 'damping of them, over the critical one'), &
      label_type('/mode/shape', '', 'point observed part', &
                 'first harmonic, cosine and sine, over the modal amplitude'), &
      label_type('/mode/resonant_scale', '1', 'point', &
                 'factor of the load with which the point is a resonance'), &
      label_type('/mode/limit_cycle/amplitude', '', 'cycle', &
                 'amplitude of the limit cycle, as the control has it'), &
      label_type('/mode/limit_cycle/omega', 'rad/s', 'cycle', &
                 'angular frequency of the limit cycle'), &
      label_type('/mode/limit_cycle/stable', '', 'cycle', &
                 '1 where damping grows with the amplitude'), &
      label_type('/synthesis/scale', '1', 'scale', 'factor of the vibratory load'), &
      label_type('/synthesis/omega', 'rad/s', 'scale point side', &
                 'frequencies of the response put together, NaN: none'), &
      label_type('/synthesis/first_harmonic', '<length>', 'point', &
                 'amplitude of the first observed quantity'), &
      label_type('/parameter', '', 'point', 'value of the parameter, or factor of it'), &
      label_type('/resonance/value', '<length>', 'point', &
                 'what is largest, of the first observed quantity'), &
      label_type('/resonance/first_harmonic', '<length>', 'point', &
                 'amplitude of the first observed quantity'), &
      label_type('/resonance/phase', 'rad', 'point', &
                 'of the first observed quantity behind the load'), &
      label_type('/resonance/curvature', '', 'point', &
                 'second derivative of the value by omega'), &
      label_type('/wear/depth_halved', '<length>', 'pair', &
                 'final wear depth with steps of half the size')]

contains

   !> Write the attributes of a dataset that exists; one that is not known gets none.
   subroutine label_dataset(file, name, unit_system, error)
      type(hdf5_file), intent(in) :: file
      character(*), intent(in) :: name
      !> Unit system of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(labels)
         if (labels(i)%name == name) exit
      end do
      if (i <= size(labels)) call write_label(file, labels(i), unit_system, error)
   end subroutine label_dataset

   !> The same of a quantity of the points, where the file stands at its dataset.
   subroutine label_quantity(place, quantity, unit_system, error)
      type(hdf5_file), intent(in) :: place
      type(quantity_type), intent(in) :: quantity
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      call write_label(place, label_type('.', quantity%unit, quantity%dimensions, &
                                         quantity%long_name), unit_system, error)
   end subroutine label_quantity

   !> No attribute `units` where the unit is not known: a blank one would say that there is none.
   subroutine write_label(file, label, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(label_type), intent(in) :: label
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: units

      call write_attribute(file, trim(label%name), 'long_name', trim(label%long_name), error)
      if (allocated(error)) return
      call write_attribute(file, trim(label%name), 'DIMENSION_LABELS', &
                           words_of(label%dimensions, ' '), error)
      if (allocated(error)) return
      units = unit_of(trim(label%quantity), unit_system)
      if (len(units) > 0) call write_attribute(file, trim(label%name), 'units', units, error)
   end subroutine write_label

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

end module fw_result_labels
