!> Sizes from which on another way is the faster one, or up to which one is possible at all, in one
!> place. They change times, and digits at the round-off; what halving and doubling each of them
!> changes is in docs/robustness/thresholds.md. Sizes of blocks and panels stand beside their
!> loops.
module fw_size_options
   implicit none (type, external)
   private

   public :: sizes

   type :: size_options
      ! LU or GMRES.
      !> Unknowns up to which LU is taken in a step. GMRES has become the faster from about half of
      !> them on (docs/benchmarks.md); LU needs no preconditioner that serves.
      integer :: lu_of_step = 60
      !> Unknowns up to which LU is tried where GMRES has failed: above, it costs too much.
      integer :: lu_possible = 600
      !> Unknowns up to which LU is taken along a branch: it costs no more than the dozens of Krylov
      !> iterations that tangents and resonances take, and its factors tell the orientation.
      integer :: lu_of_branch = 400
      !> Unknowns up to which the orientation of a branch is looked at: it takes the LU factors of
      !> the whole derivative, which beyond cost more than the points of the branch.
      integer :: orientation = 1000
      !> Unknowns up to which one LU serves all derivatives of a point, and the slopes of its curve.
      integer :: lu_of_slopes = 600

      ! Matrices of all sectors, and of the whole.
      !> Coordinates of all sectors up to which matrices of all of them are factored: each takes a
      !> second or so.
      integer :: whole_sectors = 1500
      !> Unknowns of a mode whose dense factorization takes seconds and below 1 GB, and dofs whose
      !> linear modes take as long; both grow fast.
      integer :: unknowns_of_mode = 6000, dofs_of_mode = 3000
      !> Dofs up to which the modes of a reduction are kept: they take no room worth mentioning.
      integer :: kept_basis = 400

      ! Single precision and shared factors.
      !> Coordinates from which copies of matrices in single precision pay (python -m bench.run
      !> scaling, peers; bench/speed/sectors.py).
      integer :: single_matrices = 48
      !> Numbers in the derivatives of all elements from which copies in single precision pay:
      !> those of 16 pairs and 15 harmonics, a megabyte.
      integer :: single_blocks = 125000
      !> Active coordinates from which one matrix for all harmonics is faster than one for each.
      integer :: alike_harmonics = 16
   end type size_options

   type(size_options), parameter :: sizes = size_options()

end module fw_size_options
