!> All sectors at once: what is observed in each of them, and the work of their load, wave by wave.
submodule(fw_all_sectors) fw_all_sectors_observed
   use fw_sector_stiffness, only: observed_by_sector, observed_sector_slope, recover_sector, &
      work_of_sector
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
