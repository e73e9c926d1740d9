!> How progress leaves a run: the driver calls an observer and writes nothing itself. And how a
!> run is stopped from outside: what was computed until then is kept.
module fw_observer
   use fw_interrupt, only: interrupt_type
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: observer_type, silent_observer

   !> Any callback may set `stop_requested` to end the run; what asks for the end at other times
   !> is seen by `poll`.
   type, abstract, extends(interrupt_type) :: observer_type
   contains
      !> Before the first point.
      procedure(start_callback), deferred :: on_start
      !> After every point, converged or not.
      procedure(point_callback), deferred :: on_point
      !> Something worth knowing: a fallback taken, work skipped.
      procedure(message_callback), deferred :: on_message
      !> After the last point, also of a run that ends early.
      procedure(end_callback), deferred :: on_end
   end type observer_type

   !> An observer that does nothing.
   type, extends(observer_type) :: silent_observer
   contains
      procedure :: on_start
      procedure :: on_point
      procedure :: on_message
      procedure :: on_end
   end type silent_observer

   abstract interface
      subroutine start_callback(self, case_title, n_points)
         import :: observer_type
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
         character(*), intent(in) :: case_title
         !> Points to come (0: not known).
         integer, intent(in) :: n_points
      end subroutine start_callback

      subroutine point_callback(self, index, n_points, point)
         import :: observer_type, point_type
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
         !> Number of the point, from 1.
         integer, intent(in) :: index
         integer, intent(in) :: n_points
         type(point_type), intent(in) :: point
      end subroutine point_callback

      subroutine message_callback(self, text)
         import :: observer_type
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
         character(*), intent(in) :: text
      end subroutine message_callback

      subroutine end_callback(self)
         import :: observer_type
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
      end subroutine end_callback
   end interface

contains

   !> Before the first point.
   subroutine on_start(self, case_title, n_points)
      class(silent_observer), intent(inout) :: self
      character(*), intent(in) :: case_title
      integer, intent(in) :: n_points

      associate (unused => self, unused_title => case_title, unused_number => n_points)
      end associate
   end subroutine on_start

   !> Behind each point, once it is written.
   subroutine on_point(self, index, n_points, point)
      class(silent_observer), intent(inout) :: self
      integer, intent(in) :: index, n_points
      type(point_type), intent(in) :: point

      associate (unused => self, unused_index => index, unused_number => n_points, &
                 unused_point => point)
      end associate
   end subroutine on_point

   !> What is worth telling while a run is at work.
   subroutine on_message(self, text)
      class(silent_observer), intent(inout) :: self
      character(*), intent(in) :: text

      associate (unused => self, unused_text => text)
      end associate
   end subroutine on_message

   !> Behind the last point, whatever ended the run.
   subroutine on_end(self)
      class(silent_observer), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine on_end

end module fw_observer
