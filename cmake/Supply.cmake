# What stands beside the program where it is installed (component tool): manual page, completion of bash and zsh, both made by the
# program of its own options, and what the program is made of (CycloneDX). Then the Debian package of all that: cpack -G DEB.
find_program(GZIP gzip REQUIRED)
set(texmesh_documents ${CMAKE_INSTALL_DATADIR}/doc/texmesh)
install(CODE "
  set(to \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}\")
  set(program $<TARGET_FILE:texmesh>)
  set(zsh \${to}/zsh/site-functions)
  if(CMAKE_INSTALL_PREFIX STREQUAL \"/usr\")
    set(zsh \${to}/zsh/vendor-completions) # Debian's place for packages
  endif()
  file(MAKE_DIRECTORY \${to}/man/man1 \${to}/bash-completion/completions \${zsh} \${to}/doc/texmesh)
  execute_process(COMMAND \${program} completion man COMMAND ${GZIP} -9n OUTPUT_FILE \${to}/man/man1/texmesh.1.gz
    COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND \${program} completion bash OUTPUT_FILE \${to}/bash-completion/completions/texmesh
    COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND \${program} completion zsh OUTPUT_FILE \${zsh}/_texmesh COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${PROJECT_SOURCE_DIR}/cmake/make_sbom ${PROJECT_VERSION}
      ${PROJECT_SOURCE_DIR}/cmake/debian-packages.txt
      \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}/texmesh
      \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${TEXMESH_MODULE_FOLDER}/texmesh_readers.so
    OUTPUT_FILE \${to}/doc/texmesh/texmesh.cdx.json COMMAND_ERROR_IS_FATAL ANY)
" COMPONENT tool)
# Sources and program have different licences: the file says which and why.
install(FILES ${PROJECT_SOURCE_DIR}/cmake/copyright DESTINATION ${texmesh_documents} COMPONENT tool)

set(TEXMESH_MAINTAINER "texmesh developers <texmesh@localhost>" CACHE STRING "Maintainer of the Debian package")
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME texmesh)
set(CPACK_PACKAGE_CONTACT ${TEXMESH_MAINTAINER})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "compiler of textured 3D scans into streamable packages")
set(CPACK_PACKAGE_DESCRIPTION "texmesh compiles textured 3D scans into packages that any static web server can stream.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL tool)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON) # dpkg-shlibdeps of dpkg-dev
include(CPack)
