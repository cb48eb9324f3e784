# Coverage-guided fuzzing of all readers: `cmake --preset fuzz`, or tests/fuzz/run. The same targets run in
# system_fuzz_replay_test without a fuzzer.
file(GLOB fuzz CONFIGURE_DEPENDS fuzz/*.cpp)
set(targets ${fuzz})
list(FILTER targets EXCLUDE REGEX "fuzz_main\\.cpp$|mutator_module\\.cpp$")
target_sources(system_tests PRIVATE ${targets})
target_link_libraries(system_tests PRIVATE draco::draco meshoptimizer::meshoptimizer ${CMAKE_DL_LIBS})
if(NOT TEXMESH_FUZZ)
  return()
endif()
# The rooms that read foreign bytes, and what these need, beside format: all of the project with sanitizers takes half an hour to build.
set(rooms delivery/cpp/decide delivery/cpp/http delivery/cpp/package stages/base stages/data stages/fragment_codec stages/gltf stages/image
  stages/jpeg pipeline/about pipeline/batch/memo pipeline/cache pipeline/graph pipeline/import pipeline/io)
set(sources)
foreach(room ${rooms})
  file(GLOB_RECURSE found CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${room}/*.cpp)
  list(APPEND sources ${found})
endforeach()
foreach(name batch/build_memo batch/fleet/run_summary batch/plan compile/options compile/workers/worker_pool)
  list(APPEND sources ${PROJECT_SOURCE_DIR}/pipeline/${name}.cpp)
endforeach()
list(APPEND sources ${PROJECT_SOURCE_DIR}/stages/geometry/mesh_topology.cpp ${PROJECT_SOURCE_DIR}/stages/geometry/texel_coverage.cpp
  ${PROJECT_SOURCE_DIR}/stages/zim/zim.cpp)
list(FILTER sources EXCLUDE REGEX "/stages/image/readers_module/module")
# Sections: what only other targets or stages call is not linked, and
# its counters with it, with lld alone.
add_library(texmesh_fuzz STATIC EXCLUDE_FROM_ALL ${sources})
target_compile_definitions(texmesh_fuzz PRIVATE TEXMESH_VERSION="${PROJECT_VERSION}")
target_compile_options(texmesh_fuzz PRIVATE -fPIE -O2 -ffunction-sections -fdata-sections)
set_target_properties(texmesh_fuzz PROPERTIES POSITION_INDEPENDENT_CODE OFF)
target_link_libraries(texmesh_fuzz PUBLIC texmesh_format Nettle::nettle ZLIB::ZLIB nlohmann_json::nlohmann_json CURL::libcurl
  TBB::tbb Eigen3::Eigen WebP::webp avif zstd::libzstd_shared Utf8proc::utf8proc draco::draco meshoptimizer::meshoptimizer JPEG::JPEG PNG::PNG fmt::fmt OpenImageIO::OpenImageIO
  ${CMAKE_DL_LIBS})
texmesh_precompile(texmesh_fuzz <filesystem> <sstream> ${texmesh_json_header})
texmesh_unity(texmesh_fuzz)
# Nothing of it, and of the copies of readers in it, is seen from outside: the program's own functions stay those with sanitizers.
file(GLOB_RECURSE copies ${PROJECT_SOURCE_DIR}/format/base/*.cpp ${PROJECT_SOURCE_DIR}/format/container/*.cpp)
add_library(texmesh_fuzz_mutator SHARED EXCLUDE_FROM_ALL fuzz/mutate.cpp fuzz/mutator_module.cpp ${copies}
  ${PROJECT_SOURCE_DIR}/format/documents/index.cpp ${PROJECT_SOURCE_DIR}/stages/gltf/glb_container.cpp)
target_include_directories(texmesh_fuzz_mutator PRIVATE ${PROJECT_SOURCE_DIR})
target_compile_options(texmesh_fuzz_mutator PRIVATE -fno-sanitize=all -O2)
target_link_options(texmesh_fuzz_mutator PRIVATE -fno-sanitize=all -static-libstdc++ LINKER:-Bsymbolic LINKER:--version-script=${CMAKE_CURRENT_SOURCE_DIR}/fuzz/mutator_module.map)
target_link_libraries(texmesh_fuzz_mutator PRIVATE Nettle::nettle ZLIB::ZLIB nlohmann_json::nlohmann_json fmt::fmt)
add_custom_target(texmesh_fuzzers)
foreach(file ${targets})
  if(NOT file MATCHES "/([a-z]+)_targets\\.cpp$")
    continue()
  endif()
  set(program texmesh_fuzz_${CMAKE_MATCH_1})
  add_executable(${program} EXCLUDE_FROM_ALL ${file} fuzz/fuzz_main.cpp fuzz/fuzz_target.cpp fuzz/regressions.cpp)
  target_compile_definitions(${program} PRIVATE TEXMESH_FUZZ_ROOM=add_${CMAKE_MATCH_1}_targets)
  target_compile_options(${program} PRIVATE -O2 -ffunction-sections -fdata-sections)
  target_link_options(${program} PRIVATE -fsanitize=fuzzer -fuse-ld=lld LINKER:--gc-sections LINKER:-z,start-stop-gc)
  target_link_libraries(${program} PRIVATE texmesh_fuzz texmesh_fuzz_mutator)
  add_dependencies(texmesh_fuzzers ${program} texmesh_readers)
endforeach()
