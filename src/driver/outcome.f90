!> What a run leaves besides its result file.
module fw_outcome
   use fw_error, only: status_ok
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: outcome_type

   type :: outcome_type
      !> status_ok, status_not_converged, or status_stopped where the observer ended the run.
      integer :: status = status_ok
      !> Its time was over (case%max_seconds).
      logical :: out_of_time = .false.
      !> A short table for people, one line each.
      type(string_type), allocatable :: summary(:)
   end type outcome_type

end module fw_outcome
