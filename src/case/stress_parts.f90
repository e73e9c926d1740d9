!> What a model says of its stress (group /stress): rows for each of the six components at a number
!> of points, what stands there without motion, and what the points endure.
module fw_stress_parts
   use fw_kinds, only: wp
   use fw_part, only: by_columns, part, part_source
   implicit none (type, external)
   private

   public :: stress_parts

   !> Rows of the stress, and where its points are.
   type :: stress_parts
      !> Stress xx, yy, zz, xy, yz, zx per dof (n_dof, 6, n_points) [force/length**3]; of matrices
      !> of nodal diameters it stands with these.
      real(wp), allocatable :: matrix(:, :, :)
      !> Without motion, and for each (rad/s)**2 of the rotation speed (6, n_points)
      !> [force/length**2].
      real(wp), allocatable :: static(:, :), static_rotation(:, :)
      !> Alternating stress that is endured without mean, and static strength (n_points)
      !> [force/length**2].
      real(wp), allocatable :: endurance(:), ultimate(:)
      integer :: n_points = 0
   contains
      procedure :: bind_parts
   end type stress_parts

contains

   subroutine bind_parts(self, to)
      class(stress_parts), intent(inout) :: self
      class(part_source), intent(inout) :: to
      character(*), parameter :: each = 'one_or stress'

      call to%bind(part('stress/matrix', 'stress 6 dof', 'stress xx, yy, zz, xy, yz, zx at '// &
                        'points, for each dof'), self%matrix)
      call to%bind(part('stress/static', 'stress 6', 'without motion', storage=by_columns), &
                   self%static)
      call to%bind(part('stress/static_rotation', 'stress 6', 'for each (rad/s)^2 of '// &
                        'model%rotation_speed', storage=by_columns), self%static_rotation)
      call to%bind(part('stress/endurance', each, 'alternating stress that is endured'), &
                   self%endurance)
      call to%bind(part('stress/ultimate', each, 'static strength'), self%ultimate)
      call to%note('real', part('stress/position', 'stress 3', 'coordinates, for pictures'))
      call to%note('integer', part('stress/mesh_point', 'stress', 'points of /mesh, for '// &
                                   'fretwear export'))
      self%n_points = max(0, to%extent_of('stress'))
   end subroutine bind_parts

end module fw_stress_parts
