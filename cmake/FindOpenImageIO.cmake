# Debian 12's own OpenImageIOConfig.cmake demands the command-line tools, OpenCV's headers and Python bindings of Imath,
# none of which reading an image needs; so the library and its headers are looked up directly.
include(FindLibraries)
texmesh_find_libraries(OpenImageIO OpenImageIO OpenImageIO/imageio.h OpenImageIO OpenImageIO_Util)
