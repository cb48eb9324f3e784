# texmesh_add_package(NAME INPUT [OUTPUT FILE] [PROFILE FILE] [DEPENDS FILE...] [OPTIONS FLAG...])
#
# Adds a target NAME, part of `all`, that compiles the model INPUT into OUTPUT (NAME.texmesh in the current binary
# folder by default) whenever INPUT, a file that INPUT refers to (images, buffers, material libraries: texmesh lists
# them in a depfile), the profile, a file of DEPENDS or texmesh itself is newer. OPTIONS are flags of `texmesh
# compile`. The output's path is the target's property TEXMESH_PACKAGE.
function(texmesh_add_package name input)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "OUTPUT;PROFILE" "DEPENDS;OPTIONS")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "texmesh_add_package(${name}): unknown arguments: ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT TARGET texmesh::texmesh)
    message(FATAL_ERROR "texmesh_add_package(${name}): this texmesh was built without its compiler (TEXMESH_COMPILER=OFF)")
  endif()
  cmake_path(ABSOLUTE_PATH input BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
  if(NOT arg_OUTPUT)
    set(arg_OUTPUT ${name}.texmesh)
  endif()
  cmake_path(ABSOLUTE_PATH arg_OUTPUT BASE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR} NORMALIZE)
  set(profile)
  if(arg_PROFILE)
    cmake_path(ABSOLUTE_PATH arg_PROFILE BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
    set(profile --profile ${arg_PROFILE})
  endif()
  add_custom_command(OUTPUT ${arg_OUTPUT}
    COMMAND texmesh::texmesh compile ${input} -o ${arg_OUTPUT} --depfile ${arg_OUTPUT}.d ${profile} ${arg_OPTIONS}
    DEPENDS ${input} ${arg_PROFILE} ${arg_DEPENDS} texmesh::texmesh
    DEPFILE ${arg_OUTPUT}.d
    COMMENT "Compiling ${name}.texmesh" VERBATIM)
  add_custom_target(${name} ALL DEPENDS ${arg_OUTPUT})
  set_target_properties(${name} PROPERTIES TEXMESH_PACKAGE ${arg_OUTPUT})
endfunction()
