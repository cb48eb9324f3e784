# DCMTK's JPEG decoders. Debian's own DCMTKConfig.cmake demands every library of DCMTK and the command-line tools.
find_path(DcmJpeg_INCLUDE_DIR dcmtk/dcmjpeg/djdijg12.h)
find_library(DcmJpeg_LIBRARY dcmjpeg)
find_library(DcmJpeg_DATA_LIBRARY dcmdata)
find_library(DcmJpeg_LOG_LIBRARY oflog)
find_library(DcmJpeg_STANDARD_LIBRARY ofstd)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(DcmJpeg REQUIRED_VARS DcmJpeg_LIBRARY DcmJpeg_DATA_LIBRARY DcmJpeg_LOG_LIBRARY
  DcmJpeg_STANDARD_LIBRARY DcmJpeg_INCLUDE_DIR)
if(DcmJpeg_FOUND AND NOT TARGET DcmJpeg::dcmjpeg)
  add_library(DcmJpeg::dcmjpeg INTERFACE IMPORTED)
  target_include_directories(DcmJpeg::dcmjpeg SYSTEM INTERFACE ${DcmJpeg_INCLUDE_DIR})
  target_link_libraries(DcmJpeg::dcmjpeg INTERFACE ${DcmJpeg_LIBRARY} ${DcmJpeg_DATA_LIBRARY} ${DcmJpeg_LOG_LIBRARY} ${DcmJpeg_STANDARD_LIBRARY})
endif()
