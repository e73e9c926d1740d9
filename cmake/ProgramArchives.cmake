# Archives of what the program uses of SUNDIALS, MINPACK, FFTW and HDF5, where all of them are
# installed: a program with these inside starts in a quarter of the time (3.5 ms against 13 with
# Debian 12, where the shared HDF5 brings the libraries of four network protocols). With the archives
# of OpenBLAS and of gfortran's library it starts in half of that again: the shared ones look up
# twelve thousand symbols, mostly their own. Such an OpenBLAS chooses its kernel by the processor all
# the same; FRETWEAR_ARCHIVES=OFF leaves the BLAS to whoever runs the program.
#
# Sets fretwear_archives, empty where one is missing or the program does not link with them,
# fretwear_blas_archive, which is fretwear_blas then, and fretwear_archive_options.
set(fretwear_archives "")
set(fretwear_blas_archive ${fretwear_blas})
set(fretwear_archive_options "")
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
  # OpenBLAS of the system, where it is one for every processor. Its own functions are asked for
  # softly (blas_kernel.c), which takes nothing out of an archive: they are asked for here.
  list(GET fretwear_blas_files 0 _blas)
  string(REGEX REPLACE "\\.so$" ".a" _archive "${_blas}")
  if(FRETWEAR_BLAS STREQUAL "system" AND _archive MATCHES "openblas[^/]*\\.a$" AND
     EXISTS "${_archive}" AND CMAKE_Fortran_COMPILER_ID STREQUAL "GNU")
    set(_asked "")
    foreach(_name get_config get_corename get_num_threads set_num_threads)
      list(APPEND _asked "LINKER:-u,openblas_${_name}")
    endforeach()
    find_package(Threads REQUIRED)
    # Its threads heed app/idle_threads.c only where it starts after that.
    execute_process(COMMAND "${CMAKE_Fortran_COMPILER}" -print-file-name=libgomp.a
      OUTPUT_VARIABLE _gomp OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(IS_ABSOLUTE "${_gomp}")
      list(PREPEND _archive "${_gomp}")
    endif()
    if(NOT DEFINED FRETWEAR_BLAS_ARCHIVE_LINK)
      try_compile(FRETWEAR_BLAS_ARCHIVE_LINK "${PROJECT_BINARY_DIR}/archives"
        SOURCES "${CMAKE_CURRENT_LIST_DIR}/blas_archive.f90"
        LINK_OPTIONS ${_asked} -static-libgfortran -static-libgcc
        LINK_LIBRARIES ${_archive} Threads::Threads ${CMAKE_DL_LIBS})
    endif()
    if(FRETWEAR_BLAS_ARCHIVE_LINK)
      set(fretwear_blas_archive ${_archive} Threads::Threads ${CMAKE_DL_LIBS})
      set(fretwear_archive_options ${_asked} -static-libgfortran -static-libgcc)
    endif()
  endif()
else()
  message(STATUS "Archives do not link: the program is linked with shared libraries")
endif()
