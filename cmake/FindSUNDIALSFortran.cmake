# The Fortran 2003 interfaces of SUNDIALS: one target SUNDIALSFortran::<component> each, such as
# fcvode or fnvecserial. The package that SUNDIALS installs cannot be used everywhere: Debian's
# names an include directory that does not exist.
find_path(SUNDIALSFortran_INCLUDE_DIR NAMES fcvode_mod.mod
  PATH_SUFFIXES sundials/fortran fortran)
mark_as_advanced(SUNDIALSFortran_INCLUDE_DIR)

set(_required SUNDIALSFortran_INCLUDE_DIR)
foreach(_component IN LISTS SUNDIALSFortran_FIND_COMPONENTS)
  find_library(SUNDIALSFortran_${_component}_LIBRARY NAMES sundials_${_component}_mod)
  mark_as_advanced(SUNDIALSFortran_${_component}_LIBRARY)
  list(APPEND _required SUNDIALSFortran_${_component}_LIBRARY)
  if(SUNDIALSFortran_${_component}_LIBRARY AND SUNDIALSFortran_INCLUDE_DIR)
    set(SUNDIALSFortran_${_component}_FOUND TRUE)
  endif()
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(SUNDIALSFortran
  REQUIRED_VARS ${_required} HANDLE_COMPONENTS)

if(SUNDIALSFortran_FOUND)
  foreach(_component IN LISTS SUNDIALSFortran_FIND_COMPONENTS)
    if(NOT TARGET SUNDIALSFortran::${_component})
      add_library(SUNDIALSFortran::${_component} UNKNOWN IMPORTED)
      set_target_properties(SUNDIALSFortran::${_component} PROPERTIES
        IMPORTED_LOCATION "${SUNDIALSFortran_${_component}_LIBRARY}"
        INTERFACE_INCLUDE_DIRECTORIES "${SUNDIALSFortran_INCLUDE_DIR}")
    endif()
  endforeach()
endif()
unset(_required)
unset(_component)
