# Tests of the house itself: layers, headers, layout of the source, installation.
set(house ${CMAKE_CURRENT_SOURCE_DIR}/house)
add_test(NAME house_layers COMMAND ${house}/check_layers ${PROJECT_SOURCE_DIR})
add_test(NAME house_layers_self_test COMMAND ${house}/check_layers --self-test)
add_test(NAME house_sizes COMMAND ${house}/check_sizes ${PROJECT_SOURCE_DIR})
add_test(NAME house_sizes_self_test COMMAND ${house}/check_sizes --self-test)
add_test(NAME house_unity COMMAND ${house}/check_unity ${PROJECT_SOURCE_DIR})
add_test(NAME house_unity_self_test COMMAND ${house}/check_unity --self-test)
add_test(NAME house_headers COMMAND ${house}/check_headers ${PROJECT_SOURCE_DIR} ${CMAKE_CXX_COMPILER})
add_test(NAME house_format COMMAND ${house}/check_format ${PROJECT_SOURCE_DIR})
set_tests_properties(house_format PROPERTIES SKIP_RETURN_CODE 77)
add_test(NAME house_text COMMAND ${house}/check_text ${PROJECT_SOURCE_DIR})
add_test(NAME house_text_self_test COMMAND ${house}/check_text --self-test)
add_test(NAME house_spec COMMAND ${house}/check_spec ${PROJECT_SOURCE_DIR})
add_test(NAME house_spec_self_test COMMAND ${house}/check_spec --self-test)
add_test(NAME house_golden_frozen COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/freeze --check)
add_test(NAME house_golden_frozen_self_test COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/freeze --self-test)
add_test(NAME house_links COMMAND ${house}/check_links ${PROJECT_SOURCE_DIR})
add_test(NAME house_links_self_test COMMAND ${house}/check_links --self-test)
add_test(NAME house_docs COMMAND ${house}/check_docs ${PROJECT_SOURCE_DIR} $<TARGET_FILE:texmesh>)
add_test(NAME house_docs_self_test COMMAND ${house}/check_docs --self-test)
add_test(NAME house_bench_run COMMAND ${house}/check_bench_run ${PROJECT_SOURCE_DIR})
add_test(NAME house_tour_self_test COMMAND ${house}/check_tour --self-test)
if(NOT TEXMESH_SANITIZE)  # an instrumented library would ask the same of its user
  add_test(NAME house_install COMMAND ${house}/check_install ${PROJECT_BINARY_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/consumer
    ${CMAKE_CURRENT_BINARY_DIR}/install ${CMAKE_COMMAND} $<TARGET_FILE:make_scan>)
endif()
if(NOT TEXMESH_SANITIZE)
  add_test(NAME house_tour COMMAND ${house}/check_tour ${PROJECT_SOURCE_DIR}/README.md $<TARGET_FILE:texmesh>
    $<TARGET_FILE:make_scan> ${CMAKE_CURRENT_BINARY_DIR}/tour)
endif()
if(NOT TEXMESH_SANITIZE)
  add_test(NAME house_supply COMMAND ${house}/check_supply ${PROJECT_BINARY_DIR} ${CMAKE_CURRENT_BINARY_DIR}/supply
    ${CMAKE_COMMAND} ${CMAKE_CPACK_COMMAND} ${PROJECT_SOURCE_DIR}/tests/golden/v2.0-webp.texmesh)
  set_tests_properties(house_supply PROPERTIES SKIP_RETURN_CODE 77)
endif()
if(NOT TEXMESH_SANITIZE)
  add_test(NAME house_reproducible COMMAND ${house}/check_reproducible ${PROJECT_SOURCE_DIR}
    ${CMAKE_CURRENT_BINARY_DIR}/reproducible ${CMAKE_COMMAND})
  set_tests_properties(house_reproducible PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 7200)
endif()
add_test(NAME house_make_scan COMMAND ${house}/check_make_scan $<TARGET_FILE:make_scan> $<TARGET_FILE:texmesh>
  ${CMAKE_CURRENT_BINARY_DIR}/make_scan)
add_test(NAME house_examples COMMAND ${house}/check_examples $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>
  ${PROJECT_SOURCE_DIR}/examples ${CMAKE_CURRENT_BINARY_DIR}/examples)
add_test(NAME house_serve COMMAND ${house}/check_serve $<TARGET_FILE:texmesh> ${PROJECT_SOURCE_DIR}/tests/golden/v2.0-scan.texmesh
  ${PROJECT_SOURCE_DIR}/examples ${CMAKE_CURRENT_BINARY_DIR}/serve)
set_tests_properties(house_serve PROPERTIES SKIP_RETURN_CODE 77)
if(NOT TEXMESH_SANITIZE)
  add_executable(delivery_client consumer/client.cpp)
  target_link_libraries(delivery_client PRIVATE texmesh_delivery)
  add_test(NAME house_delivery_size COMMAND ${house}/check_delivery_size $<TARGET_FILE:delivery_client>
    ${PROJECT_SOURCE_DIR}/tests/golden/v2.0-scan.texmesh)
endif()
