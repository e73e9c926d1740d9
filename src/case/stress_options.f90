!> Stress at points of the structure (group &stress): which rows give it, what stands there without
!> motion, what the points endure, and how a cycle is judged.
module fw_stress_options
   use fw_key, only: key, key_visitor
   use fw_key_range, only: above
   use fw_kinds, only: wp
   use fw_stress_cycle, only: by_range, diagram_words, goodman, method_words
   use fw_stress_parts, only: stress_parts
   implicit none (type, external)
   private

   public :: stress_options

   character(*), parameter :: output_words(*) = [character(6) :: 'points', 'tensor', 'none']
   integer, parameter :: of_points = 1, of_tensor = 2, of_nothing = 3

   !> Which stress is found, and the limits of endurance that it is held against.
   type :: stress_options
      integer :: n_points = 0
      !> Six components after one another, point by point (6 n_points, n_dof) [force/length**3].
      real(wp), allocatable :: rows(:, :)
      !> Where the base moves by 1 with what it carries (6 n_points); not allocated where none does.
      real(wp), allocatable :: of_base(:)
      !> Without motion, and for each (rad/s)**2 of the rotation speed (6, n_points)
      !> [force/length**2].
      real(wp), allocatable :: static(:, :), static_rotation(:, :)
      !> Not allocated where neither the case nor the model gives them (n_points).
      real(wp), allocatable :: endurance(:), ultimate(:)
      integer :: method = by_range, diagram = goodman
      integer, private :: output = of_points
      !> Rotation speed of the case [rad/s].
      real(wp) :: rotation_speed = 0.0_wp
   contains
      procedure :: bind_keys
      procedure :: take
      procedure :: ride
      procedure :: is_wanted
      procedure :: writes_tensor
      procedure :: is_judged
      procedure :: asks_for_rows
      procedure :: fits
   end type stress_options

contains

   !> The keys of group &stress, behind what the model says.
   subroutine bind_keys(self, keys)
      class(stress_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      character(*), parameter :: of_model = 'of the file, else no utilisation'

      call keys%open('stress', 'stress and endurance of a cycle, of models with /stress')
      ! Where there are no points one value is told to be of none.
      call keys%set_size('n_stress', max(1, self%n_points))
      call keys%bind_word(key('method', &
                              'by the largest von Mises stress between two instants, or with '// &
                              'the sign of its trace'), self%method, method_words)
      call keys%bind_word(key('diagram', 'how amplitude and mean count together'), &
                          self%diagram, diagram_words)
      call keys%bind(key('endurance', 'alternating stress endured', above(0.0_wp), 'F/L^2', &
                         'n_stress', absent=of_model), self%endurance)
      call keys%bind(key('ultimate', 'static strength', above(0.0_wp), 'F/L^2', 'n_stress', &
                         absent=of_model), self%ultimate)
      call keys%bind_word(key('output', &
                              'amplitude, mean, utilisation; Fourier coefficients too; nothing'), &
                          self%output, output_words)
   end subroutine bind_keys

   !> Take what the model says.
   subroutine take(self, parts, rotation_speed)
      class(stress_options), intent(inout) :: self
      type(stress_parts), intent(in) :: parts
      real(wp), intent(in) :: rotation_speed
      integer :: i

      self%rotation_speed = rotation_speed
      if (.not. allocated(parts%matrix)) return
      self%n_points = size(parts%matrix, 3)
      allocate (self%rows(6*self%n_points, size(parts%matrix, 1)))
      do i = 1, self%n_points
         self%rows(6*i - 5:6*i, :) = transpose(parts%matrix(:, :, i))
      end do
      if (allocated(parts%static)) self%static = parts%static
      if (allocated(parts%static_rotation)) self%static_rotation = parts%static_rotation
      if (allocated(parts%endurance)) self%endurance = parts%endurance
      if (allocated(parts%ultimate)) self%ultimate = parts%ultimate
   end subroutine take

   !> Rows of the motion beside a base, whose supports stay where they are, and what it adds itself.
   pure subroutine ride(self, dof, carried)
      class(stress_options), intent(inout) :: self
      !> Supports, and what moves with them (n_dof).
      integer, intent(in) :: dof(:)
      real(wp), intent(in) :: carried(:)

      if (.not. allocated(self%rows)) return
      self%of_base = matmul(self%rows, carried)
      self%rows(:, abs(dof)) = 0.0_wp
   end subroutine ride

   !> Whether there is any stress to find.
   pure logical function is_wanted(self)
      class(stress_options), intent(in) :: self

      is_wanted = self%n_points > 0 .and. self%output /= of_nothing
   end function is_wanted

   !> Whether something else than the defaults is given, which stand in every case that is written.
   pure logical function asks_for_rows(self)
      class(stress_options), intent(in) :: self

      asks_for_rows = self%method /= by_range .or. self%diagram /= goodman .or. &
                      self%output == of_tensor .or. allocated(self%endurance) .or. &
                      allocated(self%ultimate)
   end function asks_for_rows

   !> Whether everything is of as many points.
   pure logical function fits(self)
      class(stress_options), intent(in) :: self

      fits = .true.
      if (allocated(self%static)) fits = size(self%static, 2) == self%n_points
      if (allocated(self%static_rotation)) fits = fits .and. size(self%static_rotation, 2) == &
                                                  self%n_points
      if (allocated(self%endurance)) fits = fits .and. size(self%endurance) == self%n_points
      if (allocated(self%ultimate)) fits = fits .and. size(self%ultimate) == self%n_points
   end function fits

   pure logical function writes_tensor(self)
      class(stress_options), intent(in) :: self

      writes_tensor = self%is_wanted() .and. self%output == of_tensor
   end function writes_tensor

   !> Whether points have strengths to be compared with.
   pure logical function is_judged(self)
      class(stress_options), intent(in) :: self

      is_judged = self%is_wanted() .and. allocated(self%endurance) .and. allocated(self%ultimate)
   end function is_judged

end module fw_stress_options
