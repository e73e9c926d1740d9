# MINPACK as netlib has it (Moré, Garbow, Hillstrom 1980), Fortran 77: target MINPACK::minpack.
find_library(MINPACK_LIBRARY NAMES minpack)
mark_as_advanced(MINPACK_LIBRARY)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(MINPACK REQUIRED_VARS MINPACK_LIBRARY)

if(MINPACK_FOUND AND NOT TARGET MINPACK::minpack)
  add_library(MINPACK::minpack UNKNOWN IMPORTED)
  set_target_properties(MINPACK::minpack PROPERTIES IMPORTED_LOCATION "${MINPACK_LIBRARY}")
endif()
