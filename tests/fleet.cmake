# Engines that run texmesh on many machines, as their users set them up: Slurm with three nodes on this host, Snakemake; Kubernetes
# by what it sets.
set(fleet ${CMAKE_CURRENT_SOURCE_DIR}/fleet)
if(NOT TEXMESH_SANITIZE)
  add_test(NAME fleet_slurm COMMAND ${fleet}/check_slurm $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>
    ${PROJECT_SOURCE_DIR}/examples ${CMAKE_CURRENT_BINARY_DIR}/slurm)
  add_test(NAME fleet_snakemake COMMAND ${fleet}/check_snakemake $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>
    ${PROJECT_SOURCE_DIR}/examples ${CMAKE_CURRENT_BINARY_DIR}/snakemake)
  add_test(NAME fleet_kubernetes COMMAND ${fleet}/check_kubernetes $<TARGET_FILE:texmesh> $<TARGET_FILE:make_scan>
    ${PROJECT_SOURCE_DIR}/examples ${CMAKE_CURRENT_BINARY_DIR}/kubernetes)
  set_tests_properties(fleet_slurm fleet_snakemake fleet_kubernetes PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600 LABELS pipeline)
endif()
