# What the library is linked with; read by the build and by the installed package alike, so that
# the list exists once. The caller has this directory in CMAKE_MODULE_PATH.
include(CMakeFindDependencyMacro)

# OpenBLAS where it is installed (its thread count can be set from within), any other otherwise.
# Where several builds of OpenBLAS are installed, the one with its own threads is taken: the
# OpenMP build would start a team inside each thread of this library's own parallel loops.
if(CMAKE_LIBRARY_ARCHITECTURE)
  list(APPEND CMAKE_LIBRARY_PATH "/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/openblas-pthread")
endif()
if(NOT BLA_VENDOR)
  set(BLA_VENDOR OpenBLAS)
  find_package(LAPACK QUIET)
  if(NOT LAPACK_FOUND)
    unset(BLA_VENDOR)
  endif()
endif()
find_dependency(LAPACK)
find_dependency(OpenMP COMPONENTS Fortran)
# What a transform of many harmonics goes through: `fftw`, or `none` for matrix products alone.
if(NOT FRETWEAR_FFT STREQUAL "none")
  find_dependency(FFTW3)
endif()
find_dependency(MINPACK)
find_dependency(HDF5 COMPONENTS Fortran)
# A static library of the Fortran part needs the C part and what that needs behind it.
set_property(TARGET hdf5::hdf5_fortran APPEND PROPERTY
  INTERFACE_LINK_LIBRARIES ${HDF5_Fortran_LIBRARIES})
set(fretwear_sundials fcvode farkode fida fkinsol
  fnvecserial fsunmatrixdense fsunlinsoldense fsunlinsolspgmr)
find_dependency(SUNDIALSFortran COMPONENTS ${fretwear_sundials})
