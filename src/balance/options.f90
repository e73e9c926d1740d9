!> Options of the balance formulations (group &harmonics). Defaults live here and nowhere else.
module fw_harmonics_options
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: harmonics_options
   public :: method_words, method_hbm, method_tcm, method_tcm_least_squares, method_hdhb
   public :: sampling_words, sampling_uniform, sampling_events, sampling_auto
   public :: instants_per_event_wave, most_for_accuracy
   public :: parity_words, parity_auto, parity_all, parity_odd

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
      !> Add harmonics only where the solution needs them.
      logical :: adaptive = .false.
      !> Share of the contact force that may be left out of the retained harmonics.
      real(wp) :: adaptive_tolerance = 1.0e-3_wp
      !> Relative error that the response is to keep within (0: harmonics as given).
      real(wp) :: accuracy = 0.0_wp
      !> Doublings of an automatic n_time, below 0 halvings; no input, but set where accuracy asks.
      integer :: doublings = 0
   end type harmonics_options

end module fw_harmonics_options
