!> All sectors at once: bases of all nodal diameters, and the numbers of the coordinates.
submodule(fw_all_sectors) fw_all_sectors_setup
   use fw_cyclic_data, only: nodal_matrices, nodal_speed
   use fw_ring_deviation, only: new_ring_deviation
   use fw_sector, only: sector_at, speed_at
   implicit none (type, external)

contains

   module procedure new_all_sectors
      logical :: keeps_all

      keeps_all = .false.
      if (present(keep_all)) keeps_all = keep_all
      call lay_out_coefficients(self, harmonic)
      self%cyclic%n_sectors = model%cyclic%n_sectors
      self%cyclic%engine_order = model%cyclic%engine_order
      self%n_alike = self%cyclic%n_sectors
      self%n_relative = self%n_alike*relative%n_coordinates
      self%n_observed = self%n_alike*size(model%observe_matrix, 1)
      call find_bases(model, relative, omega_range, keeps_all, self, error)
      if (allocated(error)) return
      ! With a speed that follows the frequency they would be those of one.
      if (.not. allocated(model%cyclic%speed)) call find_norms(self)
      if (present(tuned)) then
         ! The stiffness of rigid laws is that of the tuned disk, whose rows nothing holds.
         call self%means%take(model, tuned, means, [sector_reduction ::], error)
         if (allocated(error)) return
         allocate (self%deviation)
         call new_ring_deviation(model%cyclic%deviation, model%cyclic, relative, self%deviation)
      else
         call self%means%take(model, relative, means, self%basis, error)
         if (allocated(error)) return
      end if
      call self%ring%plan(self%n_slots, self%n_alike)
      call self%observed_ring%plan(size(model%observe_matrix, 1), self%n_alike)
   end procedure new_all_sectors

   !> Norms of K and M, of which `magnitudes` takes the largest of each entry over the nodal
   !> diameters: no larger than all of them together.
   pure subroutine find_norms(self)
      type(all_sectors), intent(inout) :: self
      real(wp) :: squares(2)
      integer :: h, k

      squares = 0.0_wp
      do k = 1, size(self%basis)
         squares = squares + self%basis(k)%norms()**2
      end do
      allocate (self%norms(2, size(self%harmonic)))
      do h = 1, size(self%harmonic)
         self%norms(:, h) = sqrt(squares)
      end do
   end subroutine find_norms

   !> A basis for each nodal diameter, with coordinates at places that all share.
   subroutine find_bases(model, relative, omega_range, keeps_all, self, error)
      type(model_type), intent(in) :: model
      type(cyclic_relative), intent(in) :: relative
      real(wp), intent(in) :: omega_range(2)
      logical, intent(in) :: keeps_all
      type(all_sectors), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(nodal_matrices), allocatable :: nodal(:)
      type(nodal_speed) :: speed
      integer, allocatable :: slot(:)
      integer :: i, k, n, n_kept

      n = self%n_alike/2
      allocate (self%basis(n + 1), nodal(n + 1))
      n_kept = 0
      do k = 0, n
         call require_diameter(model, k, error)
         if (.not. allocated(error)) call sector_at(model, k, nodal(k + 1), error)
         if (allocated(model%cyclic%speed) .and. .not. allocated(error)) then
            ! Nothing is condensed at a speed that follows the frequency.
            call self%basis(k + 1)%keep_dofs(k, size(nodal(k + 1)%mass, 1), relative%at(k + 1))
            n_kept = max(n_kept, size(self%basis(k + 1)%kept))
            cycle
         end if
         if (.not. allocated(error)) then
            call self%basis(k + 1)%find_modes(k, nodal(k + 1), relative%at(k + 1), error)
         end if
         if (.not. allocated(error) .and. k == 0) then
            if (self%basis(1)%pushes_free_mode(nodal(1)) .and. &
                .not. allocated(nodal(1)%circulatory)) call fatal_error(error, &
               '&load static pushes a part of the sectors that neither stiffness nor contact '// &
               'holds; hold it or remove the load', status_input)
         end if
         if (allocated(error)) return
         if (allocated(nodal(k + 1)%circulatory) .or. keeps_all) then
            call self%basis(k + 1)%keep_all()
         else
            call self%basis(k + 1)%keep_resonances(self%harmonic, omega_range, &
                                                   nodal(k + 1)%has_whirl(), nodal(k + 1))
         end if
         n_kept = max(n_kept, size(self%basis(k + 1)%kept))
      end do
      call number_coordinates(relative%n_coordinates, n_kept, self)
      do k = 0, n
         ! Kept modes stand behind the relative coordinates.
         slot = [relative%slots(k), (relative%n_coordinates + i, &
                                     i=1, size(self%basis(k + 1)%kept))]
         if (allocated(model%cyclic%speed)) then
            call speed_at(model, k, speed)
            call self%basis(k + 1)%take_speed(speed, self%n_slots, slot)
         end if
         call self%basis(k + 1)%transform(nodal(k + 1), slot, self%n_slots)
      end do
   end subroutine find_bases

   !> Refuse what the model does not hold of a nodal diameter: all of them take part.
   subroutine require_diameter(model, k, error)
      type(model_type), intent(in) :: model
      integer, intent(in) :: k
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: forward(:, :), backward(:, :)

      if (.not. model%cyclic%holds(k)) then
         call fatal_error(error, '&cyclic mistuned = .true.: every nodal diameter takes part, '// &
                          'and the model holds no matrices of '//to_text(k)//': must have '// &
                          '/nodal_diameter/'//to_text(k), status_input)
         return
      end if
      if (.not. allocated(model%cyclic%air)) return
      call model%cyclic%air_stiffness(k, forward)
      call model%cyclic%air_stiffness(-k, backward)
      if (allocated(forward) .and. allocated(backward)) return
      call fatal_error(error, '&cyclic mistuned = .true.: every nodal diameter takes part, and '// &
                       'the model holds no forces of the air of '// &
                       to_text(merge(-k, k, allocated(forward)))//': must have '// &
                       '/aero/nodal_diameter of all', status_input)
   end subroutine require_diameter

   !> Relative coordinates of all sectors stand before all kept modes.
   subroutine number_coordinates(n_relative, n_kept, self)
      integer, intent(in) :: n_relative, n_kept
      type(all_sectors), intent(inout) :: self
      !> More than a choice of modes that is told from another needs.
      integer, parameter :: many = 997
      integer :: c, j, k, label

      self%n_slots = n_relative + n_kept
      self%n_coordinates = self%n_alike*self%n_slots
      allocate (self%coordinate(self%n_slots, self%n_alike))
      allocate (self%slot(self%n_coordinates), self%sector(self%n_coordinates))
      do j = 1, self%n_alike
         self%coordinate(:n_relative, j) = [((j - 1)*n_relative + c, c=1, n_relative)]
         self%coordinate(n_relative + 1:, j) = [(self%n_relative + (j - 1)*n_kept + c, c=1, n_kept)]
         self%slot(self%coordinate(:, j)) = [(c, c=1, self%n_slots)]
         self%sector(self%coordinate(:, j)) = j
      end do
      ! A place stands for other modes where other modes are kept.
      label = 0
      do k = 1, size(self%basis)
         do c = 1, size(self%basis(k)%kept)
            label = modulo(31*label + k*self%basis(k)%kept(c) + c, many)
         end do
      end do
      self%kept = [(label*self%n_alike*n_kept + c, c=1, self%n_alike*n_kept)]
   end subroutine number_coordinates

end submodule fw_all_sectors_setup
