!> The patches that contact pairs belong to.
module fw_patches
   use fw_contact_data, only: contact_type
   use fw_kinds, only: wp
   use fw_text, only: string_type
   use fw_text_list, only: append
   implicit none (type, external)
   private

   public :: number_patches, count_patches, patch_volumes

contains

   !> Patches in the order of their first pair; without names all pairs form one.
   pure subroutine number_patches(contact, patches, patch_of)
      type(contact_type), intent(in) :: contact
      type(string_type), allocatable, intent(out) :: patches(:)
      !> Number of the patch of every pair (n_pairs).
      integer, allocatable, intent(out) :: patch_of(:)
      integer :: i, k

      allocate (patches(0))
      allocate (patch_of(contact%n_pairs), source=1)
      if (.not. allocated(contact%patch)) then
         call append(patches, 'all')
         return
      end if
      do i = 1, contact%n_pairs
         do k = 1, size(patches)
            if (patches(k)%text == contact%patch(i)%text) exit
         end do
         patch_of(i) = k
         if (k > size(patches)) call append(patches, contact%patch(i)%text)
      end do
   end subroutine number_patches

   !> How many volumes a row of a wear run has.
   pure integer function count_patches(contact) result(n)
      type(contact_type), intent(in) :: contact
      type(string_type), allocatable :: patches(:)
      integer, allocatable :: patch_of(:)

      call number_patches(contact, patches, patch_of)
      n = size(patches)
   end function count_patches

   !> Worn volume of every patch (n_patches) [length**3].
   pure function patch_volumes(contact, depth) result(volume)
      type(contact_type), intent(in) :: contact
      !> Wear depth of every pair (n_pairs) [length].
      real(wp), intent(in) :: depth(:)
      real(wp), allocatable :: volume(:)
      type(string_type), allocatable :: patches(:)
      integer, allocatable :: patch_of(:)
      integer :: k

      call number_patches(contact, patches, patch_of)
      allocate (volume(size(patches)))
      do k = 1, size(patches)
         volume(k) = sum(contact%area*depth, mask=patch_of == k)
      end do
   end function patch_volumes

end module fw_patches
