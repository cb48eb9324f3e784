# Nettle as Debian's nettle-dev installs it (it has no CMake files).
include(FindLibraries)
texmesh_find_libraries(Nettle nettle nettle/sha2.h nettle)
