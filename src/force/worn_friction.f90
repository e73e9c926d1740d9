!> Friction that changes with wear, as a function of the depth w of a pair alone:
!>
!>   decays      mu = mu_f + (mu_0 - mu_f) exp(-a w)
!>   by energy   dw = k S/A and dE = mu S: mu = mu_f/(1 - (1 - mu_f/mu_0) exp(-mu_f a w)),
!>               which is mu_0/(1 + mu_0 a w) where mu_f vanishes
module fw_worn_friction
   use fw_gauss_points, only: gauss_rule
   use fw_kinds, only: wp
   implicit none (type, external)
   private

   public :: worn_friction, friction_stays, friction_decays, friction_by_energy

   integer, parameter :: friction_stays = 0, friction_decays = 1, friction_by_energy = 2

   type :: worn_friction
      integer :: form = friction_stays
      !> mu_f, and a (n_pairs) [1/length].
      real(wp), allocatable :: final(:), rate(:)
   contains
      procedure :: changes
      procedure :: of_pairs
      procedure :: at_depth
      procedure :: mean_between
   end type worn_friction

contains

   pure logical function changes(self)
      class(worn_friction), intent(in) :: self

      changes = self%form /= friction_stays
   end function changes

   !> That of some of the pairs.
   pure type(worn_friction) function of_pairs(self, pair)
      class(worn_friction), intent(in) :: self
      integer, intent(in) :: pair(:)

      of_pairs%form = self%form
      if (.not. self%changes()) return
      of_pairs%final = self%final(pair)
      of_pairs%rate = self%rate(pair)
   end function of_pairs

   !> mu at depths, and mu'/mu.
   pure subroutine at_depth(self, first, depth, mu, growth)
      class(worn_friction), intent(in) :: self
      !> mu_0 (n_pairs).
      real(wp), intent(in) :: first(:), depth(:)
      real(wp), intent(out) :: mu(:), growth(:)
      real(wp) :: part
      integer :: i

      do i = 1, size(first)
         growth(i) = 0.0_wp
         mu(i) = first(i)
         if (.not. first(i) > 0.0_wp) cycle
         if (self%form == friction_decays) then
            part = (first(i) - self%final(i))*exp(-self%rate(i)*depth(i))
            mu(i) = self%final(i) + part
            if (mu(i) > 0.0_wp) growth(i) = -self%rate(i)*part/mu(i)
         else if (self%final(i) > 0.0_wp) then
            part = (1.0_wp - self%final(i)/first(i))*exp(-self%final(i)*self%rate(i)*depth(i))
            mu(i) = self%final(i)/(1.0_wp - part)
            growth(i) = -self%final(i)*self%rate(i)*part/(1.0_wp - part)
         else
            mu(i) = first(i)/(1.0_wp + first(i)*self%rate(i)*depth(i))
            growth(i) = -mu(i)*self%rate(i)
         end if
      end do
   end subroutine at_depth

   !> Mean of mu over the depths of a step: what the energy of its sliding goes by.
   pure function mean_between(self, first, before, after) result(mean)
      class(worn_friction), intent(in) :: self
      !> mu_0, and depths (n_pairs).
      real(wp), intent(in) :: first(:), before(:), after(:)
      real(wp) :: mean(size(first))
      ! Of exp(-a w) they leave 1e-12 where a step is as long as 3/a.
      integer, parameter :: n_points = 7
      real(wp) :: points(n_points), weights(n_points), mu(size(first)), growth(size(first))
      integer :: k

      call gauss_rule(points, weights)
      mean = 0.0_wp
      do k = 1, n_points
         call self%at_depth(first, before + points(k)*(after - before), mu, growth)
         mean = mean + weights(k)*mu
      end do
   end function mean_between

end module fw_worn_friction
