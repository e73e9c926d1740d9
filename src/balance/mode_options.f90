!> Options of a nonlinear mode (group &mode). Defaults live here and nowhere else.
module fw_mode_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, from_to
   use fw_kinds, only: wp
   use fw_solver_options, only: continuation_arclength, continuation_words, most_points, &
      unit_rad_per_second, unit_words
   implicit none (type, external)
   private

   public :: mode_options
   public :: control_observed, control_modal

   !> What an amplitude is: of the first harmonic of the first observed quantity, or
   !> sqrt(U_1^H M U_1) of the whole structure.
   character(*), parameter :: control_words(*) = [character(8) :: 'observed', 'modal']
   integer, parameter :: control_observed = 1, control_modal = 2

   type :: mode_options
      !> Of the elastic modes of the structure with its closed pairs stuck, from 1.
      integer :: number = 1
      !> In place of the number, the mode of the nearest frequency (0: by its number): in the unit
      !> of `unit` while it is read, in rad/s from then on.
      real(wp) :: near = 0.0_wp
      integer :: unit = unit_rad_per_second
      !> Lowest and highest amplitude, as `control` has it.
      real(wp) :: start = 0.0_wp
      real(wp) :: end = 0.0_wp
      !> In place of both, each by itself, rising.
      real(wp), allocatable :: amplitudes(:)
      integer :: control = control_observed
      !> Points, evenly spaced in the logarithm of the amplitude; of a branch the number that sets
      !> its longest step.
      integer :: n_points = 40
      integer :: continuation = continuation_arclength
      !> A branch may turn round without end.
      integer :: max_points = 1000
      !> Factors of the vibratory load for which responses are put together.
      real(wp), allocatable :: synthesis(:)
   contains
      procedure :: bind_keys
   end type mode_options

contains

   !> The keys of group &mode.
   subroutine bind_keys(self, keys, is_mode)
      class(mode_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      !> Whether the analysis is that of a mode.
      logical, intent(in) :: is_mode
      logical :: is_range

      call keys%open('mode', 'a nonlinear mode over its amplitude')
      call keys%bind(key('number', 'of the elastic modes with closed pairs stuck', at_least(1)), &
                     self%number)
      call keys%bind(key('near', 'mode nearest to this stuck frequency; 0: by number', &
                         at_least(0.0_wp), unit='unit'), self%near)
      call keys%bind_word(key('unit', 'of near; results are in rad/s'), self%unit, unit_words)
      call keys%bind(key('amplitudes', 'rising, in place of start, end, n_points', above(0.0_wp), &
                         unit='L', shape=':', repeats=.false., absent='none', &
                         only="analysis = 'mode', natural steps"), self%amplitudes)
      is_range = is_mode .and. .not. allocated(self%amplitudes)
      call keys%bind(key('start', 'lowest amplitude', above(0.0_wp), unit='L', &
                         absent='required', only="analysis = 'mode'"), self%start, &
                     needed=is_range)
      call keys%bind(key('end', 'highest amplitude', above(0.0_wp), unit='L', &
                         absent='required', only="analysis = 'mode'"), self%end, needed=is_range)
      call keys%bind_word(key('control', &
                              'amplitude of the first harmonic of the first observed quantity, '// &
                              'or modal, sqrt(U^H M U)'), self%control, control_words)
      call keys%bind(key('n_points', 'even in the logarithm; of a branch: its longest step', &
                         from_to(2, most_points)), self%n_points)
      call keys%bind_word(key('continuation', 'given amplitudes, or a branch through folds'), &
                          self%continuation, continuation_words)
      call keys%bind(key('max_points', 'of a branch', at_least(2), &
                         only="continuation = 'arclength'"), self%max_points)
      call keys%bind(key('synthesis', &
                         'load factors for which the response near the resonance is put together', &
                         above(0.0_wp), shape=':', repeats=.false., absent='none'), self%synthesis)
   end subroutine bind_keys

end module fw_mode_options
