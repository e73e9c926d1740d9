!> What group /wear of a result file says besides the rows of the steps, which are quantities of the
!> points.
module fw_wear_group
   use fw_contact_data, only: contact_type
   use fw_kinds, only: wp
   use fw_patches, only: number_patches
   use fw_result_group, only: group_writer, result_group
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: wear_halved, wear_outcome, wear_patches

   !> Names of the patches, and what the cycles are counted in.
   type, extends(result_group) :: wear_patches
      type(contact_type), pointer :: contact => null()
      !> 'cycles', or what stands for them.
      character(:), allocatable :: cycles_units
   contains
      procedure :: write => write_patches
   end type wear_patches

   !> The profile that the same run has with steps of half the size, and how far it is from this
   !> one.
   type, extends(result_group) :: wear_halved
      !> (n_pairs) [length].
      real(wp), allocatable :: depth(:)
      !> Largest difference, as a part of the largest depth.
      real(wp) :: change = 0.0_wp
   contains
      procedure :: write => write_halved
   end type wear_halved

   !> Whether a steady state was reached, on the group and at the root of the file.
   type, extends(result_group) :: wear_outcome
      !> 'reached', 'not reached' or 'none: gross slip', and in words how the run ended.
      character(:), allocatable :: steady_state, ending
      !> Steps that were left to the implicit scheme, leaps, jumps of the vibration (3), where the
      !> run has come to its end.
      integer, allocatable :: counts(:)
   contains
      procedure :: write => write_outcome
   end type wear_outcome

contains

   subroutine write_patches(self, to)
      class(wear_patches), intent(in) :: self
      type(group_writer), intent(inout) :: to
      type(string_type), allocatable :: patches(:)
      integer, allocatable :: patch_of(:)

      call number_patches(self%contact, patches, patch_of)
      call to%put('/wear/patch', patches)
      call to%note('/wear/cycles', 'units', self%cycles_units)
   end subroutine write_patches

   subroutine write_halved(self, to)
      class(wear_halved), intent(in) :: self
      type(group_writer), intent(inout) :: to

      call to%put('/wear/depth_halved', self%depth, '<length>', 'pair', &
                  'final wear depth with steps of half the size')
      call to%note('/wear', 'profile_change', self%change)
   end subroutine write_halved

   subroutine write_outcome(self, to)
      class(wear_outcome), intent(in) :: self
      type(group_writer), intent(inout) :: to

      call to%note('/wear', 'steady_state', self%steady_state)
      call to%note('/wear', 'ending', self%ending)
      call to%note('/', 'steady_state', self%steady_state)
      if (.not. allocated(self%counts)) return
      call to%note('/wear', 'n_implicit', self%counts(1))
      call to%note('/wear', 'n_leaps', self%counts(2))
      call to%note('/wear', 'n_jumps', self%counts(3))
   end subroutine write_outcome

end module fw_wear_group
