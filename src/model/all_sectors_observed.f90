!> All sectors at once: what is observed in each of them, and the work of their load, wave by wave.
submodule(fw_all_sectors) fw_all_sectors_observed
   use fw_sector_stiffness, only: answer_of_modes, observed_by_sector, observed_sector_slope, &
      recover_sector, work_of_sector
   implicit none (type, external)

contains

   ! Each wave observes itself: transforms on both sides of one sector after another.
   module procedure recover
      complex(wp), allocatable :: waves(:, :), found(:, :), sectors(:, :)
      integer :: h, k, n

      n = self%n_observed/self%n_alike
      allocate (waves(self%n_slots, self%n_alike))
      allocate (found(n, self%n_alike), sectors(n, self%n_alike))
      select type (state)
      type is (all_sectors_state)
         do h = 1, size(self%harmonic)
            call waves_of(self, q(:, h), waves)
            do k = 0, self%n_alike - 1
               call recover_sector(self%basis(basis_of(self, k)), state%point(k + 1, h), &
                                   state%load_factor(h), waves(:, k + 1), found(:, k + 1))
            end do
            call self%observed_ring%add_waves(found, sectors)
            observed(:, h) = reshape(sectors, [self%n_observed])
         end do
      end select
   end procedure recover

   ! Modes are known to round-off times the condition of the mass matrix; what this couples is
   ! nothing beside their own damping, even of two that resonate together.
   module procedure drop_round_off
      real(wp), parameter :: nothing = 1.0e-9_wp
      real(wp), allocatable :: root(:)
      logical :: is_coupled
      integer :: i, j, k

      do k = 1, size(self%basis)
         if (.not. allocated(self%basis(k)%c_ii)) cycle
         associate (c => self%basis(k)%c_ii)
            root = [(sqrt(max(real(c(i, i), wp), 0.0_wp)), i=1, size(c, 1))]
            is_coupled = .false.
            do j = 1, size(c, 2)
               is_coupled = is_coupled .or. any(abs(c(:j - 1, j)) > nothing*root(:j - 1)*root(j)) &
                            .or. any(abs(c(j + 1:, j)) > nothing*root(j + 1:)*root(j))
            end do
         end associate
         if (.not. is_coupled) deallocate (self%basis(k)%c_ii)
      end do
   end procedure drop_round_off

   ! A force on one sector is all waves in equal shares; the load is one of them.
   module procedure answer_by_modes
      complex(wp), allocatable :: answer(:, :, :)
      type(harmonic_point) :: point
      integer :: a, k, n_forced

      n_forced = size(by_force, 2)
      allocate (answer(size(by_load, 1), self%n_alike, n_forced + 1))
      point%harmonic = 1
      point%theta = cmplx(omega**2, kind=wp)
      point%s = omega
      do k = 0, self%n_alike - 1
         point%conjugated = 2*k > self%n_alike
         point%is_loaded = modulo(self%cyclic%nodal_diameter(1) - k, self%n_alike) == 0
         call answer_of_modes(self%basis(basis_of(self, k)), point, n_forced, &
                              answer(:, k + 1, :), failed)
         if (failed) return
      end do
      do a = 1, n_forced
         answer(:, :, a) = answer(:, :, a)/self%n_alike
         call self%observed_ring%add_waves(answer(:, :, a), by_load)
         by_force(:, a, :) = by_load
      end do
      call self%observed_ring%add_waves(answer(:, :, n_forced + 1), by_load)
   end procedure answer_by_modes

   ! The transforms are unitary but for N, which the waves of the slopes take: the same ones serve
   ! on the way back, with the conjugate transpose of each wave between them.
   module procedure pull_observed
      complex(wp), allocatable :: waves(:, :), found(:, :), sectors(:, :)
      integer :: h, j, k, n

      n = self%n_observed/self%n_alike
      allocate (waves(self%n_slots, self%n_alike))
      allocate (found(n, self%n_alike), sectors(n, self%n_alike))
      select type (state)
      type is (all_sectors_state)
         if (.not. allocated(state%observe)) allocate ( &
            state%observe(n, self%n_slots, self%n_alike, size(self%harmonic)))
         if (abs(state%observe_at - state%omega) > 0.0_wp) call form_observed(self, state)
         do h = 1, size(self%harmonic)
            sectors = reshape(observed(:, h), [n, self%n_alike])
            call self%observed_ring%find_waves(sectors, found)
            do k = 1, self%n_alike
               waves(:, k) = matmul(found(:, k), conjg(state%observe(:, :, k, h)))
            end do
            call self%ring%add_waves(waves, state%in(:, :, h))
            do j = 1, self%n_alike
               slope(self%coordinate(:, j), h) = state%in(:, j, h)
            end do
         end do
      end select
   end procedure pull_observed

   !> Observed quantities by the waves, at the present frequency.
   subroutine form_observed(self, state)
      class(all_sectors), intent(in) :: self
      type(all_sectors_state), intent(inout) :: state
      integer :: h, k

      do h = 1, size(self%harmonic)
         do k = 0, self%n_alike - 1
            call observed_by_sector(self%basis(basis_of(self, k)), state%point(k + 1, h), &
                                    state%observe(:, :, k + 1, h))
         end do
      end do
      state%observe_at = state%omega
   end subroutine form_observed

   ! What the condensed modes do of their own where the frequency moves.
   module procedure observed_slope
      complex(wp), allocatable :: waves(:, :), found(:, :), sectors(:, :)
      integer :: h, k, n

      n = self%n_observed/self%n_alike
      allocate (waves(self%n_slots, self%n_alike))
      allocate (found(n, self%n_alike), sectors(n, self%n_alike))
      slope = zero
      select type (state)
      type is (all_sectors_state)
         do h = 1, size(self%harmonic)
            if (self%harmonic(h) == 0) cycle
            call waves_of(self, q(:, h), waves)
            do k = 0, self%n_alike - 1
               associate (point => state%point(k + 1, h))
                  call observed_sector_slope(self%basis(basis_of(self, k)), point, &
                                             slopes_of(point, 0.0_wp, by_frequency), &
                                             state%load_factor(h), waves(:, k + 1), &
                                             found(:, k + 1))
               end associate
            end do
            call self%observed_ring%add_waves(found, sectors)
            slope(:, h) = reshape(sectors, [self%n_observed])
         end do
      end select
   end procedure observed_slope

   ! The load is one wave, whose work is that of all sectors.
   module procedure load_work
      complex(wp), allocatable :: waves(:, :)
      complex(wp) :: own(self%n_slots), own_slope
      integer :: j, k

      allocate (waves(self%n_slots, self%n_alike))
      call waves_of(self, q, waves)
      k = modulo(self%cyclic%nodal_diameter(self%harmonic(h)), self%n_alike)
      select type (state)
      type is (all_sectors_state)
         associate (point => state%point(k + 1, h))
            call work_of_sector(self%basis(basis_of(self, k)), point, &
                                slopes_of(point, 0.0_wp, by_frequency), state%load_factor(h), &
                                waves(:, k + 1), work, own_slope, own)
         end associate
      end select
      work = self%n_alike*work
      if (present(slope)) slope = self%n_alike*own_slope
      if (.not. present(row)) return
      do j = 1, self%n_alike
         row(self%coordinate(:, j)) = conjg(self%cyclic%factor(k, j - 1))*own
      end do
   end procedure load_work

end submodule fw_all_sectors_observed
