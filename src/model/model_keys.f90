!> The keys of groups &model and &load.
module fw_model_keys
   use fw_key, only: key, key_type, key_visitor
   use fw_key_range, only: at_least, from_to
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: model_options
   public :: source_words, source_inline, source_hdf5, source_matrix_market, source_memory
   public :: damping_of_stuck
   public :: bind_order, bind_matrices, bind_n_rows, bind_rows, bind_loads, bind_table

   character(*), parameter :: source_words(*) = &
      [character(13) :: 'inline', 'hdf5', 'matrix_market', 'memory']
   integer, parameter :: source_inline = 1, source_hdf5 = 2, source_matrix_market = 3, &
                         source_memory = 4

   !> Of which modes the modal damping is.
   character(*), parameter :: damping_words(*) = [character(5) :: 'open', 'stuck']
   integer, parameter :: damping_of_open = 1, damping_of_stuck = 2

   !> More dofs are taken for a mistake: the matrices are dense.
   integer, parameter :: largest = 100000

   !> Keys that act once all is read.
   type :: model_options
      integer :: source = source_inline
      character(:), allocatable :: file
      !> Units of the model, such as 'mm-tonne-s-N'.
      character(:), allocatable :: unit_system
      !> Factors of the mass [1/s] and of the stiffness [s] in the damping.
      real(wp) :: rayleigh_mass = 0.0_wp
      real(wp) :: rayleigh_stiffness = 0.0_wp
      !> Fraction of critical damping of every mode.
      real(wp) :: modal_damping = 0.0_wp
      integer :: modal_damping_of = damping_of_open
      !> Highest frequency of the modes that are damped so [Hz] (0: all are).
      real(wp) :: modal_damping_up_to = 0.0_wp
      !> [rad/s]
      real(wp) :: rotation_speed = 0.0_wp
      !> Hysteretic damping in parts of the stiffness.
      real(wp) :: loss_factor = 0.0_wp
      !> Frequency over the rotation speed, where this follows it (&sweep speed_order).
      real(wp) :: speed_order = 0.0_wp
      !> Factors of the static and of the vibratory load.
      real(wp) :: static_scale = 1.0_wp
      real(wp) :: harmonic_scale = 1.0_wp
   contains
      procedure :: bind_source
      procedure :: bind_file
      procedure :: bind_additions
      procedure :: bind_scales
   end type model_options

contains

   !> Asked first: where the matrices are decides which of the keys below are needed.
   subroutine bind_source(self, keys)
      class(model_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%open('model', 'mass, stiffness and damping, inline or from a file')
      call keys%bind_word(key('source', &
                              "where the matrices are; 'memory': in the calling program"), &
                          self%source, source_words)
   end subroutine bind_source

   subroutine bind_file(self, keys)
      class(model_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%bind(key('file', 'model file, relative to the namelist', &
                         absent='required unless inline'), self%file, &
                     needed=any(self%source == [source_hdf5, source_matrix_market]))
      call keys%bind(key('unit_system', &
                         "length, mass, time, force, as 'mm-tonne-s-N': of values with "// &
                         ""// 'units, and results', absent='of the file'), self%unit_system)
   end subroutine bind_file

   subroutine bind_order(keys, n_dof, is_inline)
      class(key_visitor), intent(inout) :: keys
      integer, intent(inout) :: n_dof
      logical, intent(in) :: is_inline

      call keys%bind(key('n_dof', 'order of the matrices', from_to(1, largest), &
                         absent='required inline'), n_dof, needed=is_inline)
      ! Shapes of later keys name it.
      call keys%set_size('n_dof', n_dof)
   end subroutine bind_order

   !> The matrices (n_dof, n_dof), each left unallocated where it is not given.
   subroutine bind_matrices(keys, is_inline, mass, stiffness, damping, structural, circulatory, &
                            stiffness_unsymmetric, damping_unsymmetric)
      class(key_visitor), intent(inout) :: keys
      logical, intent(in) :: is_inline
      real(wp), allocatable, intent(inout) :: mass(:, :), stiffness(:, :), damping(:, :)
      real(wp), allocatable, intent(inout) :: structural(:, :), circulatory(:, :)
      real(wp), allocatable, intent(inout) :: stiffness_unsymmetric(:, :), &
         damping_unsymmetric(:, :)
      character(*), parameter :: shape = 'n_dof x n_dof'

      call keys%bind(key('mass', 'symmetric, no negative diagonal; may be singular', unit='M', &
                         shape=shape, repeats=.false., absent='required inline'), mass, is_inline)
      call keys%bind(key('stiffness', 'symmetric; may be singular where contact holds', &
                         unit='F/L', shape=shape, repeats=.false., absent='required inline'), &
                     stiffness, is_inline)
      call keys%bind(key('damping', 'symmetric', unit='F s/L', shape=shape, repeats=.false., &
                         absent='0'), damping)
      call keys%bind(key('structural_damping', &
                         'hysteretic, symmetric: i times it in harmonics above 0', unit='F/L', &
                         shape=shape, repeats=.false., absent='0'), structural)
      call keys%bind(key('circulatory', &
                         'stiffness for each rad/s of rotation_speed: (i, j) is the force on '// &
                         'dof i by dof j', unit='F s/L', shape=shape, repeats=.false., &
                         absent='0'), circulatory)
      call keys%bind(key('stiffness_unsymmetric', 'added to the stiffness, as of bearings', &
                         unit='F/L', shape=shape, repeats=.false., absent='0'), &
                     stiffness_unsymmetric)
      call keys%bind(key('damping_unsymmetric', 'added to the damping', unit='F s/L', shape=shape, &
                         repeats=.false., absent='0'), damping_unsymmetric)
   end subroutine bind_matrices

   !> Displacements that are combinations of dofs: how many.
   subroutine bind_n_rows(keys, n_dof, n_rows)
      class(key_visitor), intent(inout) :: keys
      integer, intent(in) :: n_dof
      !> Of the model file on entry.
      integer, intent(inout) :: n_rows

      call keys%bind(key('n_rows', &
                         'displacements that combine dofs, named n_dof + 1, .. in sides, '// &
                         'term_dof, observe', from_to(0, largest), absent='of the file'), n_rows)
      call keys%set_size('n_rows', n_rows)
      call keys%set_size('(n_dof+n_rows)', n_dof + n_rows)
   end subroutine bind_n_rows

   !> And what they are (n_dof, n_rows).
   subroutine bind_rows(keys, needed, rows)
      class(key_visitor), intent(inout) :: keys
      logical, intent(in) :: needed
      real(wp), allocatable, intent(inout) :: rows(:, :)

      call keys%bind(key('row', 'weights of the dofs in each, row after row', &
                         shape='n_dof x n_rows', repeats=.false., &
                         absent='of the file, else required with n_rows'), rows, needed)
   end subroutine bind_rows

   !> What is added to the matrices once they are there, inline or from a file.
   subroutine bind_additions(self, keys)
      class(model_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%bind(key('rayleigh_mass', 'adds this times M to the damping', at_least(0.0_wp), &
                         unit='1/s'), self%rayleigh_mass)
      call keys%bind(key('rayleigh_stiffness', 'adds this times K, with rotation, to the '// &
                         'damping', at_least(0.0_wp), unit='s'), self%rayleigh_stiffness)
      call keys%bind(key('modal_damping', 'fraction of critical damping of all modes', &
                         at_least(0.0_wp)), self%modal_damping)
      call keys%bind_word(key('modal_damping_of', "modes with open contact, or with all pairs "// &
                              "stuck: `closed` of analysis 'modes'", only='modal_damping'), &
                          self%modal_damping_of, damping_words)
      call keys%bind(key('modal_damping_up_to', &
                         'of modes up to this frequency alone, which is faster; 0: of all', &
                         at_least(0.0_wp), unit='Hz', only='modal_damping'), &
                     self%modal_damping_up_to)
      call keys%bind(key('rotation_speed', &
                         'its square times stiffness_rotation and load/static_rotation of the '// &
                         'file, itself times coriolis and circulatory', at_least(0.0_wp), &
                         unit='rad/s'), self%rotation_speed)
      call keys%bind(key('loss_factor', &
                         'i times this part of the stiffness, with rotation, in harmonics '// &
                         'above 0', at_least(0.0_wp)), self%loss_factor)
   end subroutine bind_additions

   !> Group &load, begun here; what a model file holds stays where nothing is given.
   subroutine bind_loads(keys, static, cosine, sine)
      class(key_visitor), intent(inout) :: keys
      !> (n_dof)
      real(wp), allocatable, intent(inout) :: static(:), cosine(:), sine(:)

      call keys%open('load', 'static and harmonic loads')
      call keys%bind(load_key('static', 'constant load'), static, default=0.0_wp)
      call keys%bind(load_key('cosine', 'cosine part of harmonic 1'), cosine, default=0.0_wp)
      call keys%bind(load_key('sine', 'sine part of harmonic 1'), sine, default=0.0_wp)

   contains

      pure type(key_type) function load_key(name, help)
         character(*), intent(in) :: name, help

         load_key = key(name, help, unit='F', shape='n_dof', absent='of the file')
      end function load_key

   end subroutine bind_loads

   !> Within group &load: a factor of all vibratory loads that depends on the frequency.
   subroutine bind_table(keys, n_table, frequency, scale)
      class(key_visitor), intent(inout) :: keys
      !> Of the model file on entry.
      integer, intent(inout) :: n_table
      !> (n_table)
      real(wp), allocatable, intent(inout) :: frequency(:), scale(:)
      logical :: needed

      call keys%bind(key('n_table', &
                         'points that multiply all vibratory loads; 0 switches those of a file '// &
                         'off', from_to(0, largest), absent='of the file'), n_table)
      call keys%set_size('n_table', n_table)
      needed = n_table > 0
      call keys%bind(key('table_frequency', &
                         'of the points, rising; linear between, refused beyond', &
                         at_least(0.0_wp), unit='rad/s', shape='n_table', &
                         absent='of the file, else required with n_table'), frequency, &
                     needed .and. .not. allocated(frequency))
      call keys%bind(key('table_scale', 'factor of the loads', shape='n_table', &
                         absent='of the file, else required with n_table'), scale, &
                     needed .and. .not. allocated(scale))
   end subroutine bind_table

   !> Last of the group: they multiply what the file or the keys before gave.
   subroutine bind_scales(self, keys)
      class(model_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys

      call keys%bind(key('static_scale', 'of the static load and that of rotation'), &
                     self%static_scale)
      call keys%bind(key('harmonic_scale', 'of all vibratory loads'), self%harmonic_scale)
   end subroutine bind_scales

end module fw_model_keys
