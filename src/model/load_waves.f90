!> Loads of any harmonic. Of the columns of a load the first three are its static, cosine and sine
!> part, the latter two of the first harmonic; behind them stand a cosine and a sine part for each
!> wave, which acts in a harmonic of its own and may grow with a power of its frequency:
!>
!>   F_n(omega) = t(omega) sum (n omega)**power (f_c - i f_s),
!>
!> t being 1, or a table of the frequency, linear between its points: all vibratory loads are waves
!> then.
module fw_load_waves
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: load_waves

   !> What the columns behind the third are.
   type :: load_waves
      !> Harmonic of each wave, and the power of its frequency (n_waves).
      integer, allocatable :: harmonic(:), power(:)
      !> Points of the table [rad/s], rising, and t there (n_table); not allocated without one.
      real(wp), allocatable :: table_frequency(:), table_scale(:)
   contains
      procedure :: n_waves
      procedure :: n_columns
      procedure :: place
      procedure :: factor
      procedure :: slope
      procedure :: scale_at
      procedure :: scale_slope
      procedure, private :: part_of
      procedure :: acts
      procedure :: highest
      procedure :: grows_at_rest
      procedure :: with_columns
   end type load_waves

contains

   !> Waves that the load drives.
   pure integer function n_waves(self)
      class(load_waves), intent(in) :: self

      n_waves = 0
      if (allocated(self%harmonic)) n_waves = size(self%harmonic)
   end function n_waves

   !> Columns of a load, with the three that are always there.
   pure integer function n_columns(self)
      class(load_waves), intent(in) :: self

      n_columns = 3 + 2*self%n_waves()
   end function n_columns

   !> The wave of a harmonic and a power; 0 for none.
   pure integer function place(self, harmonic, power)
      class(load_waves), intent(in) :: self
      integer, intent(in) :: harmonic, power

      do place = self%n_waves(), 1, -1
         if (self%harmonic(place) == harmonic .and. self%power(place) == power) return
      end do
   end function place

   !> What the columns of a wave are multiplied by in a harmonic: 0 where it acts in another one.
   pure real(wp) function factor(self, wave, harmonic, s)
      class(load_waves), intent(in) :: self
      integer, intent(in) :: wave, harmonic
      !> Frequency of the harmonic [rad/s].
      real(wp), intent(in) :: s

      factor = 0.0_wp
      if (self%harmonic(wave) /= harmonic) return
      factor = s**self%power(wave)
      if (allocated(self%table_scale)) factor = factor*self%scale_at(s/harmonic)
   end function factor

   !> t at a frequency; on the straight lines of the first and the last part beyond the ends.
   pure real(wp) function scale_at(self, omega) result(scale)
      class(load_waves), intent(in) :: self
      real(wp), intent(in) :: omega
      integer :: k

      k = self%part_of(omega)
      scale = self%table_scale(k) + (omega - self%table_frequency(k))*self%scale_slope(omega)
   end function scale_at

   !> dt/domega.
   pure real(wp) function scale_slope(self, omega) result(slope)
      class(load_waves), intent(in) :: self
      real(wp), intent(in) :: omega
      integer :: k

      k = self%part_of(omega)
      slope = (self%table_scale(k + 1) - self%table_scale(k))/ &
              (self%table_frequency(k + 1) - self%table_frequency(k))
   end function scale_slope

   !> Point of the table at which the part that a frequency lies in begins.
   pure integer function part_of(self, omega) result(k)
      class(load_waves), intent(in) :: self
      real(wp), intent(in) :: omega

      do k = size(self%table_frequency) - 1, 2, -1
         if (omega >= self%table_frequency(k)) return
      end do
      k = 1
   end function part_of

   !> d factor/dp of a parameter that changes the frequency at a rate ds/dp.
   pure real(wp) function slope(self, wave, harmonic, s, rate)
      class(load_waves), intent(in) :: self
      integer, intent(in) :: wave, harmonic
      real(wp), intent(in) :: s, rate

      slope = 0.0_wp
      if (self%harmonic(wave) /= harmonic) return
      if (self%power(wave) /= 0) slope = self%power(wave)*rate*s**(self%power(wave) - 1)
      if (.not. allocated(self%table_scale)) return
      slope = self%scale_at(s/harmonic)*slope + &
              self%scale_slope(s/harmonic)*rate/harmonic*s**self%power(wave)
   end function slope

   !> Whether some wave has a load that changes with the frequency.
   pure logical function acts(self)
      class(load_waves), intent(in) :: self

      acts = .false.
      if (allocated(self%power)) acts = any(self%power /= 0) .or. allocated(self%table_scale)
   end function acts

   !> Whether some wave has no bound towards the frequency 0.
   pure logical function grows_at_rest(self)
      class(load_waves), intent(in) :: self

      grows_at_rest = .false.
      if (allocated(self%power)) grows_at_rest = any(self%power < 0)
   end function grows_at_rest

   !> The highest harmonic that a wave acts in; 1 where there is none.
   pure integer function highest(self)
      class(load_waves), intent(in) :: self

      highest = 1
      if (self%n_waves() > 0) highest = max(1, maxval(self%harmonic))
   end function highest

   !> All columns of a load (n, n_columns).
   pure function with_columns(self, static, cosine, sine, wave) result(columns)
      class(load_waves), intent(in) :: self
      real(wp), intent(in) :: static(:), cosine(:), sine(:)
      !> Cosine and sine parts of the waves (n, 2 n_waves).
      real(wp), allocatable, intent(in) :: wave(:, :)
      real(wp), allocatable :: columns(:, :)

      allocate (columns(size(static), self%n_columns()))
      columns(:, 1) = static
      columns(:, 2) = cosine
      columns(:, 3) = sine
      if (self%n_waves() > 0) columns(:, 4:) = wave
   end function with_columns

end module fw_load_waves
