!> A linear structure: M u'' + C u' + K u = f_0 + f_c cos(omega t) + f_s sin(omega t), with the
!> quantities that are observed of it. Read-only once built; may be shared between threads.
module fw_model
   use fw_closed_joint, only: closed_joint
   use fw_cyclic_data, only: cyclic_type
   use fw_kinds, only: wp
   use fw_load_waves, only: load_waves
   use fw_speed_growth, only: even_powers
   use fw_text, only: string_type
   implicit none (type, external)
   private

   public :: model_type, matrix_change

   !> Derivative of the structure by a parameter of fw_parameters, at the values of the case.
   type :: matrix_change
      !> Which parameter.
      integer :: parameter = 0
      !> Of stiffness, damping and mass (n_dof, n_dof), and of the static load (n_dof); that of the
      !> mass is not allocated where the parameter changes none.
      real(wp), allocatable :: stiffness(:, :), damping(:, :), mass(:, :), load_static(:)
      !> The parameter in the case.
      real(wp) :: value = 0.0_wp
      !> Whether the change of the stiffness is one of hysteretic damping, i times it above harmonic
      !> 0.
      logical :: is_loss = .false.
   end type matrix_change

   !> The matrices, loads and observed quantities of a structure.
   type :: model_type
      integer :: n_dof = 0
      !> Mass, stiffness and viscous damping (n_dof, n_dof), symmetric. Effective values: the
      !> terms of rotation and of Rayleigh and modal damping are in them.
      real(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :)
      !> Loads, scaled (n_dof) [force].
      real(wp), allocatable :: load_static(:), load_cosine(:), load_sine(:)
      !> Observed quantities: rows of linear combinations of the dofs (n_observed, n_dof).
      real(wp), allocatable :: observe_matrix(:, :)
      type(string_type), allocatable :: observe_name(:)
      !> Displacements that are combinations of dofs, which sides may name by numbers beyond n_dof
      !> (n_dof, n_rows); not allocated where there are none.
      real(wp), allocatable :: rows(:, :)
      !> Sectors around an axis, of which the matrices are one.
      type(cyclic_type) :: cyclic
      !> The closed joint with which modal damping takes its modes; not allocated where they are
      !> those with open contact.
      type(closed_joint), allocatable :: damped_joint
      !> Names of the units, 'length-mass-time-force', for labels; not allocated if not known.
      character(:), allocatable :: unit_system
      !> Hysteretic damping, i times this part of the stiffness in harmonics above 0; of sectors it
      !> is in `cyclic`.
      real(wp) :: loss_factor = 0.0_wp
      !> Whether something of it depends on the rotation speed.
      logical :: rotates = .false.
      !> The same, forces across the motion included.
      logical :: turns = .false.
      !> What parameters change, of those that were asked for; not allocated where none was.
      type(matrix_change), allocatable :: changes(:)
      !> Loads beside those of the first harmonic: what they are, and their cosine and sine parts
      !> (n_dof, 2 n_waves).
      type(load_waves) :: waves
      real(wp), allocatable :: load_wave(:, :)
      !> Factors that are in the vibratory and in the static loads.
      real(wp) :: harmonic_scale = 1.0_wp, static_scale = 1.0_wp
      !> Motion of the base, without these factors: its waves, a constant, and cosine and sine parts
      !> (1 + 2 n_waves); not allocated where no base moves.
      type(load_waves) :: base_waves
      real(wp), allocatable :: base_parts(:)
   contains
      procedure :: motion_of_base
      procedure :: load_columns
      procedure :: at_frequency
      procedure :: n_observed
   end type model_type

contains

   !> Static, cosine and sine loads, then those of the waves (n_dof, 3 + 2 n_waves).
   pure function load_columns(self) result(columns)
      class(model_type), intent(in) :: self
      real(wp), allocatable :: columns(:, :)

      columns = self%waves%with_columns(self%load_static, self%load_cosine, self%load_sine, &
                                        self%load_wave)
   end function load_columns

   !> The matrices at the speed that follows a frequency [rad/s].
   pure function at_frequency(self, omega) result(model)
      class(model_type), intent(in) :: self
      real(wp), intent(in) :: omega
      type(model_type) :: model
      real(wp), allocatable :: grown(:, :)
      real(wp) :: rate

      model = self
      if (.not. allocated(self%cyclic%speed)) return
      associate (speed => self%cyclic%speed)
         rate = omega/speed%order
         if (allocated(speed%growth%stiffness)) then
            ! Once: damping and hysteretic damping are in proportion to it.
            grown = 0.0_wp*model%stiffness
            call speed%growth%add_stiffness(even_powers(rate, speed%growth%n_powers()), grown)
            model%stiffness = model%stiffness + grown
            if (speed%rayleigh > 0.0_wp) model%damping = model%damping + speed%rayleigh*grown
            if (speed%loss > 0.0_wp) call add(grown, speed%loss, model%cyclic%structural)
         end if
         call add(speed%coriolis, rate, model%cyclic%coriolis)
         if (.not. allocated(speed%circulatory)) return
         model%stiffness = model%stiffness + 0.5_wp*rate* &
                           (speed%circulatory + transpose(speed%circulatory))
         call add(0.5_wp*(speed%circulatory - transpose(speed%circulatory)), rate, &
                  model%cyclic%circulatory)
      end associate
   end function at_frequency

   !> total = total + factor matrix, of either of which none may be there.
   pure subroutine add(matrix, factor, total)
      real(wp), intent(in), optional :: matrix(:, :)
      real(wp), intent(in) :: factor
      real(wp), allocatable, intent(inout) :: total(:, :)

      if (.not. present(matrix)) return
      if (allocated(total)) then
         total = total + factor*matrix
      else
         total = factor*matrix
      end if
   end subroutine add

   !> Displacement of the base (0, c1, s1, ..) (2H+1) [length].
   pure function motion_of_base(self, omega, scale, n_harmonics) result(coefficients)
      class(model_type), intent(in) :: self
      !> [rad/s]
      real(wp), intent(in) :: omega
      !> Factor of the vibration.
      real(wp), intent(in) :: scale
      integer, intent(in) :: n_harmonics
      real(wp) :: coefficients(2*n_harmonics + 1)
      integer :: n, w

      coefficients = 0.0_wp
      coefficients(1) = self%static_scale*self%base_parts(1)
      do w = 1, self%base_waves%n_waves()
         n = self%base_waves%harmonic(w)
         if (n > n_harmonics) cycle
         coefficients(2*n:2*n + 1) = coefficients(2*n:2*n + 1) + scale* &
            self%base_waves%factor(w, n, n*omega)*self%base_parts(2*w:2*w + 1)
      end do
   end function motion_of_base

   !> Observed quantities of all sectors that are solved for.
   pure integer function n_observed(self)
      class(model_type), intent(in) :: self

      n_observed = 0
      if (.not. allocated(self%observe_matrix)) return
      n_observed = self%cyclic%n_solved()*size(self%observe_matrix, 1)
   end function n_observed

end module fw_model
