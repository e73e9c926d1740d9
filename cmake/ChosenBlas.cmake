# Which BLAS: that of the system, or the newer OpenBLAS of the Python package scipy-openblas32,
# whose names all begin with scipy_. FRETWEAR_BLAS = auto takes the latter where it is installed and
# the system's one runs a kernel below what the processor can do.
#
# Sets fretwear_blas, what to link, and fretwear_blas_names, a source with the usual names of
# what src/math/lapack.f90 calls (empty for the system's BLAS).
set(fretwear_blas LAPACK::LAPACK BLAS::BLAS)
set(fretwear_blas_files ${LAPACK_LIBRARIES} ${BLAS_LIBRARIES})
set(fretwear_blas_names "")
if(NOT FRETWEAR_BLAS MATCHES "^(auto|system|scipy)$")
  message(FATAL_ERROR "FRETWEAR_BLAS = ${FRETWEAR_BLAS}: one of auto, system, scipy")
endif()
if(FRETWEAR_BLAS STREQUAL "system")
  return()
endif()

# Its kernel, as it would run here.
if(FRETWEAR_BLAS STREQUAL "auto")
  set(_probe "${PROJECT_BINARY_DIR}/blas_probe")
  if(NOT EXISTS "${_probe}")
    try_compile(_linked "${PROJECT_BINARY_DIR}/blas_probe_files"
      SOURCES "${PROJECT_SOURCE_DIR}/src/base/blas.f90" "${PROJECT_SOURCE_DIR}/cmake/blas_probe.f90"
        "${PROJECT_SOURCE_DIR}/src/base/blas_kernel.c"
      LINK_LIBRARIES ${fretwear_blas} COPY_FILE "${_probe}")
  endif()
  set(_said "")
  if(EXISTS "${_probe}")
    execute_process(COMMAND "${_probe}" OUTPUT_VARIABLE _said OUTPUT_STRIP_TRAILING_WHITESPACE
      ERROR_QUIET)
  endif()
  if(NOT _said MATCHES "^slow")
    return()
  endif()
endif()

find_package(Python3 3.9 QUIET COMPONENTS Interpreter)
set(_place "")
if(Python3_Interpreter_FOUND)
  execute_process(COMMAND "${Python3_EXECUTABLE}" -c
    "import scipy_openblas32 as s; print(s.get_lib_dir() + '/lib' + s.get_library() + '.so')"
    OUTPUT_VARIABLE _place OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(NOT _place OR NOT EXISTS "${_place}")
  if(FRETWEAR_BLAS STREQUAL "scipy")
    message(FATAL_ERROR "FRETWEAR_BLAS = scipy: ${Python3_EXECUTABLE} has no package \
scipy-openblas32; install it there, or run make BLAS=scipy")
  endif()
  string(REPLACE "slow: " "" _said "${_said}")
  message(WARNING "The BLAS of the system runs its kernel ${_said}, which this processor could run: \
make BLAS=scipy builds with a newer one")
  return()
endif()
if(NOT CMAKE_SYSTEM_NAME STREQUAL "Linux" OR
   NOT CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|aarch64)$")
  message(FATAL_ERROR "FRETWEAR_BLAS = scipy: on Linux, x86-64 or aarch64, alone")
endif()

# The usual names, each a jump to the one of the package.
file(STRINGS "${PROJECT_SOURCE_DIR}/src/math/lapack.f90" _lines
  REGEX "^ *(pure )?(subroutine|.*function) +[a-z0-9]+ *\\(")
set(_aliases "")
foreach(_line IN LISTS _lines)
  string(REGEX REPLACE "^.*(subroutine|function) +([a-z0-9]+) *\\(.*$" "\\2" _name "${_line}")
  string(APPEND _aliases "ALIAS(${_name}_)\n")
endforeach()
foreach(_name get_config get_corename get_num_threads set_num_threads)
  string(APPEND _aliases "ALIAS(openblas_${_name})\n")
endforeach()
set(fretwear_blas_names "${PROJECT_BINARY_DIR}/blas_names.c")
configure_file("${PROJECT_SOURCE_DIR}/cmake/blas_names.c.in" "${fretwear_blas_names}" @ONLY)
set_property(DIRECTORY "${PROJECT_SOURCE_DIR}" APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  "${PROJECT_SOURCE_DIR}/src/math/lapack.f90")
set(fretwear_blas "${_place}")
set(fretwear_blas_files "${_place}")
set(CMAKE_INSTALL_RPATH_USE_LINK_PATH ON)
message(STATUS "BLAS: ${_place}")
