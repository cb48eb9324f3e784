# Tests that need more than a C++ library: the Khronos glTF validator (Node.js) over the meshes of real packages.
if(TARGET texmesh AND TARGET make_scan)
  add_test(NAME gltf_validator COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/node/run ${CMAKE_CURRENT_BINARY_DIR}/gltf_validator
    $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>)
  set_tests_properties(gltf_validator PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS pipeline)
endif()
# The web client: types, Vitest (delivery/vectors among it), build, size.
add_test(NAME delivery_web COMMAND ${PROJECT_SOURCE_DIR}/delivery/web/run-tests ${CMAKE_CURRENT_BINARY_DIR}/delivery_web)
set_tests_properties(delivery_web PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS web)
