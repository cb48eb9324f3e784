#include "pipeline/compile/library_versions.h"

#include <CGAL/version.h>
#include <OpenImageIO/oiioversion.h>
#include <draco/core/draco_version.h>
#include <meshoptimizer.h>
#include <png.h>
#include <webp/encode.h>
#include <zlib.h>
#include <zstd.h>

#include <jconfig.h>

namespace texmesh {

#define TEXMESH_TEXT_(x) #x
#define TEXMESH_TEXT(x) TEXMESH_TEXT_(x)

namespace {
std::string webp_version() {  // its headers carry the version of the interface only
  const int v = WebPGetEncoderVersion();
  return std::to_string(v >> 16) + "." + std::to_string(v >> 8 & 255) + "." + std::to_string(v & 255);
}
}  // namespace

const std::map<std::string, std::string>& library_versions() {
  static const std::map<std::string, std::string> versions{
      {"cgal", CGAL_VERSION_STR},
      {"draco", draco::kDracoVersion},
      {"libjpeg-turbo", TEXMESH_TEXT(LIBJPEG_TURBO_VERSION)},
      {"libpng", PNG_LIBPNG_VER_STRING},
      {"libwebp", webp_version()},
      {"libzstd", ZSTD_VERSION_STRING},
      {"meshoptimizer", std::to_string(MESHOPTIMIZER_VERSION)},
      {"openimageio", OIIO_VERSION_STRING},
      {"tinygltf", "2.7"},  // its headers carry no version
      {"zlib", ZLIB_VERSION},
  };
  return versions;
}

std::string compiler_version() {
#ifdef __clang__
  return "clang " __clang_version__;
#else
  return "g++ " __VERSION__;
#endif
}

std::string tool_version() { return TEXMESH_VERSION; }

}  // namespace texmesh
