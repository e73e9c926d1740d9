!> All sectors at once: matrices between the coordinates of any two sectors, block circulant, for
!> rings that are small enough to have them whole.
submodule(fw_all_sectors) fw_all_sectors_blocks
   implicit none (type, external)

contains

   !> Between all coordinates: the waves of harmonic h, transformed back to sectors.
   module procedure block_of_all
      integer :: j

      select type (state)
      type is (all_sectors_state)
         call fill_block(self, state%wave(:, :, :, h), [(j, j=1, self%n_coordinates)], &
                         self%n_coordinates, matrix)
         if (allocated(self%deviation)) call self%deviation%add_block( &
            state%own(:, :, :, h), self%coordinate, self%coordinate, matrix)
      end select
   end procedure block_of_all

   !> The same between the coordinates that are active, condensed ones behind them.
   module procedure block_in_use
      integer, allocatable :: row(:, :)
      integer :: i

      select type (state)
      type is (all_sectors_state)
         call fill_block(self, state%wave(:, :, :, h), state%used(:state%n_used), &
                         state%n_active, matrix)
         if (.not. allocated(self%deviation)) return
         allocate (row(self%n_slots, self%n_alike), source=0)
         do i = 1, state%n_used
            row(self%slot(state%used(i)), self%sector(state%used(i))) = i
         end do
         call self%deviation%add_block(state%own(:, :, :, h), row, &
                                       merge(row, 0, row <= state%n_active), matrix)
      end select
   end procedure block_in_use

   !> The mean over the waves, each with its own reduction: what one sector has of itself alone.
   module procedure mass
      complex(wp), allocatable :: own(:, :, :), block(:, :)
      integer :: j, k

      matrix = 0.0_wp
      do k = 0, self%n_alike - 1
         do j = 1, self%n_alike
            matrix(self%coordinate(:, j), self%coordinate(:, j)) = &
               matrix(self%coordinate(:, j), self%coordinate(:, j)) + &
               real(self%basis(basis_of(self, k))%blocks(:self%n_slots, :, 2), wp)/self%n_alike
         end do
      end do
      if (.not. allocated(self%deviation)) return
      allocate (own(self%n_own(), self%n_own(), self%n_alike))
      allocate (block(size(matrix, 1), size(matrix, 2)), source=zero)
      call self%deviation%form(0.0_wp, -one, 0.0_wp, own)
      call self%deviation%add_block(own, self%coordinate, self%coordinate, block)
      matrix = matrix + real(block, wp)
   end procedure mass

   !> Stiffness, mass and damping of waves one by one; those above half of the sectors run the
   !> other way and are the conjugates of their mirror images.
   module procedure parts
      complex(wp), allocatable :: wave(:, :, :, :), rows(:, :, :), between(:, :, :), own(:, :, :)
      integer :: every(self%n_coordinates), j, k, m, n, n_rows

      m = self%n_slots
      n = self%n_alike
      n_rows = self%n_observed/n
      allocate (wave(m, m, n, 3), rows(n_rows, m, n), between(n_rows, m, n), source=zero)
      do k = 0, n - 1
         associate (b => self%basis(basis_of(self, k)))
            wave(:, :, k + 1, :b%n_blocks) = b%blocks(:m, :, :)
            if (allocated(b%coriolis)) wave(:, :, k + 1, 3) = wave(:, :, k + 1, 3) + &
                                                              b%coriolis(:m, :m)
            rows(:, :, k + 1) = b%observe_q
            if (2*k > n) then
               wave(:, :, k + 1, :) = conjg(wave(:, :, k + 1, :))
               rows(:, :, k + 1) = conjg(rows(:, :, k + 1))
            end if
            if (allocated(b%aero) .and. self%harmonic(h) > 0) then
               wave(:, :, k + 1, 1) = wave(:, :, k + 1, 1) + &
                                      b%aero(:m, :m, merge(2, 1, 2*k > n))
            end if
         end associate
      end do
      every = [(j, j=1, self%n_coordinates)]
      call fill_block(self, wave(:, :, :, 1), every, self%n_coordinates, stiffness)
      call fill_block(self, wave(:, :, :, 2), every, self%n_coordinates, mass)
      call fill_block(self, wave(:, :, :, 3), every, self%n_coordinates, damping)
      if (allocated(self%deviation)) then
         allocate (own(self%n_own(), self%n_own(), n))
         call self%deviation%form(1.0_wp, zero, 0.0_wp, own)
         call self%deviation%add_block(own, self%coordinate, self%coordinate, stiffness)
         call self%deviation%form(0.0_wp, -one, 0.0_wp, own)
         call self%deviation%add_block(own, self%coordinate, self%coordinate, mass)
         call self%deviation%form(0.0_wp, zero, 1.0_wp, own)
         call self%deviation%add_block(own/(0.0_wp, 1.0_wp), self%coordinate, self%coordinate, &
                                       damping)
      end if
      call between_sectors(self, rows, between)
      do j = 1, self%n_coordinates
         do k = 1, n
            observe((k - 1)*n_rows + 1:k*n_rows, j) = between(:, self%slot(j), &
                                                              modulo(k - self%sector(j), n) + 1)
         end do
      end do
   end procedure parts

   !> A block circulant matrix: rows `used`, the first n_active of them as columns.
   pure subroutine fill_block(self, wave, used, n_active, matrix)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(in) :: wave(:, :, :)
      integer, intent(in) :: used(:)
      integer, intent(in) :: n_active
      complex(wp), intent(inout) :: matrix(:, :)
      complex(wp), allocatable :: between(:, :, :)
      integer :: i, j

      allocate (between(self%n_slots, self%n_slots, self%n_alike))
      call between_sectors(self, wave, between)
      do j = 1, n_active
         do i = 1, size(used)
            matrix(i, j) = between(self%slot(used(i)), self%slot(used(j)), &
                                   modulo(self%sector(used(i)) - self%sector(used(j)), &
                                          self%n_alike) + 1)
         end do
      end do
   end subroutine fill_block

   !> What matrices of the nodal diameters k = 0 .. N - 1 are between sectors: the motion of one to
   !> the force on the one so many further, from 0 (n_slots, n_slots, n_sectors).
   pure subroutine between_sectors(self, wave, between)
      class(all_sectors), intent(in) :: self
      complex(wp), intent(in) :: wave(:, :, :)
      complex(wp), intent(out) :: between(:, :, :)
      integer :: j, k

      between = zero
      do j = 0, self%n_alike - 1
         do k = 0, self%n_alike - 1
            between(:, :, j + 1) = between(:, :, j + 1) + &
                                   self%cyclic%factor(k, j)/self%n_alike*wave(:, :, k + 1)
         end do
      end do
   end subroutine between_sectors

end submodule fw_all_sectors_blocks
