!> What a model says of sectors that differ (group /mistuning): rows of blade modes and how far the
!> frequency and the damping of each blade are off, stiffness and mass of a blade and how far these
!> are, and matrices of single sectors.
module fw_mistuning_parts
   use fw_kinds, only: wp
   use fw_part, only: by_columns, part, part_source
   implicit none (type, external)
   private

   public :: mistuning_parts, sector_parts

   !> Of one sector; a component is not allocated where it is tuned.
   type :: sector_parts
      real(wp), allocatable :: stiffness(:, :), mass(:, :), damping(:, :)
      !> 'deviation' (without it) or 'full'.
      character(:), allocatable :: kind
   end type sector_parts

   !> Parts of a model file by which sectors differ.
   type :: mistuning_parts
      !> Rows of blade modes (n_rows, n_dof), and their frequencies [rad/s].
      real(wp), allocatable :: rows(:, :), row_omega(:)
      !> Of frequencies, of damping ratios (n_rows, n_sectors).
      real(wp), allocatable :: frequency(:, :), damping_ratio(:, :)
      !> Of stiffness and mass of the blade (n_sectors).
      real(wp), allocatable :: stiffness(:), mass(:)
      !> Of the blade alone (n_dof, n_dof).
      real(wp), allocatable :: blade_stiffness(:, :), blade_mass(:, :)
      !> Of frequencies, each in place of `frequency` (n_rows, n_sectors, n_patterns).
      real(wp), allocatable :: patterns(:, :, :)
      !> Sector j at place j + 1.
      type(sector_parts), allocatable :: sector(:)
   contains
      procedure :: bind_parts
      procedure :: deviates
   end type mistuning_parts

   character(*), parameter :: of_sector = 'mistuning/sector/J'

contains

   subroutine bind_parts(self, n_sectors, to)
      class(mistuning_parts), intent(inout) :: self
      !> 0 of a model that is no sector.
      integer, intent(in) :: n_sectors
      class(part_source), intent(inout) :: to
      character(*), parameter :: square = 'dof dof', each = 'sector', all_rows = 'sector row'
      integer, allocatable :: numbers(:)
      integer :: i

      call to%set_extent('sector', max(1, n_sectors))
      if (allocated(self%rows)) call to%set_extent('row', size(self%rows, 1))
      call to%bind(part('mistuning/rows', 'row dof', 'blade modes: sqrt(2 energy) of each per '// &
                        'row_omega, for each dof'), self%rows)
      call to%bind(part('mistuning/row_omega', 'row', 'their frequencies, blade alone [rad/s]'), &
                   self%row_omega)
      call to%bind(part('mistuning/frequency', all_rows, 'by which part the frequency of '// &
                        'each blade is above the tuned one; one for all rows where it has no '// &
                        'second extent', storage=by_columns), self%frequency)
      call to%bind(part('mistuning/damping_ratio', all_rows, 'damping ratio of each blade '// &
                        'above the tuned one, likewise', storage=by_columns), self%damping_ratio)
      call to%bind(part('mistuning/stiffness', each, 'by which part blade_stiffness of each '// &
                        'sector is above the tuned one'), self%stiffness)
      call to%bind(part('mistuning/mass', each, 'likewise of blade_mass'), self%mass)
      call to%bind(part('mistuning/blade_stiffness', square, 'stiffness of the blade alone, '// &
                        'symmetric'), self%blade_stiffness)
      call to%bind(part('mistuning/blade_mass', square, 'mass of the blade alone, symmetric'), &
                   self%blade_mass)
      call to%bind(part('mistuning/patterns', 'pattern sector row', "patterns of analysis = "// &
                        "'population': each stands in place of frequency"), self%patterns)
      call to%numbers(part(of_sector, '', ''), 0, max(1, n_sectors) - 1, numbers)
      do i = 1, size(numbers)
         to%number = numbers(i)
         if (.not. allocated(self%sector)) allocate (self%sector(max(1, n_sectors)))
         associate (own => self%sector(numbers(i) + 1))
            call to%bind(part(of_sector//'/stiffness', square, 'of sector J from 0, symmetric'), &
                         own%stiffness)
            call to%bind(part(of_sector//'/mass', square, 'likewise'), own%mass)
            call to%bind(part(of_sector//'/damping', square, 'likewise'), own%damping)
            call to%bind(part(of_sector//'@kind', '', '"deviation" (without it): what is added '// &
                              'to the tuned ones; "full": in their place'), own%kind)
         end associate
      end do
   end subroutine bind_parts

   !> Whether any sector is said to differ: not by rows and matrices of the blade alone.
   pure logical function deviates(self)
      class(mistuning_parts), intent(in) :: self

      deviates = allocated(self%frequency) .or. allocated(self%damping_ratio) .or. &
                 allocated(self%stiffness) .or. allocated(self%mass) .or. allocated(self%sector)
   end function deviates

end module fw_mistuning_parts
