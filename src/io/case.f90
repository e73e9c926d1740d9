!> A case: everything that one run needs, validated. Composed of the option types of the layers
!> that use them; see each for its defaults.
module fw_case
   use fw_kinds, only: wp
   use fw_model, only: model_type
   use fw_contact_data, only: contact_type, spring_type
   use fw_harmonics_options, only: harmonics_options
   use fw_solver_options, only: solver_options, pseudo_time_options, sweep_options
   use fw_text, only: string_type
   use fw_wear_options, only: wear_options
   use fw_time_options, only: time_options
   implicit none (type, external)
   private

   public :: case_type, output_options
   public :: analysis_words, analysis_frf, analysis_point, analysis_wear, analysis_time

   character(*), parameter :: analysis_words(*) = [character(5) :: 'frf', 'point', 'wear', 'time']
   integer, parameter :: analysis_frf = 1, analysis_point = 2, analysis_wear = 3, analysis_time = 4

   !> What is written (group &output).
   type :: output_options
      !> Path of the result file.
      character(:), allocatable :: file
      !> The input names the file; otherwise it has the name of the namelist.
      logical :: names_file = .false.
      !> Write one period of every observed quantity.
      logical :: histories = .false.
      !> Write the contact forces, states and dissipation.
      logical :: contact = .true.
   end type output_options

   type :: case_type
      character(:), allocatable :: title
      integer :: analysis = analysis_frf
      !> OpenMP threads (0: all).
      integer :: threads = 0
      type(model_type) :: model
      type(contact_type) :: contact
      type(spring_type) :: springs
      type(harmonics_options) :: harmonics
      type(sweep_options) :: sweep
      type(solver_options) :: solver
      type(pseudo_time_options) :: pseudo_time
      type(wear_options) :: wear
      type(time_options) :: time
      type(output_options) :: output
      !> The effective input, as a namelist.
      character(:), allocatable :: namelist
      !> Absolute paths of the files it was read from: no result replaces them.
      type(string_type), allocatable :: inputs(:)
      !> Result file of a wear run that is to be continued; not allocated to start anew. No key of
      !> the namelist.
      character(:), allocatable :: restart
   end type case_type

end module fw_case
