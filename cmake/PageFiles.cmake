# Files of a room's page/ go into the program, file by file.
function(texmesh_page_files target folder)  # folder: of the project; files in its page/
  get_filename_component(room ${folder} NAME)
  set(files)
  foreach(name ${ARGN})
    set(page ${PROJECT_SOURCE_DIR}/${folder}/page/${name})
    file(READ ${page} text)
    string(APPEND files "      {\"${name}\", R\"page(${text})page\"},\n")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${page})
  endforeach()
  configure_file(${PROJECT_SOURCE_DIR}/tools/publish/pages/built_in_files.cpp.in ${room}_page_files.cpp @ONLY)
  target_sources(${target} PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/${room}_page_files.cpp)
endfunction()
