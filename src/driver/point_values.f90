!> The numbers of a solution point by the names of the datasets of a result file, laid out as a row
!> of the dataset: the last index of the documented shape runs fastest.
module fw_point_values
   use fw_error, only: error_type
   use fw_error, only: fatal_error
   use fw_error, only: status_usage
   use fw_kinds, only: wp
   use fw_point, only: point_type
   implicit none (type, external)
   private

   public :: get_point_values, value_names

   !> What can be asked for.
   character(*), parameter :: value_names(*) = &
      [character(29) :: 'omega', 'coefficients', 'amplitude', 'converged', 'iterations', &
       'residual', 'seconds', 'fold', 'contact/force', 'contact/fraction', &
       'contact/dissipation', 'history/observed', 'history/force', &
       'history/relative_displacement', 'floquet/multipliers', 'floquet/stable', &
       'wear/cycles', 'wear/depth', 'wear/rate']

contains

   !> The values of a name, flattened; a flag is 1 or 0.
   subroutine get_point_values(point, name, n_harmonics, values, error)
      type(point_type), intent(in) :: point
      character(*), intent(in) :: name
      !> Harmonics of the case: those that the point does not carry read as zero.
      integer, intent(in) :: n_harmonics
      real(wp), allocatable, intent(out) :: values(:)
      !> status_usage where there is no such name, or the point does not hold it.
      type(error_type), allocatable, intent(out) :: error
      integer :: n_coefficients

      n_coefficients = 2*n_harmonics + 1
      select case (name)
      case ('omega')
         values = [point%omega]
      case ('converged')
         values = [flag(point%converged)]
      case ('iterations')
         values = [real(point%iterations, wp)]
      case ('residual')
         values = [point%residual]
      case ('seconds')
         values = [point%seconds]
      case ('fold')
         values = [flag(point%fold)]
      case ('floquet/stable')
         if (allocated(point%multipliers)) values = [flag(point%stable)]
      case ('coefficients')
         if (allocated(point%coefficients)) call pad(flat_2(point%coefficients), &
            size(point%coefficients, 2)*n_coefficients, values)
      case ('amplitude')
         if (allocated(point%amplitude)) values = point%amplitude
      case ('contact/force')
         if (allocated(point%force)) call pad(flat_3(point%force), &
            3*size(point%force, 2)*n_coefficients, values)
      case ('contact/fraction')
         if (allocated(point%fraction)) then
            values = reshape(point%fraction, [size(point%fraction)])
         end if
      case ('contact/dissipation')
         if (allocated(point%dissipation)) values = point%dissipation
      case ('history/observed')
         if (allocated(point%history)) values = flat_2(point%history)
      case ('history/force')
         if (allocated(point%force_history)) values = flat_3(point%force_history)
      case ('history/relative_displacement')
         if (allocated(point%slip_history)) values = flat_3(point%slip_history)
      case ('floquet/multipliers')
         if (allocated(point%multipliers)) then
            values = reshape(transpose(reshape([real(point%multipliers, wp), &
                                                aimag(point%multipliers)], &
                                               [size(point%multipliers), 2])), &
                             [2*size(point%multipliers)])
         end if
      case ('wear/cycles')
         if (allocated(point%depth)) values = [point%cycles]
      case ('wear/depth')
         if (allocated(point%depth)) values = point%depth
      case ('wear/rate')
         if (allocated(point%wear_rate)) values = point%wear_rate
      case default
         call unknown_name(name, error)
         return
      end select
      if (allocated(values)) return
      call fatal_error(error, "the point holds no '"//name//"': histories need "// &
                       'output%histories = .true., contact values contact pairs and '// &
                       'output%contact = .true., Floquet multipliers sweep%stability = '// &
                       ".true., wear case%analysis = 'wear'", &
                       status_usage)
   end subroutine get_point_values

   !> Rows and columns exchanged: the second index runs fastest.
   pure function flat_2(array) result(flat)
      real(wp), intent(in) :: array(:, :)
      real(wp) :: flat(size(array))

      flat = reshape(transpose(array), [size(array)])
   end function flat_2

   pure function flat_3(array) result(flat)
      real(wp), intent(in) :: array(:, :, :)
      real(wp) :: flat(size(array))

      flat = reshape(array, [size(array)])
   end function flat_3

   subroutine pad(carried, n, values)
      real(wp), intent(in) :: carried(:)
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: values(:)

      allocate (values(max(n, size(carried))), source=0.0_wp)
      values(:size(carried)) = carried
   end subroutine pad

   pure real(wp) function flag(is_true)
      logical, intent(in) :: is_true

      flag = merge(1.0_wp, 0.0_wp, is_true)
   end function flag

   subroutine unknown_name(name, error)
      character(*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(:), allocatable :: list
      integer :: i

      list = trim(value_names(1))
      do i = 2, size(value_names)
         list = list//', '//trim(value_names(i))
      end do
      call fatal_error(error, "there is no result '"//name//"': must be one of "//list, &
                       status_usage)
   end subroutine unknown_name

end module fw_point_values
