#include "stages/image/decode_tiff_exr.h"

#include <dlfcn.h>

#include <algorithm>

#include "format/base/errors.h"
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

/// Text up to a zero byte, which `at` is then behind; null where there is none within EXR's 255.
std::string_view exr_text(ByteSpan bytes, std::size_t& at) {
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size()));
  const auto end = std::find(begin, begin + std::min<std::ptrdiff_t>(256, bytes.end() - begin), 0);
  if (end == bytes.end() || *end != 0) return {};
  at += static_cast<std::size_t>(end - begin) + 1;
  return {reinterpret_cast<const char*>(bytes.data()) + (begin - bytes.begin()),
          static_cast<std::size_t>(end - begin)};
}

}  // namespace

bool for_each_exr_attribute(ByteSpan exr,
                            const std::function<void(std::size_t part, const ExrAttribute&)>& f) {
  constexpr std::size_t kFlagsAt = 5, kHead = 8;
  constexpr std::uint8_t kParts = 0x10;
  if (exr.size() < kHead) return true;
  const bool many = (exr[kFlagsAt] & kParts) != 0;
  std::size_t part = 0;
  for (std::size_t at = kHead; at < exr.size();) {
    if (exr[at] == 0) {  // the end of a part's header; two of them end the headers
      if (!many || ++at >= exr.size() || exr[at] == 0) return true;
      ++part;
    }
    const std::string_view name = exr_text(exr, at), type = exr_text(exr, at);
    if (!name.data() || !type.data() || exr.size() - at < 4) return true;
    const std::size_t bytes = BytesIn(exr.subspan(at, 4), "EXR").u32();
    at += 4;
    if (bytes > exr.size() - at) return false;
    f(part, ExrAttribute{name, type, exr.subspan(at, bytes)});
    at += bytes;
  }
  return true;
}

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
