!> Contact that differs from sector to sector, beside the waves that take its mean: rows W of every
!> sector with blocks D_j, what contact has of its own there, and what sectors have beside each
!> other,
!>
!>   (M + W^T D W)^-1 = M^-1 - M^-1 W^T X W M^-1,   X = D (I + Gamma D)^-1,   Gamma = W M^-1 W^T,
!>
!> with X as fw_ring_update has it. Only of laws that are functions of displacements: what others
!> add depends on the balance of all sectors.
submodule(fw_balance_state:fw_balance_waves) fw_balance_differing
   implicit none (type, external)

   !> What may be left out of Gamma, of rows in which contact differs by one.
   real(wp), parameter :: left_out = 2.0e-3_wp
   !> Difference from the mean that is none, relative to it.
   real(wp), parameter :: alike = 1.0e-6_wp

contains

   module procedure build_differing
      complex(wp), allocatable :: block(:, :, :), gamma(:, :, :)
      real(wp), allocatable :: scale(:)
      integer, allocatable :: used(:)
      integer :: a, b, j, k, m, n, r

      m = self%problem%structure%n_slots
      n = self%problem%structure%n_alike
      call find_blocks(self, h, mean, block, scale)
      used = pack([(a, a=1, size(scale))], scale > 0.0_wp)
      r = size(used)
      block = block(used, used, :)
      scale = scale(used)
      do j = 1, n
         do b = 1, r
            block(:, b, j) = block(:, b, j)/(scale*scale(b))
         end do
      end do
      associate (differ => self%preconditioner%around%differing(h))
         call differ%reserve(r, m, n)
         allocate (gamma(r, r, n))
         do k = 0, n - 1
            call find_rows(self, k, mean, used, scale, differ%rows(:, :, k + 1))
            call solve_rows(self%preconditioner%around%wave(k + 1, h), differ%rows(:, :, k + 1), &
                            differ%answer(:, :, k + 1))
            call zgemm('N', 'N', r, r, m, one, differ%rows(:, :, k + 1), r, &
                       differ%answer(:, :, k + 1), m, zero, gamma(:, :, k + 1), r)
         end do
         call differ%find_coordinates()
         call differ%update%build(gamma, block, left_out, sizes%whole_sectors, differ%is_there)
         differ%is_there = differ%is_there .and. r > 0
      end associate
   end procedure build_differing

   !> D of all sectors, and the roots of the largest entries of each row; 0 where nothing differs.
   subroutine find_blocks(self, h, mean, block, scale)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: h
      type(law_means), intent(in) :: mean(:)
      complex(wp), allocatable, intent(out) :: block(:, :, :)
      real(wp), allocatable, intent(out) :: scale(:)
      complex(wp) :: slope
      real(wp), allocatable :: largest(:)
      integer :: a, at, b, c_in, c_out, e, i, j, k, n, n_components, n_own, r

      n = self%problem%structure%n_alike
      n_own = self%problem%structure%n_own()
      r = n_own
      do k = 1, size(mean)
         r = r + size(mean(k)%element)*size(self%problem%forces%entry(k)%row, 1)
      end do
      allocate (block(r, r, n), source=zero)
      allocate (largest(r), source=0.0_wp)
      at = 0
      do k = 1, size(mean)
         associate (entry => self%problem%forces%entry(k), work => self%work(k))
            n_components = size(entry%row, 1)
            do e = 1, size(entry%row, 2)
               i = modulo(e - 1, size(mean(k)%element)) + 1
               j = (e - 1)/size(mean(k)%element) + 1
               do c_out = 1, n_components
                  if (entry%row(c_out, e) == 0) cycle
                  a = at + (i - 1)*n_components + c_out
                  do c_in = 1, n_components
                     if (entry%row(c_in, e) == 0) cycle
                     b = at + (i - 1)*n_components + c_in
                     slope = zero
                     if (work%linear_state(e) /= pair_open) slope = &
                        force_mean(self, work, h, e, c_out, c_in)* &
                        input_slope(self, entry, work, h, e, c_in)
                     largest(a) = max(largest(a), abs(slope))
                     largest(b) = max(largest(b), abs(slope))
                     block(a, b, j) = slope - mean(k)%element(i)%slope(c_out, c_in)
                  end do
               end do
            end do
            at = at + size(mean(k)%element)*n_components
         end associate
      end do
      if (n_own > 0) call self%problem%structure%own_block(self%structure_state, h, &
                                                           block(at + 1:, at + 1:, :))
      allocate (scale(r))
      do a = 1, r
         scale(a) = max(maxval(abs(block(a, :, :))), maxval(abs(block(:, a, :))))
         if (scale(a) <= alike*largest(a)) scale(a) = 0.0_wp
      end do
      scale = sqrt(scale)
   end subroutine find_blocks

   !> Rows in use of a nodal diameter, in the order of the blocks, times their scales.
   subroutine find_rows(self, k, mean, used, scale, rows)
      type(balance_state), intent(in) :: self
      integer, intent(in) :: k
      type(law_means), intent(in) :: mean(:)
      integer, intent(in) :: used(:)
      real(wp), intent(in) :: scale(:)
      complex(wp), intent(out) :: rows(:, :)
      complex(wp), allocatable :: all_rows(:, :), weight(:)
      integer :: a, c, i, l, n, n_contact

      n = self%problem%structure%n_alike
      n_contact = 0
      do l = 1, size(mean)
         n_contact = n_contact + size(mean(l)%element)*size(self%problem%forces%entry(l)%row, 1)
      end do
      allocate (all_rows(n_contact + self%problem%structure%n_own(), size(rows, 2)), source=zero)
      a = 0
      do l = 1, size(mean)
         associate (row => self%problem%forces%entry(l)%row)
            do i = 1, size(mean(l)%element)
               do c = 1, size(row, 1)
                  a = a + 1
                  if (row(c, i) == 0) cycle
                  weight = self%problem%joint%wave_weights( &
                           n, k, self%problem%joint%row_in_sector(row(c, i)))
                  all_rows(a, :size(weight)) = weight
               end do
            end do
         end associate
      end do
      call self%problem%structure%own_rows(k, all_rows(n_contact + 1:, :))
      do a = 1, size(used)
         rows(a, :) = scale(a)*all_rows(used(a), :)
      end do
   end subroutine find_rows

   !> M_k^-1 W_k^H.
   subroutine solve_rows(factors, rows, answer)
      type(preconditioner_lu_type), intent(in) :: factors
      complex(wp), intent(in) :: rows(:, :)
      complex(wp), intent(out) :: answer(:, :)
      complex(sp), allocatable :: b(:, :)
      real(wp) :: largest(size(rows, 1))
      integer :: a

      allocate (b(size(rows, 2), size(rows, 1)))
      do a = 1, size(rows, 1)
         largest(a) = max(maxval(abs(rows(a, :))), tiny(1.0_wp))
         b(:, a) = cmplx(conjg(rows(a, :))/largest(a), kind=sp)
      end do
      call factors%solve_scaled(size(b, 2), b)
      do a = 1, size(rows, 1)
         answer(:, a) = factors%scale*largest(a)*cmplx(b(:, a), kind=wp)
      end do
   end subroutine solve_rows

end submodule fw_balance_differing
