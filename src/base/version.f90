!> The version of the library, written into every result file.
module fw_version
   implicit none (type, external)
   private

   public :: version

   !> Semantic version: major.minor.patch.
   character(*), parameter :: version = '0.1.0'

end module fw_version
