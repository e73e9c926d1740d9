!> The preconditioner where equal sectors are told apart: what the forces add is replaced by its
!> mean over the sectors, so that waves of nodal diameters do not couple,
!>
!>   M_k = Z_n,k + B_k^H mean(G k) (B_k d) - B_k^H mean(G) Z_n,k,
!>
!> a block of the size of one sector for each harmonic and nodal diameter. The mean is over the
!> sectors where a coordinate is active. Where others are solved at once they act as zeros in the
!> right-hand side, and their part of the solution is dropped.
!>
!> What sectors have beside each other, A = W^T D W on rows of each, couples the waves:
!>
!>   (M + W^T D W)^-1 = M^-1 - M^-1 W^T D (I + Gamma D)^-1 W M^-1,   Gamma = W M^-1 W^T,
!>
!> with Gamma block circulant, of the order of the rows of all sectors.
submodule(fw_balance_state) fw_balance_waves
   use fw_force_law, only: pair_mixed, pair_open
   use fw_kinds, only: pi, sp
   use fw_lapack, only: zgemm, zgetrf, zgetrs
   use fw_size_options, only: sizes
   implicit none (type, external)

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), zero = (0.0_wp, 0.0_wp)

   !> Means of an element over the sectors: of G (output, input), and of G times the stiffness of
   !> the input and what its derivative makes of a coefficient.
   type :: mean_type
      complex(wp), allocatable :: force(:, :), slope(:, :)
   end type mean_type

   !> Of the elements of a law in a sector.
   type :: law_means
      type(mean_type), allocatable :: element(:)
   end type law_means

   ! Contact that differs from sector to sector (fw_balance_differing).
   interface
      !> Beside the factors of the waves of a harmonic, from the means of the laws.
      module subroutine build_differing(self, h, mean)
         class(balance_state), intent(inout) :: self
         integer, intent(in) :: h
         type(law_means), intent(in) :: mean(:)
      end subroutine build_differing
   end interface

contains

   module procedure build_waves
      integer :: h

      !$omp parallel do default(none) shared(self) private(h) schedule(dynamic) &
      !$omp if(self%problem%structure%n_coordinates >= coordinates_for_threads)
      do h = 1, self%problem%fourier%n_retained
         call build_harmonic(self, h)
      end do
      !$omp end parallel do
   end procedure build_waves

   !> The factors of one harmonic, from the pairs as they are now.
   subroutine build_harmonic(self, h)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: h
      complex(wp), allocatable :: stiffness(:, :), matrix(:, :)
      !> Sectors where a coordinate is active, and the stiffness of its row where it is not.
      integer :: n_active(self%problem%structure%n_slots)
      real(wp) :: held(self%problem%structure%n_slots)
      type(law_means) :: mean(self%problem%forces%n_laws)
      integer :: i, j, k, m

      m = self%problem%structure%n_slots
      allocate (stiffness(m, m), matrix(m, m))
      call count_active(self, n_active, held)
      do j = 1, self%problem%forces%n_laws
         call find_means(self, self%problem%forces%entry(j), self%work(j), h, n_active, &
                         mean(j)%element)
      end do
      do k = 0, self%problem%structure%n_alike - 1
         call self%problem%structure%wave_block(self%structure_state, h, k, stiffness)
         matrix = stiffness
         do j = 1, self%problem%forces%n_laws
            do i = 1, size(mean(j)%element)
               call add_mean(self, self%problem%forces%entry(j), i, k, mean(j)%element(i), &
                             stiffness, matrix)
            end do
         end do
         do j = 1, m
            if (n_active(j) > 0) cycle
            matrix(j, :) = zero
            matrix(:, j) = zero
            matrix(j, j) = held(j)
         end do
         associate (factors => self%preconditioner%around%wave(k + 1, h))
            call factors%reserve(m, maxval([(abs(stiffness(j, j)), j=1, m)]))
            factors%matrix(:m, :m) = cmplx(factors%scale*matrix, kind=kind(factors%matrix))
            call factors%factor()
         end associate
      end do
      associate (differing => self%preconditioner%around%differing(h))
         differing%is_there = .false.
         self%preconditioner%around%own(h)%is_there = .false.
         if (self%preconditioner%tells_sectors) call build_differing(self, h, mean)
         if (.not. differing%is_there) call build_own(self, h)
      end associate
   end subroutine build_harmonic

   !> I + Gamma D of a harmonic.
   subroutine build_own(self, h)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: h
      complex(wp), allocatable :: answer(:, :), gamma(:, :, :), rows(:, :), wave(:, :, :)
      integer :: a, i, info, j, k, n, r

      r = self%problem%structure%n_own()
      n = self%problem%structure%n_alike
      associate (own => self%preconditioner%around%own(h), structure => self%problem%structure)
         own%is_there = r > 0 .and. n*r <= sizes%whole_sectors
         if (.not. own%is_there) return
         if (.not. allocated(own%matrix)) allocate (own%matrix(n*r, n*r), own%pivot(n*r), &
                                                    own%block(r, r, n), own%rows(r, n), &
                                                    own%force(n*r))
         allocate (rows(r, structure%n_slots), answer(structure%n_slots, r))
         allocate (wave(r, r, n), gamma(r, r, n))
         do k = 0, n - 1
            call structure%own_rows(k, rows)
            do a = 1, r
               answer(:, a) = conjg(rows(a, :))
               call self%preconditioner%around%wave(k + 1, h)%solve(answer(:, a))
            end do
            wave(:, :, k + 1) = matmul(rows, answer)
         end do
         gamma = zero
         do i = 0, n - 1
            do k = 0, n - 1
               gamma(:, :, i + 1) = gamma(:, :, i + 1) + wave(:, :, k + 1)/n* &
                  exp(cmplx(0.0_wp, -2.0_wp*pi*modulo(i*k, n)/n, wp))
            end do
         end do
         call structure%own_block(self%structure_state, h, own%block)
         do j = 0, n - 1
            do i = 0, n - 1
               own%matrix(i*r + 1:(i + 1)*r, j*r + 1:(j + 1)*r) = &
                  matmul(gamma(:, :, modulo(i - j, n) + 1), own%block(:, :, j + 1))
            end do
         end do
         do i = 1, n*r
            own%matrix(i, i) = own%matrix(i, i) + one
         end do
         call zgetrf(n*r, n*r, own%matrix, n*r, own%pivot, info)
         own%is_there = info == 0
      end associate
   end subroutine build_own

   !> Take off what they make of the answer of the waves.
   subroutine correct_by_own(self, h)
      class(balance_state), intent(inout) :: self
      integer, intent(in) :: h
      integer :: info, j, m, n, r

      n = self%problem%structure%n_alike
      associate (own => self%preconditioner%around%own(h), factors => self%preconditioner%around, &
                 structure => self%problem%structure)
         r = size(own%rows, 1)
         m = n*r
         call structure%read_own(factors%sectors(:, :, h), own%rows)
         own%force = reshape(own%rows, [m])
         call zgetrs('N', m, 1, own%matrix, m, own%pivot, own%force, m, info)
         do j = 1, n
            own%rows(:, j) = matmul(own%block(:, :, j), own%force((j - 1)*r + 1:j*r))
         end do
         factors%answer(:, :, h) = factors%sectors(:, :, h)
         factors%sectors(:, :, h) = zero
         call structure%add_own(own%rows, factors%sectors(:, :, h))
         call structure%find_waves(factors%sectors(:, :, h), factors%waves(:, :, h))
         do j = 1, n
            call factors%wave(j, h)%solve(factors%waves(:, j, h))
         end do
         call structure%add_waves(factors%waves(:, :, h), factors%sectors(:, :, h))
         factors%sectors(:, :, h) = factors%answer(:, :, h) - factors%sectors(:, :, h)
      end associate
   end subroutine correct_by_own

   !> Of each slot how many coordinates are unknowns of a step, and how stiff stuck pairs hold it.
   subroutine count_active(self, n_active, held)
      class(balance_state), intent(in) :: self
      integer, intent(out) :: n_active(:)
      real(wp), intent(out) :: held(:)
      integer :: c, i, j, k

      n_active = 0
      held = 1.0_wp
      associate (structure => self%problem%structure)
         do j = 1, self%active%n_active
            associate (slot => structure%slot(self%active%used(j)))
               n_active(slot) = n_active(slot) + 1
            end associate
         end do
         do k = 1, self%problem%forces%n_laws
            associate (row => self%problem%forces%entry(k)%row, &
                       p => self%problem%forces%entry(k)%law%prediction)
               if (.not. p%takes_balance) cycle
               do i = 1, size(row, 2)
                  if (.not. p%takes(i)) cycle
                  do c = 1, size(row, 1)
                     if (row(c, i) == 0) cycle
                     held(structure%slot(self%problem%incidence%coordinate_of(row(c, i)))) = &
                        p%stiffness(i, c)
                  end do
               end do
            end associate
         end do
      end associate
   end subroutine count_active

   !> Means of the elements of a sector (elements of a sector).
   subroutine find_means(self, entry, work, h, n_active, mean)
      class(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: h
      integer, intent(in) :: n_active(:)
      type(mean_type), allocatable, intent(out) :: mean(:)
      complex(wp) :: force
      integer :: c_in, c_out, e, i, place
      real(wp) :: share

      allocate (mean(size(entry%row, 2)/self%problem%structure%n_alike))
      if (size(mean) == 0) return
      do i = 1, size(mean)
         allocate (mean(i)%force(size(entry%row, 1), size(entry%row, 1)), source=zero)
         allocate (mean(i)%slope(size(entry%row, 1), size(entry%row, 1)), source=zero)
      end do
      do e = 1, size(entry%row, 2)
         i = modulo(e - 1, size(mean)) + 1
         if (work%linear_state(e) == pair_open) cycle
         do c_out = 1, size(entry%row, 1)
            if (entry%row(c_out, e) == 0) cycle
            associate (j => self%problem%incidence%coordinate_of(entry%row(c_out, e)))
               place = self%active%place(j)
               if (place == 0 .or. place > self%active%n_active) cycle
               share = 1.0_wp/n_active(self%problem%structure%slot(j))
            end associate
            do c_in = 1, size(entry%row, 1)
               if (entry%row(c_in, e) == 0) cycle
               force = share*force_mean(self, work, h, e, c_out, c_in)
               mean(i)%force(c_out, c_in) = mean(i)%force(c_out, c_in) + force
               mean(i)%slope(c_out, c_in) = mean(i)%slope(c_out, c_in) + &
                                            force*input_slope(self, entry, work, h, e, c_in)
            end do
         end do
      end do
   end subroutine find_means

   !> G of an element in a harmonic.
   complex(wp) function force_mean(self, work, h, element, c_out, c_in) result(mean)
      class(balance_state), intent(in) :: self
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: h, element, c_out, c_in

      associate (f => self%problem%fourier)
         if (work%linear_state(element) == pair_mixed) then
            mean = mean_block(work%jacobian(:, :, element), f%harmonic(h), &
                              (c_in - 1)*f%n_coefficients + f%column(h), &
                              (c_out - 1)*f%n_coefficients + f%column(h))
         else
            ! Stuck: each direction transmits what is predicted for it, and nothing else.
            mean = merge(one, zero, c_in == c_out)
         end if
      end associate
   end function force_mean

   !> The input of an element by its displacement.
   complex(wp) function input_slope(self, entry, work, h, element, component) result(slope)
      class(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      type(force_workspace), intent(in) :: work
      integer, intent(in) :: h, element, component
      integer :: n

      associate (p => entry%law%prediction)
         n = self%problem%fourier%harmonic(h)
         slope = cmplx(p%stiffness(element, component), kind=wp)
         if (p%order_of(element, component) > 0 .and. &
             .not. (n == 0 .and. work%linear_rests(element))) then
            slope = slope*cmplx(0.0_wp, self%rate_unit(p, element)*n, wp)
         end if
         if (p%has_inertia) slope = slope*p%impedance_ratio(element, component, n, self%frequency())
      end associate
   end function input_slope

   !> Add what an element adds to a wave.
   subroutine add_mean(self, entry, element, k, mean, stiffness, matrix)
      class(balance_state), intent(in) :: self
      type(force_entry), intent(in) :: entry
      !> Of the first sector.
      integer, intent(in) :: element
      integer, intent(in) :: k
      type(mean_type), intent(in) :: mean
      complex(wp), intent(in) :: stiffness(:, :)
      complex(wp), intent(inout) :: matrix(:, :)
      complex(wp), allocatable :: input(:), output(:)
      integer :: c_in, c_out, i, j, n, n_sectors, row_of(size(entry%row, 1))

      n_sectors = self%problem%structure%n_alike
      row_of = 0
      where (entry%row(:, element) > 0)
         row_of = self%problem%joint%row_in_sector(max(1, entry%row(:, element)))
      end where
      do c_out = 1, size(entry%row, 1)
         if (entry%row(c_out, element) == 0) cycle
         output = conjg(self%problem%joint%wave_weights(n_sectors, k, row_of(c_out)))
         i = self%problem%structure%slot(self%problem%incidence%coordinate_of( &
                                         entry%row(c_out, element)))
         do c_in = 1, size(entry%row, 1)
            if (entry%row(c_in, element) == 0) cycle
            input = self%problem%joint%wave_weights(n_sectors, k, row_of(c_in))
            n = size(input)
            do j = 1, n
               matrix(:n, j) = matrix(:n, j) + output*mean%slope(c_out, c_in)*input(j)
            end do
            if (.not. entry%law%prediction%takes(element)) cycle
            j = self%problem%structure%slot(self%problem%incidence%coordinate_of( &
                                            entry%row(c_in, element)))
            matrix(i, :) = matrix(i, :) - mean%force(c_out, c_in)*stiffness(j, :)
         end do
      end do
   end subroutine add_mean

   module procedure solve_waves
      integer :: j

      associate (in => self%scratch%complex_in(:, h), factors => self%preconditioner%around, &
                 structure => self%problem%structure)
         factors%sectors(:, :, h) = zero
         do j = 1, self%active%n_active
            factors%sectors(structure%slot(self%active%used(j)), &
                            structure%sector(self%active%used(j)), h) = in(j)
         end do
         call structure%find_waves(factors%sectors(:, :, h), factors%waves(:, :, h))
         do j = 1, structure%n_alike
            call factors%wave(j, h)%solve(factors%waves(:, j, h))
         end do
         if (factors%differing(h)%is_there) call factors%differing(h)%take_off( &
            factors%waves(:, :, h))
         call structure%add_waves(factors%waves(:, :, h), factors%sectors(:, :, h))
         if (factors%own(h)%is_there) call correct_by_own(self, h)
         do j = 1, self%active%n_active
            in(j) = factors%sectors(structure%slot(self%active%used(j)), &
                                    structure%sector(self%active%used(j)), h)
         end do
      end associate
   end procedure solve_waves

end submodule fw_balance_waves
