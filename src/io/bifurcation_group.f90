!> Group /bifurcation of a result file: one row for every place where the response turns or its
!> stability changes.
module fw_bifurcation_group
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use fw_bifurcation, only: bifurcation_list, kind_words, way_words
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group, unknown_below
   implicit none (type, external)
   private

   public :: bifurcation_group

   type, extends(result_group) :: bifurcation_group
      type(bifurcation_list) :: list
      !> Of the case: those that a solution does not carry read as zero.
      integer :: n_harmonics = 0
      !> That of a sweep over another parameter [rad/s]; 0 where it is the frequency that changes.
      real(wp) :: omega = 0.0_wp
   contains
      procedure :: write => write_bifurcations
   end type bifurcation_group

contains

   subroutine write_bifurcations(self, to)
      class(bifurcation_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      real(wp), allocatable :: coefficients(:, :, :), multiplier(:, :), amplitude(:, :)
      real(wp), allocatable :: place(:), width(:)
      integer :: k, n, n_observed

      associate (item => self%list%item, n_items => self%list%n)
         if (n_items == 0) return
         n_observed = size(item(1)%amplitude)
         n = 2*self%n_harmonics + 1
         do k = 1, n_items
            n = max(n, size(item(k)%coefficients, 1))
         end do
         ! Shapes are those of h5py reversed.
         allocate (coefficients(n_observed, n, n_items), source=0.0_wp)
         allocate (multiplier(2, n_items), amplitude(n_observed, n_items))
         do k = 1, n_items
            amplitude(:, k) = item(k)%amplitude
            coefficients(:, :size(item(k)%coefficients, 1), k) = transpose(item(k)%coefficients)
            multiplier(:, k) = [real(item(k)%multiplier, wp), aimag(item(k)%multiplier)]
            if (abs(item(k)%multiplier) <= 0.0_wp) multiplier(:, k) = ieee_value(1.0_wp, &
               ieee_quiet_nan)
         end do
         place = item(:n_items)%place
         width = unknown_below(item(:n_items)%error)
         if (self%omega > 0.0_wp) then
            call to%put('/bifurcation/parameter', place, '', 'bifurcation', &
                        'value of the parameter')
            call to%put('/bifurcation/parameter_error', width, '', 'bifurcation', &
                        'estimated error of the parameter')
            ! The frequency is what it is.
            place = self%omega
            width = 0.0_wp
         end if
         call to%put('/bifurcation/omega', place, 'rad/s', 'bifurcation', &
                     'angular frequency of the place')
         call to%put('/bifurcation/error', width, 'rad/s', 'bifurcation', &
                     'estimated error of the frequency')
         call to%put('/bifurcation/amplitude', amplitude, '<length>', 'bifurcation observed', &
                     'largest magnitude over the period')
         call to%put('/bifurcation/coefficients', coefficients, '<length>', &
                     'bifurcation coefficient observed', &
                     'Fourier coefficients 0, c1, s1, ... of observed quantities')
         call to%put('/bifurcation/multiplier', multiplier, '1', 'bifurcation part', &
                     'the multiplier on the unit circle, real and imaginary')
         call to%put_places('/bifurcation/kind', [item(:n_items)%kind], kind_words, &
                            'bifurcation', 'what happens there, an index into names')
         call to%put_places('/bifurcation/found_by', [item(:n_items)%found_by], way_words, &
                            'bifurcation', 'how it was found, an index into names')
      end associate
   end subroutine write_bifurcations

end module fw_bifurcation_group
