# FFTW 3 in double precision, with its Fortran 2003 interface: target FFTW3::fftw3.
# FFTW's own CMake package exists only where it was built with CMake, so it is looked for here.
find_path(FFTW3_INCLUDE_DIR NAMES fftw3.f03)
find_library(FFTW3_LIBRARY NAMES fftw3)
mark_as_advanced(FFTW3_INCLUDE_DIR FFTW3_LIBRARY)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(FFTW3 REQUIRED_VARS FFTW3_LIBRARY FFTW3_INCLUDE_DIR)

if(FFTW3_FOUND AND NOT TARGET FFTW3::fftw3)
  add_library(FFTW3::fftw3 UNKNOWN IMPORTED)
  set_target_properties(FFTW3::fftw3 PROPERTIES
    IMPORTED_LOCATION "${FFTW3_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${FFTW3_INCLUDE_DIR}")
endif()
