!> Groups /parameter and /resonance of a result file: what a resonance over a parameter has beside
!> its points, one row for each of them.
module fw_resonance_group
   use fw_kinds, only: wp
   use fw_parameters, only: parameter_words
   use fw_resonance_options, only: as_words, condition_words, resonance_options, resonance_words
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: resonance_table, resonance_row

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

   type, extends(result_group) :: resonance_table
      type(resonance_options) :: options
      integer :: n = 0
      type(resonance_row), allocatable :: row(:)
   contains
      procedure :: add
      procedure :: write => write_resonance
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

   subroutine write_resonance(self, to)
      class(resonance_table), intent(in) :: self
      type(group_writer), intent(inout) :: to

      if (self%n == 0) return
      associate (row => self%row(:self%n), options => self%options)
         call to%put('/parameter', [row%parameter], '', 'point', &
                     'value of the parameter, or factor of it')
         call to%put('/resonance/value', [row%value], '<length>', 'point', &
                     'what is largest, of the first observed quantity')
         call to%put('/resonance/first_harmonic', [row%first_harmonic], '<length>', 'point', &
                     'amplitude of the first observed quantity')
         call to%put('/resonance/phase', [row%phase], 'rad', 'point', &
                     'of the first observed quantity behind the load')
         call to%put('/resonance/curvature', [row%curvature], '', 'point', &
                     'second derivative of the value by omega')
         call to%note('/parameter', 'name', trim(parameter_words(options%parameter)))
         call to%note('/parameter', 'as', trim(as_words(options%as)))
         call to%note('/resonance', 'condition', trim(condition_words(options%condition)))
         call to%note('/resonance', 'quantity', trim(resonance_words(options%quantity)))
      end associate
   end subroutine write_resonance

end module fw_resonance_group
