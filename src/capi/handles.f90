!> Sessions behind numbers, for languages that cannot hold a Fortran object. A number is never
!> given twice in a process, so that a handle that is stale, or was never one, is recognised.
!>
!> The list is the one piece of state that sessions share; it is touched under a lock only.
module fw_handles
   use fw_callbacks, only: callback_observer
   use fw_error, only: error_type, status_failure, status_ok, status_usage
   use fw_floating_point, only: floating_point_scope
   use fw_session, only: session_type
   implicit none (type, external)
   private

   public :: handle_type, new_handle, find_handle, delete_handle, enter, leave, ask_to_stop

   type :: handle_type
      !> Number of the session, from 1.
      integer :: id = 0
      !> A call that may change the session is under way.
      logical :: busy = .false.
      class(session_type), allocatable :: session
      type(callback_observer) :: observer
      !> What the last call that failed had to say.
      character(:), allocatable :: message
      !> What the caller has set of the floating-point unit.
      type(floating_point_scope), private :: floating_point
   end type handle_type

   type :: slot_type
      !> Null where the slot is free.
      type(handle_type), pointer :: handle => null()
   end type slot_type

   type(slot_type), allocatable :: slots(:)
   integer :: last_id = 0

contains

   !> A new session.
   integer function new_handle(id) result(status)
      integer, intent(out) :: id
      class(handle_type), pointer :: handle
      integer :: i, problem

      id = 0
      status = status_failure
      allocate (handle, stat=problem)
      if (problem /= 0) return
      allocate (handle%session)
      handle%message = ''
      !$omp critical (fretwear_handles)
      ! Numbers are never given twice, so that they may run out.
      if (last_id < huge(last_id)) then
         last_id = last_id + 1
         id = last_id
         i = free_slot()
         slots(i)%handle => handle
      end if
      !$omp end critical (fretwear_handles)
      if (id == 0) then
         deallocate (handle)
         return
      end if
      handle%id = id
      handle%observer%handle = id
      status = status_ok
   end function new_handle

   !> The session of a number; null where there is none.
   subroutine find_handle(id, handle)
      integer, intent(in) :: id
      type(handle_type), pointer, intent(out) :: handle
      integer :: i

      nullify (handle)
      !$omp critical (fretwear_handles)
      i = slot_of(id)
      if (i > 0) handle => slots(i)%handle
      !$omp end critical (fretwear_handles)
   end subroutine find_handle

   !> Give a session up; refused while a call is at work on it.
   integer function delete_handle(id) result(status)
      integer, intent(in) :: id
      class(handle_type), pointer :: handle
      integer :: i

      nullify (handle)
      !$omp critical (fretwear_handles)
      i = slot_of(id)
      if (i > 0) then
         if (.not. slots(i)%handle%busy) then
            handle => slots(i)%handle
            nullify (slots(i)%handle)
         end if
      end if
      !$omp end critical (fretwear_handles)
      status = status_usage
      ! Outside of the lock: to free a system takes its time.
      if (.not. associated(handle)) return
      deallocate (handle)
      status = status_ok
   end function delete_handle

   !> Begin a call that may change a session: one at a time, outside of the traps of the caller.
   !> Null where the number is none, or its session is at work in a call that is not yet over.
   subroutine enter(id, handle)
      integer, intent(in) :: id
      type(handle_type), pointer, intent(out) :: handle
      integer :: i

      nullify (handle)
      !$omp critical (fretwear_handles)
      i = slot_of(id)
      if (i > 0) then
         if (.not. slots(i)%handle%busy) then
            handle => slots(i)%handle
            handle%busy = .true.
            handle%observer%asked_to_stop = .false.
         end if
      end if
      !$omp end critical (fretwear_handles)
      if (.not. associated(handle)) return
      ! What the call before had to say is over.
      handle%message = ''
      call handle%floating_point%enter()
   end subroutine enter

   !> Ask the call at work on a session to end, from any thread; refused where there is none.
   integer function ask_to_stop(id) result(status)
      integer, intent(in) :: id
      integer :: i

      status = status_usage
      !$omp critical (fretwear_handles)
      i = slot_of(id)
      if (i > 0) then
         if (slots(i)%handle%busy) then
            !$omp atomic write
            slots(i)%handle%observer%asked_to_stop = .true.
            status = status_ok
         end if
      end if
      !$omp end critical (fretwear_handles)
   end function ask_to_stop

   !> End a call: keep the message of an error and return its status.
   integer function leave(handle, error) result(status)
      type(handle_type), pointer, intent(in) :: handle
      type(error_type), allocatable, intent(in) :: error

      status = status_ok
      if (allocated(error)) then
         status = error%status
         handle%message = error%message
      end if
      call handle%floating_point%leave()
      !$omp critical (fretwear_handles)
      handle%busy = .false.
      !$omp end critical (fretwear_handles)
   end function leave

   !> A slot that is not taken.
   integer function free_slot() result(i)
      type(slot_type), allocatable :: longer(:)

      if (.not. allocated(slots)) allocate (slots(0))
      do i = 1, size(slots)
         if (.not. associated(slots(i)%handle)) return
      end do
      i = size(slots) + 1
      allocate (longer(2*i))
      longer(:size(slots)) = slots
      call move_alloc(longer, slots)
   end function free_slot

   !> Where the session of a number is kept, 0 for none.
   integer function slot_of(id) result(i)
      integer, intent(in) :: id

      if (allocated(slots)) then
         do i = 1, size(slots)
            if (.not. associated(slots(i)%handle)) cycle
            if (slots(i)%handle%id == id) return
         end do
      end if
      i = 0
   end function slot_of

end module fw_handles
