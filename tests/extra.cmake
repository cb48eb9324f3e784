# Tests that need more than a C++ library: the Khronos glTF validator (Node.js) over the meshes of real packages, files in F3D and
# Blender, and the browser client and the viewer in headless Chromium.
if(TARGET texmesh AND TARGET make_scan)
  add_test(NAME gltf_validator COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/node/run ${CMAKE_CURRENT_BINARY_DIR}/gltf_validator
    $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>)
  set_tests_properties(gltf_validator PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS pipeline)
  add_test(NAME viewers COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/viewers/run ${CMAKE_CURRENT_BINARY_DIR}/viewers
    $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>)
  set_tests_properties(viewers PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS pipeline)
endif()
# The web client: types, Vitest (delivery/vectors among it), build, size.
add_test(NAME delivery_web COMMAND ${PROJECT_SOURCE_DIR}/delivery/web/run-tests ${CMAKE_CURRENT_BINARY_DIR}/delivery_web)
set_tests_properties(delivery_web PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS web COST 100)
if(TARGET texmesh AND TARGET make_scan)
  add_executable(compose_plane browser/compose_plane.cpp)
  target_link_libraries(compose_plane PRIVATE texmesh_stages texmesh_delivery)
  add_executable(flip_pictures browser/flip_pictures.cpp)
  target_link_libraries(flip_pictures PRIVATE texmesh_stages)
  add_executable(export_environment browser/export_environment.cpp)
  target_link_libraries(export_environment PRIVATE texmesh_stages nlohmann_json::nlohmann_json)
  foreach(test IN ITEMS "web_browser_ready make-packages.mjs" "web_browser tests.mjs untimed" "web_browser_timed tests.mjs timed"
    "web_publish publish.mjs")
    separate_arguments(test)
    list(POP_FRONT test name)
    list(JOIN test " " test)
    add_test(NAME ${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/browser/run ${CMAKE_CURRENT_BINARY_DIR}/browser
      $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan> $<TARGET_FILE:compose_plane> $<TARGET_FILE:export_environment>
      $<$<BOOL:${TEXMESH_LAB}>:$<TARGET_FILE:texmesh-lab>>)
    set_tests_properties(${name} PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 3600 LABELS web FIXTURES_REQUIRED browser
      ENVIRONMENT "TEXMESH_BROWSER_PROGRAM=${test};TEXMESH_BROWSER_READY=1")
  endforeach()
  set_tests_properties(web_browser_ready PROPERTIES FIXTURES_SETUP browser FIXTURES_REQUIRED "" COST 1000
    ENVIRONMENT TEXMESH_BROWSER_PROGRAM=make-packages.mjs)
  # Those that wait most begin first, one at a time: other tests have the cores meanwhile (tests/run).
  set_tests_properties(web_browser web_publish PROPERTIES COST 900 RESOURCE_LOCK browser)
  # A browser that draws without a GPU takes both cores, and its deadlines are kept only when it has them.
  set_tests_properties(web_browser_timed PROPERTIES RUN_SERIAL ON)
endif()
