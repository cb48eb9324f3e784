#include "stages/image/decode_tiff_exr.h"

#include <dlfcn.h>

#include "format/base/errors.h"
#include "stages/image/exr_header.h"
#include "stages/image/oiio/tiff_exr_reader.h"

namespace texmesh {
namespace {

constexpr const char* kModule = "texmesh_oiio.so";

struct ReaderModule {
  const TiffExrReader* reader = nullptr;
  std::string problem;
};

// OpenImageIO brings 200 shared libraries with it. Loading them takes .2 s, and most models need none of
// them.
ReaderModule load_module() {
  // By name alone: the run path of this program or library tells the folder. Never closed, since errors that
  // the module throws outlive any call.
  void* const module = ::dlopen(kModule, RTLD_NOW | RTLD_LOCAL);
  if (module)
    if (void* const symbol = ::dlsym(module, kTiffExrSymbol))
      return {reinterpret_cast<const TiffExrReader* (*)()>(symbol)(), ""};
  const char* const why = ::dlerror();
  return {nullptr, why ? why : "an error without a message"};
}

const TiffExrReader& reader_for(const std::string& name, ImageFormat format) {
  static const ReaderModule module = load_module();
  if (module.reader) return *module.reader;
  throw InputError(name, "",
                   std::string("a reader for ") + image_format_name(format) + ": " + kModule +
                       ", which is installed with texmesh, and Debian's package libopenimageio2.4",
                   module.problem);
}

}  // namespace

ImageHeader read_tiff_exr_header(const std::string& name, ImageFormat format, ByteSpan bytes,
                                 const ImageLimits& limits) {
  // OpenEXR takes the memory that an attribute claims before it reads it.
  const auto ignore = [](std::size_t, const ExrAttribute&) {};
  if (format == ImageFormat::kExr && !for_each_exr_attribute(bytes, ignore))
    throw InputError(name, "image header", "attributes within the file", "one that claims to be longer");
  return reader_for(name, format).read_header(name, format, bytes, limits);
}

StoredSamples decode_tiff_exr(const Image& image) {
  return reader_for(image.name, image.format).decode(image);
}

}  // namespace texmesh
