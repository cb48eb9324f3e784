# The library that lets file system calls of a build go wrong, and the tests that preload it.
add_library(texmesh_fault_shim MODULE faults/fault_shim.cpp)
target_link_libraries(texmesh_fault_shim PRIVATE ${CMAKE_DL_LIBS})
target_include_directories(texmesh_fault_shim PRIVATE ${PROJECT_SOURCE_DIR})
set_target_properties(texmesh_fault_shim PROPERTIES PREFIX "")
target_compile_definitions(tools_cli_tests PRIVATE TEXMESH_FAULT_SHIM="$<TARGET_FILE:texmesh_fault_shim>")
add_dependencies(tools_cli_tests texmesh_fault_shim)
add_library(texmesh_grant_locks MODULE faults/grant_locks.cpp)
set_target_properties(texmesh_grant_locks PROPERTIES PREFIX "")
target_compile_definitions(tools_cli_tests PRIVATE TEXMESH_GRANT_LOCKS="$<TARGET_FILE:texmesh_grant_locks>")
add_dependencies(tools_cli_tests texmesh_grant_locks)
# With TEXMESH_FULL=1 these take long.
set_tests_properties(tools_cli_command_compile_faults_test tools_cli_command_cache_test PROPERTIES TIMEOUT 7200)
