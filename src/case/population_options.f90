!> Options of a population of disks (group &population): patterns of blade frequencies, and which
!> amplitude is the largest of each.
module fw_population_options
   use fw_blade_patterns, only: blade_patterns
   use fw_key, only: key, key_visitor
   use fw_key_range, only: from_to
   use fw_kinds, only: wp
   use fw_resonance_options, only: resonance_words
   implicit none (type, external)
   private

   public :: population_options

   !> More are taken for a mistake.
   integer, parameter :: most_patterns = 10000000

   !> Which disks are solved, and over which of their blades.
   type :: population_options
      !> Of the patterns there are, the first ones (0: all).
      integer :: n_patterns = 0
      !> Look for maxima between the rows of the sweep.
      logical :: peaks = .true.
      !> Which amplitude, as in resonance_words.
      integer :: quantity = 1
      !> As given, pattern after pattern.
      real(wp), allocatable :: patterns(:)
      !> Of the case or of its model; no key.
      type(blade_patterns) :: blades
   contains
      procedure :: bind_keys
   end type population_options

contains

   !> The keys of group &population.
   subroutine bind_keys(self, keys)
      class(population_options), intent(inout) :: self
      class(key_visitor), intent(inout) :: keys
      character(*), parameter :: of_population = "analysis = 'population'"

      call keys%open('population', 'the largest amplitude of disks whose blade frequencies differ')
      call keys%bind(key('n_patterns', 'disks, the first patterns; 0: all', &
                         from_to(0, most_patterns)), self%n_patterns)
      call keys%bind(key('peaks', 'look for maxima between the rows'), self%peaks)
      call keys%bind_word(key('quantity', 'of the first harmonic, or the largest deflection'), &
                          self%quantity, resonance_words)
      call keys%bind(key('patterns', 'pattern after pattern, each as mistuning%frequency', &
                         shape=':', repeats=.false., absent='/mistuning/patterns of the file', &
                         only=of_population), self%patterns)
   end subroutine bind_keys

end module fw_population_options
