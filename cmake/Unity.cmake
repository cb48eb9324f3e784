# With TEXMESH_UNITY, several sources of a room are compiled as one: most of a source's time goes into headers that its
# neighbours include, too. A change of a source then compiles its neighbours again, so this is for builds that are made once.
# No name of a source clashes with a neighbour's: tests/house/check_unity.
option(TEXMESH_UNITY "Compile several sources of a room as one: a faster build, a slower change" OFF)
set(texmesh_unity_most 14)  # sources of a unit
set(texmesh_unity_bytes 140000)  # of a unit's sources, about: 12 CPU seconds; two of half the bytes take 2 or 3 more

# Shares the sources of a room evenly among units, by their bytes. Units are named after the room. CMake leaves sources with
# options of their own out of units; so the units get these options (texmesh_optimise_little).
function(texmesh_unity_room target room options)  # sources
  list(LENGTH ARGN count)
  set(bytes 0)
  foreach(source ${ARGN})
    file(SIZE ${source} size)
    math(EXPR bytes "${bytes} + ${size}")
  endforeach()
  math(EXPR units "(${count} + ${texmesh_unity_most} - 1) / ${texmesh_unity_most}")
  math(EXPR units_by_bytes "(${bytes} + ${texmesh_unity_bytes} - 1) / ${texmesh_unity_bytes}")
  if(units_by_bytes GREATER units)
    set(units ${units_by_bytes})
  endif()
  set(at 0)
  foreach(source ${ARGN})
    math(EXPR unit "${at} * ${units} / ${bytes}")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${room}_${unit})
    if(options)
      set_property(SOURCE ${source} PROPERTY COMPILE_OPTIONS)
      set_source_files_properties(${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${target}.dir/Unity/unity_${room}_${unit}_cxx.cxx
        PROPERTIES COMPILE_OPTIONS "${options}")
    endif()
    file(SIZE ${source} size)
    math(EXPR at "${at} + ${size}")
  endforeach()
endfunction()

# Sources that take as long as a unit: each is a unit.
function(texmesh_unity_apart)  # sources
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# To be called when the properties of all sources are set.
function(texmesh_unity target)
  if(NOT TEXMESH_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  # g++ takes the sources of a unit for headers. It sees more overflows that are not there, too (CMakeLists.txt).
  target_compile_options(${target} PRIVATE -Wno-subobject-linkage -Wno-array-bounds -Wno-stringop-overread)
  get_target_property(sources ${target} SOURCES)
  set(rooms)
  foreach(source ${sources})
    file(REAL_PATH ${source} source)
    file(STRINGS ${source} macro REGEX "^#define " LIMIT_COUNT 1)
    get_source_file_property(options ${source} COMPILE_OPTIONS)
    get_source_file_property(alone ${source} SKIP_PRECOMPILE_HEADERS)
    get_source_file_property(apart ${source} SKIP_UNITY_BUILD_INCLUSION)
    if(macro OR alone OR apart)  # would reach the neighbours, is compiled in another way, or takes as long as a unit
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      continue()
    endif()
    file(RELATIVE_PATH path ${PROJECT_SOURCE_DIR} ${source})
    string(REGEX MATCH "^(delivery/cpp|tests/[^/]*|[^/]*)/[^/]*" room ${path})
    string(REPLACE "/" "_" room ${room})
    if(room MATCHES "\\.cpp$")
      set(room ${target})
    endif()
    if(options)
      string(APPEND room _little)
    endif()
    list(APPEND rooms ${room})
    list(APPEND sources_of_${room} ${source})
    set(options_of_${room} "${options}")
  endforeach()
  list(REMOVE_DUPLICATES rooms)
  foreach(room ${rooms})
    texmesh_unity_room(${target} ${room} "${options_of_${room}}" ${sources_of_${room}})
  endforeach()
endfunction()
