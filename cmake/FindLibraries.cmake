# Libraries that Debian installs without CMake files of use: a find module each, in one line.
include(FindPackageHandleStandardArgs)

# Looks for a header and libraries, and makes the target <package>::<target> of them. A macro, since a find module sets variables of
# its caller.
macro(texmesh_find_libraries package target header)  # libraries
  find_path(${package}_INCLUDE_DIR ${header})
  set(${package}_VARIABLES)
  set(${package}_LIBRARIES)
  foreach(library ${ARGN})
    find_library(${package}_${library}_LIBRARY ${library})
    list(APPEND ${package}_VARIABLES ${package}_${library}_LIBRARY)
    list(APPEND ${package}_LIBRARIES ${${package}_${library}_LIBRARY})
  endforeach()
  find_package_handle_standard_args(${package} REQUIRED_VARS ${${package}_VARIABLES} ${package}_INCLUDE_DIR)
  if(${package}_FOUND AND NOT TARGET ${package}::${target})
    add_library(${package}::${target} INTERFACE IMPORTED)
    target_include_directories(${package}::${target} SYSTEM INTERFACE ${${package}_INCLUDE_DIR})
    target_link_libraries(${package}::${target} INTERFACE ${${package}_LIBRARIES})
  endif()
endmacro()
