!> What a result file says of sectors and of natural frequencies.
module fw_cyclic_group
   use fw_cyclic_data, only: cyclic_type
   use fw_kinds, only: wp
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: mistuned_group, modes_group, write_cyclic

   !> Natural frequencies of the nodal diameters, NaN where there are fewer.
   type, extends(result_group) :: modes_group
      integer, allocatable :: nodal_diameter(:)
      !> Without contact, and with every pair closed (n_modes, n_diameters) [rad/s].
      real(wp), allocatable :: open(:, :), closed(:, :)
      !> Fractions of critical damping; not allocated where frequencies are undamped ones.
      real(wp), allocatable :: open_damping(:, :), closed_damping(:, :)
   contains
      procedure :: write => write_modes
   end type modes_group

   !> Natural frequencies of all sectors together.
   type, extends(result_group) :: mistuned_group
      !> (n_modes, 1) [rad/s].
      real(wp), allocatable :: open(:, :), closed(:, :)
      !> Share of each nodal diameter (n_diameters, n_modes).
      real(wp), allocatable :: open_content(:, :), closed_content(:, :)
   contains
      procedure :: write => write_mistuned
   end type mistuned_group

contains

   !> Sectors, engine order, and the signed nodal diameter of every harmonic; nothing of a structure
   !> that is not cyclic.
   subroutine write_cyclic(cyclic, has_points, n_harmonics, to)
      type(cyclic_type), intent(in) :: cyclic
      !> Whether the result is of waves.
      logical, intent(in) :: has_points
      integer, intent(in) :: n_harmonics
      type(group_writer), intent(inout) :: to
      integer :: h, k

      if (.not. cyclic%has_sectors()) return
      call to%note('/', 'n_sectors', cyclic%n_sectors)
      if (.not. has_points) return
      call to%note('/', 'engine_order', cyclic%engine_order)
      if (cyclic%is_mistuned) then
         call to%note('/', 'mistuned', 1)
         associate (n => cyclic%n_sectors)
            call to%put('/blades/nodal_diameter', [(k - 1 - (n - 1)/2, k=1, n)], '', 'wave', &
                        'signed nodal diameter of each wave')
         end associate
      end if
      call to%put('/cyclic/nodal_diameter', [(cyclic%nodal_diameter(h), h=0, n_harmonics)], '', &
                  'harmonic', 'signed nodal diameter of each harmonic')
   end subroutine write_cyclic

   subroutine write_modes(self, to)
      class(modes_group), intent(in) :: self
      type(group_writer), intent(inout) :: to

      call to%put('/modes/nodal_diameter', self%nodal_diameter, '', 'diameter', 'nodal diameter')
      call to%put('/modes/open', self%open, 'rad/s', 'diameter mode', &
                  'natural frequencies without contact')
      call to%put('/modes/closed', self%closed, 'rad/s', 'diameter mode', &
                  'natural frequencies with every pair closed')
      if (.not. allocated(self%open_damping)) return
      call to%put('/modes/open_damping', self%open_damping, '1', 'diameter mode', &
                  'damping of them, over the critical one')
      call to%put('/modes/closed_damping', self%closed_damping, '1', 'diameter mode', &
                  'damping of them, over the critical one')
   end subroutine write_modes

   subroutine write_mistuned(self, to)
      class(mistuned_group), intent(in) :: self
      type(group_writer), intent(inout) :: to
      integer :: k

      call to%put('/modes/nodal_diameter', [(k, k=0, size(self%open_content, 1) - 1)], '', &
                  'diameter', 'nodal diameter')
      call to%put('/modes/open', self%open, 'rad/s', 'disk mode', &
                  'natural frequencies of all sectors without contact')
      call to%put('/modes/closed', self%closed, 'rad/s', 'disk mode', &
                  'natural frequencies of all sectors with every pair closed')
      call to%put('/modes/open_content', self%open_content, '1', 'mode diameter', &
                  'share of each nodal diameter in the modes without contact')
      call to%put('/modes/closed_content', self%closed_content, '1', 'mode diameter', &
                  'share of each nodal diameter in the modes with every pair closed')
   end subroutine write_mistuned

end module fw_cyclic_group
