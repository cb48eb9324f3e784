# Coverage-guided fuzzing of all readers: `cmake --preset fuzz`, or tests/fuzz/run. The same targets run in
# system_fuzz_replay_test without a fuzzer.
file(GLOB fuzz CONFIGURE_DEPENDS fuzz/*.cpp)
set(targets ${fuzz})
list(FILTER targets EXCLUDE REGEX "fuzz_main\\.cpp$")
target_sources(system_fuzz_replay_test PRIVATE ${targets})
target_link_libraries(system_fuzz_replay_test PRIVATE draco::draco meshoptimizer::meshoptimizer ${CMAKE_DL_LIBS})
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
foreach(name batch/build_memo batch/collection batch/find_models batch/fleet/run_summary batch/fleet/shards batch/plan compile/jnd_profile compile/option_fields compile/option_json
    compile/options compile/profile compile/workers/worker_messages)
  list(APPEND sources ${PROJECT_SOURCE_DIR}/pipeline/${name}.cpp)
endforeach()
list(FILTER sources EXCLUDE REGEX "/stages/image/oiio/")
add_executable(texmesh_fuzz EXCLUDE_FROM_ALL ${fuzz} ${sources})
target_compile_definitions(texmesh_fuzz PRIVATE TEXMESH_VERSION="${PROJECT_VERSION}")
# -O1: half the time to build, and two thirds of the runs per second. Sections: what only stages call is not linked.
target_compile_options(texmesh_fuzz PRIVATE -O1 -ffunction-sections -fdata-sections)
target_link_options(texmesh_fuzz PRIVATE -fsanitize=fuzzer LINKER:--gc-sections)
target_link_libraries(texmesh_fuzz PRIVATE texmesh_format ZLIB::ZLIB nlohmann_json::nlohmann_json CURL::libcurl
  TBB::tbb Eigen3::Eigen WebP::webp zstd::libzstd_shared draco::draco meshoptimizer::meshoptimizer JPEG::JPEG PNG::PNG fmt::fmt OpenImageIO::OpenImageIO
  ${CMAKE_DL_LIBS})
add_dependencies(texmesh_fuzz texmesh_oiio)
texmesh_precompile(texmesh_fuzz <filesystem> <sstream> <nlohmann/json.hpp>)
set_source_files_properties(${fuzz} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
texmesh_unity(texmesh_fuzz)
