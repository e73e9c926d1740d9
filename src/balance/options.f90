!> Options of the balance formulations (group &harmonics). Defaults live here and nowhere else.
module fw_harmonics_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above, at_least, below, from_to, operator(.and.)
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: harmonics_options
   public :: method_hbm, method_tcm, method_tcm_least_squares, method_hdhb
   public :: sampling_words, sampling_uniform, sampling_events, sampling_auto
   public :: instants_per_event_wave, most_for_accuracy, usual_accuracy
   public :: parity_auto, parity_all, parity_odd

   character(*), parameter :: method_words(*) = &
      [character(17) :: 'hbm', 'tcm', 'tcm_least_squares', 'hdhb']
   integer, parameter :: method_hbm = 1, method_tcm = 2, method_tcm_least_squares = 3, &
                         method_hdhb = 4

   character(*), parameter :: sampling_words(*) = [character(7) :: 'uniform', 'events', 'auto']
   integer, parameter :: sampling_uniform = 1, sampling_events = 2, sampling_auto = 3

   !> Instants for each wave of the highest harmonic that isolate every event.
   integer, parameter :: instants_per_event_wave = 4
   !> Harmonics at most where an accuracy is asked for and no number is given.
   integer, parameter :: most_for_accuracy = 53
   !> The accuracy where neither is given.
   real(wp), parameter :: usual_accuracy = 1.0e-2_wp

   character(*), parameter :: parity_words(*) = [character(4) :: 'auto', 'all', 'odd']
   integer, parameter :: parity_auto = 1, parity_all = 2, parity_odd = 3

   type :: harmonics_options
      integer :: method = method_hbm
      !> Highest harmonic retained, H.
      integer :: n_harmonics = 1
      !> Instants per period (0: chosen from the laws in use).
      integer :: n_time = 0
      !> Instants of the equations of the least-squares variant (0: twice the unknowns).
      integer :: n_collocation = 0
      !> Highest harmonic that reaches the nonlinear springs of hdhb (0: no filter).
      integer :: filter_harmonics = 0
      integer :: sampling = sampling_auto
      integer :: parity = parity_auto
      !> Relative error that the response is to keep within (0: harmonics as given).
      real(wp) :: accuracy = 0.0_wp
      !> Neither harmonics nor an accuracy was given, and the program took one; no input.
      logical :: is_chosen = .false.
      !> Doublings of an automatic n_time, below 0 halvings; no input, but set where accuracy asks.
      integer :: doublings = 0
   contains
      procedure :: bind_keys
      procedure :: with_harmonics
   end type harmonics_options

contains

   !> The keys of group &harmonics.
   subroutine bind_keys(self, keys)
      class(harmonics_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('harmonics', 'method, number of harmonics, instants per period')
      call keys%bind_word(key('method', &
                              'Galerkin, collocation, least squares, or unknowns at the '// &
                              'instants'), self%method, method_words)
      call keys%bind(key('n_harmonics', 'H, the highest; with accuracy the most that may be used', &
                         from_to(1, 10000), &
                         absent="53 with accuracy, 7 with 'mode', 'resonance', &control"), &
                     self%n_harmonics)
      call keys%bind(key('n_time', 'instants of a period, at least 2H+1; 0: chosen', &
                         from_to(0, 1000000)), self%n_time)
      call keys%bind(key('n_collocation', 'instants of the equations; 0: twice the '// &
                         'coefficients', at_least(0), only="method = 'tcm_least_squares'"), &
                     self%n_collocation)
      call keys%bind(key('filter_harmonics', 'those above do not reach springs; 0: no filter', &
                         at_least(0), only="method = 'hdhb'"), self%filter_harmonics)
      call keys%bind_word(key('sampling', &
                              'stick, slip and separation at instants, or located on the series'), &
                          self%sampling, sampling_words)
      call keys%bind_word(key('parity', '''auto'' leaves even harmonics out where that is exact'), &
                          self%parity, parity_words)
      call keys%bind(key('accuracy', &
                         'relative error for which harmonics and instants are chosen; 0: as '// &
                         'given', at_least(0.0_wp) .and. below(1.0_wp), &
                         only="method = 'hbm', natural sweeps and points"), self%accuracy)
   end subroutine bind_keys

   !> The same options with another highest harmonic, and with instants that are enough for it:
   !> those that are given may be too few for more harmonics, and hdhb has no choice of them.
   pure function with_harmonics(self, n_harmonics) result(options)
      class(harmonics_options), intent(in) :: self
      integer, intent(in) :: n_harmonics
      type(harmonics_options) :: options
      integer :: least

      options = self
      options%n_harmonics = n_harmonics
      if (options%method == method_hdhb) options%n_time = 0
      least = 2*n_harmonics + 1
      if (options%sampling == sampling_events) least = instants_per_event_wave*n_harmonics
      do while (options%n_time > 0 .and. options%n_time < least)
         options%n_time = 2*options%n_time
      end do
   end function with_harmonics

end module fw_harmonics_options
