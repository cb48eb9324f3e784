# Headers that most sources of a target include, parsed once: they were over half of what a build took (the library of JSON
# alone is 0.8 s of each source that includes it). A source names all the headers it needs even so: tests/house/check_headers
# compiles headers without these.
set(texmesh_std_headers <algorithm> <array> <cmath> <cstdint> <functional> <map> <memory> <optional> <set> <span> <string>
  <string_view> <utility> <vector>)

# What all sources pay for, even those that name no JSON, is what g++ leaves for the end of each: templates that inline functions call.
set(texmesh_json_header ${PROJECT_SOURCE_DIR}/cmake/json_without_literals.h)

function(texmesh_precompile target)  # target, then headers beside those of the standard library
  target_precompile_headers(${target} PRIVATE ${texmesh_std_headers} ${ARGN})
endfunction()

# Sources that run once a command, and never once a vertex or texel: what -O1 leaves out of them nobody can measure, and it
# takes two thirds of the time to compile. With -O1 g++ 12 sees more overflows that are not there (CMakeLists.txt).
function(texmesh_optimise_little)  # sources
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "-O1;-Wno-array-bounds")
endfunction()
