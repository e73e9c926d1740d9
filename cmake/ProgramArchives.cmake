# Archives of what the program uses of SUNDIALS, MINPACK, FFTW and HDF5, where all of them are
# installed: a program with these inside starts in a quarter of the time (3.5 ms against 13 with
# Debian 12, where the shared HDF5 brings the libraries of four network protocols). BLAS stays
# shared, because it is chosen by the processor and by whoever runs the program.
#
# Sets fretwear_archives, empty where one is missing or the program does not link with them.
set(fretwear_archives "")
if(NOT FRETWEAR_ARCHIVES OR FRETWEAR_SANITIZE OR NOT CMAKE_SYSTEM_NAME STREQUAL "Linux")
  return()
endif()

set(_shared "")
foreach(_component IN LISTS fretwear_sundials)
  list(APPEND _shared "${SUNDIALSFortran_${_component}_LIBRARY}")
endforeach()
foreach(_name cvode arkode ida kinsol nvecserial sunmatrixdense sunlinsoldense sunlinsolspgmr)
  get_filename_component(_directory "${SUNDIALSFortran_fcvode_LIBRARY}" DIRECTORY)
  list(APPEND _shared "${_directory}/libsundials_${_name}.so")
endforeach()
set(_hdf5 ${HDF5_Fortran_LIBRARIES})
list(FILTER _hdf5 INCLUDE REGEX "hdf5[^/]*$")
list(APPEND _shared ${MINPACK_LIBRARY} ${FFTW3_LIBRARY} ${_hdf5})
set(_archives "")
foreach(_library IN LISTS _shared)
  string(REGEX REPLACE "\\.so$" ".a" _archive "${_library}")
  if(NOT EXISTS "${_archive}" OR NOT _archive MATCHES "\\.a$")
    message(STATUS "No archive of ${_library}: the program is linked with shared libraries")
    return()
  endif()
  list(APPEND _archives "${_archive}")
endforeach()

# SUNDIALS' archives need one another in both directions; that of HDF5 needs its compression.
set(_below ${HDF5_Fortran_LIBRARIES})
list(FILTER _below EXCLUDE REGEX "hdf5[^/]*$")
set(_archives "-Wl,--start-group" ${_archives} "-Wl,--end-group" ${_below} ${CMAKE_DL_LIBS})
if(NOT DEFINED FRETWEAR_ARCHIVES_LINK)
  try_compile(FRETWEAR_ARCHIVES_LINK "${PROJECT_BINARY_DIR}/archives"
    SOURCES "${CMAKE_CURRENT_LIST_DIR}/archives.f90"
    CMAKE_FLAGS "-DINCLUDE_DIRECTORIES=${SUNDIALSFortran_INCLUDE_DIR};${HDF5_Fortran_INCLUDE_DIRS}"
    LINK_OPTIONS "LINKER:--as-needed"
    LINK_LIBRARIES ${_archives} LAPACK::LAPACK BLAS::BLAS)
endif()
if(FRETWEAR_ARCHIVES_LINK)
  set(fretwear_archives ${_archives})
else()
  message(STATUS "Archives do not link: the program is linked with shared libraries")
endif()
