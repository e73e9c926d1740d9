!> Points of given amplitude: ways to those that their guesses do not reach, and whether other loads
!> have the same amplitude.
submodule(fw_controlled_response) fw_control_ways
   implicit none (type, external)

   !> Halvings of the way from the last point; smallest amplitude that one is raised from, and the
   !> smallest step up, over the amplitude.
   integer, parameter :: max_halvings = 6
   real(wp), parameter :: smallest_start = 1.0e-3_wp, smallest_step = 1.0_wp/512.0_wp
   !> By this part of itself another load differs.
   real(wp), parameter :: another = 1.0e-5_wp

contains

   module procedure approach
      real(wp) :: middle(2)

      ! Amplitudes by their ratio.
      middle = [0.5_wp*(self%last%place + place), sqrt(self%last%amplitude*amplitude)]
      call from_guesses(self, middle(1), middle(2), report, error)
      if (allocated(error) .or. report%interrupted) return
      if (.not. report%converged .and. depth < max_halvings) then
         call approach(self, middle(1), middle(2), depth + 1, report, error)
         if (allocated(error) .or. report%interrupted) return
      end if
      if (.not. report%converged) return
      call from_guesses(self, place, amplitude, report, error)
      if (allocated(error) .or. ends(report) .or. depth >= max_halvings) return
      call approach(self, place, amplitude, depth + 1, report, error)
   end procedure approach

   module procedure raise_amplitude
      type(known_point) :: last
      real(wp) :: share, step

      if (self%rest >= amplitude) return
      ! What is known of other frequencies is no guess here, and comes back where this fails.
      last = self%last
      self%last%is_known = .false.
      self%before%is_known = .false.
      share = 0.0_wp
      step = smallest_start
      do
         call from_guesses(self, place, self%rest + min(1.0_wp, share + step)* &
                           (amplitude - self%rest), report, error)
         if (allocated(error) .or. report%interrupted) exit
         if (report%converged) then
            share = min(1.0_wp, share + step)
            if (share >= 1.0_wp) exit
            step = merge(2.0_wp, 1.5_wp, share < 0.1_wp)*step
         else
            step = 0.5_wp*step
            if (share <= 0.0_wp .or. step < smallest_step*min(1.0_wp, 10.0_wp*share)) exit
         end if
      end do
      if (.not. report%converged) self%last = last
   end procedure raise_amplitude

   module procedure by_first_harmonic
      integer, parameter :: most_secants = 20
      type(known_point) :: kept(3)
      real(wp) :: first(2), largest(2), next
      integer :: k, of
      logical :: is_there

      is_there = .false.
      kept = [self%last, self%before, self%head]
      self%last%is_known = .false.
      self%before%is_known = .false.
      of = self%control%of
      next = max(amplitude - self%rest, smallest_start*amplitude)
      first = 0.0_wp
      largest = 0.0_wp
      do k = 1, most_secants
         self%control%of = of_first_harmonic
         call from_guesses(self, place, next, report, error)
         self%control%of = of
         if (allocated(error) .or. .not. report%converged) exit
         first = [first(2), next]
         largest = [largest(2), self%control%size_of_motion()]
         is_there = abs(largest(2) - amplitude) <= self%method%newton%options%tolerance*amplitude
         if (is_there) exit
         next = first(2)*amplitude/largest(2)
         if (k == 1 .or. .not. abs(largest(2) - largest(1)) > 0.0_wp) cycle
         next = first(2) + (amplitude - largest(2))*(first(2) - first(1))/(largest(2) - largest(1))
         next = min(max(next, 0.3_wp*first(2)), 3.0_wp*first(2))
      end do
      self%last = kept(1)
      self%before = kept(2)
      self%head = kept(3)
      if (allocated(error) .or. .not. report%converged) return
      self%control%amplitude = amplitude
      if (.not. is_there) call attempt(self, report, error)
      if (allocated(error)) return
      if (report%converged) call remember(self, place, amplitude)
   end procedure by_first_harmonic

   module procedure look_for_others
      type(solver_report) :: report
      real(wp) :: found(size(self%y))
      integer :: guess
      logical :: is_another, is_there

      found = self%y
      associate (s => found(size(found)))
         ! All stuck and all free: the two ends of what friction may do.
         do guess = 3, 4
            if (guess == self%guess .and. self%served_by /= served_by_smaller_steps) cycle
            call make_guess(self, guess, request%place(), request%amplitude, is_there, error)
            if (allocated(error)) return
            if (.not. is_there) cycle
            call attempt(self, report, error)
            if (allocated(error) .or. report%interrupted) exit
            is_another = report%converged .and. abs(self%y(size(found)) - s) > another*s
            if (.not. is_another) cycle
            self%n_others = self%n_others + 1
            if (self%n_others == 1) then
               self%other_at = request
               self%other_loads = [min(s, self%y(size(found))), max(s, self%y(size(found)))]
            end if
            exit
         end do
      end associate
      self%y = found
   end procedure look_for_others

end submodule fw_control_ways
