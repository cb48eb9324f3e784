# libwebp as Debian's libwebp-dev installs it (its own CMake files are not packaged).
include(FindLibraries)
texmesh_find_libraries(WebP webp webp/decode.h webp)
