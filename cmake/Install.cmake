# make install, and what find_package(texmesh) finds. Component delivery (format, delivery: a client of packages) needs
# nettle, zlib, libcurl and nlohmann-json; component compiler (stages, pipeline and tools as libraries) all the rest. The
# texmesh command, where it was built, is texmesh::texmesh for texmesh_add_package().
include(CMakePackageConfigHelpers)
set(texmesh_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/texmesh)

function(texmesh_install_component export folders)
  foreach(folder ${folders})
    set_target_properties(texmesh_${folder} PROPERTIES EXPORT_NAME ${folder})
    install(TARGETS texmesh_${folder} EXPORT ${export} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  endforeach()
  install(EXPORT ${export} NAMESPACE texmesh:: DESTINATION ${texmesh_cmake_dir} FILE ${export}.cmake)
endfunction()

# Installs the headers of a layer whose paths within it match one of the regular expressions.
function(texmesh_install_headers layer)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/${layer}/*.h)
  foreach(header ${headers})
    foreach(regex ${ARGN})
      if(header MATCHES "^${layer}/${regex}$")
        get_filename_component(folder ${header} DIRECTORY)
        install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/texmesh/${folder})
      endif()
    endforeach()
  endforeach()
endfunction()

texmesh_install_component(texmeshDelivery "format;delivery")
install(FILES cmake/FindLibraries.cmake cmake/FindNettle.cmake DESTINATION ${texmesh_cmake_dir})
# Of the split stream the mesh and its reader; coders are nobody's business but the reader's.
texmesh_install_headers(format "(base|model|container|documents|rules)/.*" "split/(look_ahead|split_(mesh|stream|reader))\\.h")
texmesh_install_headers(delivery/cpp ".*")
if(TEXMESH_COMPILER)
  texmesh_install_component(texmeshCompiler "stages;pipeline;tools")
  # Of the stages the data, and of each its one public header (tests/house/check_layers).
  texmesh_install_headers(stages "data/.*" "base/run_context\\.h")
  file(GLOB stages RELATIVE ${PROJECT_SOURCE_DIR}/stages CONFIGURE_DEPENDS stages/*/*.h)
  foreach(header ${stages})
    file(STRINGS stages/${header} version REGEX "^inline constexpr int k[A-Za-z]+Version = ")
    if(version AND header MATCHES "^([a-z_]+)/([a-z_]+)\\.h$" AND CMAKE_MATCH_1 STREQUAL CMAKE_MATCH_2)
      texmesh_install_headers(stages "${CMAKE_MATCH_1}/${CMAKE_MATCH_1}\\.h")
    endif()
  endforeach()
  # Of pipeline and tools what a program calls, and what those headers name; tests/house/check_install sees that none misses.
  texmesh_install_headers(pipeline "import/import\\.h" "compile/(compile_model|options)\\.h" "batch/(plan|progress|run|fleet/shard)\\.h"
    "cache/(disk_store|cache_layer)\\.h" "io/(file_resolver|file_stamp|new_folder|record|resolver|uri)\\.h" "compile/workers/(sandbox|worker)\\.h"
    "graph/(graph_run|stage|store)\\.h")
  texmesh_install_headers(tools "inspect/(dump/dump|verify/verify|diff/diff|notes_count)\\.h" "extract/extract\\.h" "publish/export/export\\.h"
    "publish/site/site\\.h")
  install(FILES cmake/FindUtf8proc.cmake cmake/FindWebP.cmake DESTINATION ${texmesh_cmake_dir})
  install(TARGETS texmesh EXPORT texmeshTool RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tool)
  install(TARGETS texmesh_readers LIBRARY DESTINATION ${TEXMESH_MODULE_FOLDER} COMPONENT tool)
  foreach(folder viewer element model-viewer)
    install(DIRECTORY ${PROJECT_BINARY_DIR}/${folder}/ DESTINATION ${CMAKE_INSTALL_DATADIR}/texmesh/${folder} COMPONENT tool OPTIONAL)
  endforeach()
  install(DIRECTORY profiles/ DESTINATION ${CMAKE_INSTALL_DATADIR}/texmesh/profiles COMPONENT tool)
  install(EXPORT texmeshTool NAMESPACE texmesh:: DESTINATION ${texmesh_cmake_dir} FILE texmeshTool.cmake)
endif()
install(DIRECTORY schemas/ DESTINATION ${CMAKE_INSTALL_DATADIR}/texmesh/schemas COMPONENT tool FILES_MATCHING PATTERN *.schema.json
  PATTERN examples EXCLUDE)

configure_package_config_file(cmake/texmeshConfig.cmake.in ${PROJECT_BINARY_DIR}/texmeshConfig.cmake
  INSTALL_DESTINATION ${texmesh_cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/texmeshConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/texmeshConfig.cmake ${PROJECT_BINARY_DIR}/texmeshConfigVersion.cmake
  cmake/TexmeshAddPackage.cmake DESTINATION ${texmesh_cmake_dir})
if(TEXMESH_COMPILER)
  include(Supply)
endif()
