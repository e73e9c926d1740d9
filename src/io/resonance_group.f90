!> Groups /parameter and /resonance of a result file: what a resonance over a parameter has beside
!> its points, one row for each of them.
module fw_resonance_group
   use fw_error, only: error_type
   use fw_hdf5, only: hdf5_file, write_attribute, write_dataset
   use fw_kinds, only: wp
   use fw_parameters, only: parameter_words
   use fw_resonance_options, only: as_words, condition_words, resonance_options, resonance_words
   use fw_result_labels, only: label_dataset
   implicit none (type, external)
   private

   public :: resonance_table, resonance_row, write_resonance

   type :: resonance_row
      !> Value, or factor.
      real(wp) :: parameter = 0.0_wp
      !> [rad/s]
      real(wp) :: omega = 0.0_wp
      !> Of the first observed quantity: what is followed, the amplitude of the first harmonic
      !> [length], and how far it is behind the load [rad].
      real(wp) :: value = 0.0_wp, first_harmonic = 0.0_wp, phase = 0.0_wp
      !> d2 value/d omega2; NaN where it is not known.
      real(wp) :: curvature = 0.0_wp
      logical :: converged = .true.
   end type resonance_row

   type :: resonance_table
      integer :: n = 0
      type(resonance_row), allocatable :: row(:)
   contains
      procedure :: add
   end type resonance_table

contains

   pure subroutine add(self, row)
      class(resonance_table), intent(inout) :: self
      type(resonance_row), intent(in) :: row
      type(resonance_row), allocatable :: longer(:)

      if (.not. allocated(self%row)) allocate (self%row(16))
      if (self%n == size(self%row)) then
         allocate (longer(2*self%n))
         longer(:self%n) = self%row
         call move_alloc(longer, self%row)
      end if
      self%n = self%n + 1
      self%row(self%n) = row
   end subroutine add

   !> Write the groups; nothing where there is no point.
   subroutine write_resonance(file, table, options, unit_system, error)
      type(hdf5_file), intent(in) :: file
      type(resonance_table), intent(in) :: table
      type(resonance_options), intent(in) :: options
      !> Of the model; not allocated where nothing is known of it.
      character(:), allocatable, intent(in) :: unit_system
      type(error_type), allocatable, intent(out) :: error

      if (table%n == 0) return
      associate (row => table%row(:table%n))
         call write_one('/parameter', row%parameter)
         if (.not. allocated(error)) call write_one('/resonance/value', row%value)
         if (.not. allocated(error)) call write_one('/resonance/first_harmonic', row%first_harmonic)
         if (.not. allocated(error)) call write_one('/resonance/phase', row%phase)
         if (.not. allocated(error)) call write_one('/resonance/curvature', row%curvature)
      end associate
      if (.not. allocated(error)) call write_attribute(file, '/parameter', 'name', &
         trim(parameter_words(options%parameter)), error)
      if (.not. allocated(error)) call write_attribute(file, '/parameter', 'as', &
         trim(as_words(options%as)), error)
      if (.not. allocated(error)) call write_attribute(file, '/resonance', 'condition', &
         trim(condition_words(options%condition)), error)
      if (.not. allocated(error)) call write_attribute(file, '/resonance', 'quantity', &
         trim(resonance_words(options%quantity)), error)

   contains

      subroutine write_one(name, values)
         character(*), intent(in) :: name
         real(wp), intent(in) :: values(:)
         real(wp) :: copy(size(values))

         copy = values
         call write_dataset(file, name, copy, error)
         if (.not. allocated(error)) call label_dataset(file, name, unit_system, error)
      end subroutine write_one

   end subroutine write_resonance

end module fw_resonance_group
