# DCMTK's JPEG decoders. Debian's own DCMTKConfig.cmake demands every library of DCMTK and the command-line tools.
include(FindLibraries)
texmesh_find_libraries(DcmJpeg dcmjpeg dcmtk/dcmjpeg/djdijg12.h dcmjpeg dcmdata oflog ofstd)
