#include <dlfcn.h>

#include <map>

#include "stages/image/jpeg_segments.h"
#include "stages/image/readers_module/other_pictures.h"

namespace texmesh {
namespace {

constexpr const char* kModule = "texmesh_readers.so";

struct ReaderModule {
  const ModuleReaders* readers = nullptr;
  std::string problem;
};

// OpenImageIO brings 200 shared libraries with it, DCMTK among them. Loading them takes .2 s, and most models
// need none of them.
ReaderModule load_module() {
  // By name alone: the run path of this program or library tells the folder. Never closed, since errors that
  // the module throws outlive any call.
  void* const module = ::dlopen(kModule, RTLD_NOW | RTLD_LOCAL);
  if (module)
    if (void* const symbol = ::dlsym(module, kReadersSymbol))
      return {reinterpret_cast<const ModuleReaders* (*)()>(symbol)(), ""};
  const char* const why = ::dlerror();
  return {nullptr, why ? why : "an error without a message"};
}

const ModuleReaders& reader_for(const std::string& name, ImageFormat format) {
  return module_readers(name, image_format_name(format), "libopenimageio2.4");
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

/// The bytes of a list of channels: names, 16 bytes each, an empty name.
bool is_channel_list(ByteSpan value) {
  constexpr std::size_t kChannelBytes = 16;
  for (std::size_t at = 0; at < value.size();) {
    if (value[at] == 0) return at + 1 == value.size();
    if (!exr_text(value, at).data()) return false;
    at += kChannelBytes;
  }
  return false;
}

bool is_text_list(ByteSpan value) {
  while (value.size() >= 4) {
    const std::size_t bytes = BytesIn(value, "EXR").u32();
    value = value.subspan(4);
    if (bytes > value.size()) return false;
    value = value.subspan(bytes);
  }
  return value.empty();
}

/// OpenEXR takes the memory that an attribute claims before it reads it, and of most types reads what the
/// type says, whatever the attribute claims: what it takes for the next attribute would then be another one
/// than ours.
bool has_right_length(const ExrAttribute& a) {
  static const std::map<std::string_view, std::size_t> kBytes{{"box2f", 16},
                                                              {"box2i", 16},
                                                              {"chromaticities", 32},
                                                              {"compression", 1},
                                                              {"deepImageState", 1},
                                                              {"double", 8},
                                                              {"envmap", 1},
                                                              {"float", 4},
                                                              {"int", 4},
                                                              {"keycode", 28},
                                                              {"lineOrder", 1},
                                                              {"m33d", 72},
                                                              {"m33f", 36},
                                                              {"m44d", 128},
                                                              {"m44f", 64},
                                                              {"rational", 8},
                                                              {"tiledesc", 9},
                                                              {"timecode", 8},
                                                              {"v2d", 16},
                                                              {"v2f", 8},
                                                              {"v2i", 8},
                                                              {"v3d", 24},
                                                              {"v3f", 12},
                                                              {"v3i", 12}};
  if (a.bytes != a.value.size()) return false;
  if (const auto it = kBytes.find(a.type); it != kBytes.end()) return a.bytes == it->second;
  if (a.type == "chlist") return is_channel_list(a.value);
  if (a.type == "stringvector") return is_text_list(a.value);
  if (a.type == "floatvector") return a.bytes % 4 == 0;
  if (a.type != "preview") return true;
  if (a.bytes < 8) return false;
  BytesIn in(a.value, "EXR");
  const std::uint64_t width = in.u32(), height = in.u32();
  return width < a.bytes && height < a.bytes && a.bytes == 8 + 4 * width * height;
}

/// What OpenEXR takes memory for when it opens a file: attributes, and its packers' buffers for up to 256
/// lines of all channels of the first part.
void check_exr_header(const std::string& name, ByteSpan bytes, const ImageLimits& limits) {
  constexpr std::uint64_t kLines = 256, kFreeSamples = 1 << 17, kMostShrunk = 20000;
  std::uint64_t width = 1, channels = 1;
  for_each_exr_attribute(bytes, [&](std::size_t part, const ExrAttribute& a) {
    if (!has_right_length(a))
      throw InputError(name, "image header", "attributes as long as their types are, within the file",
                       std::to_string(a.bytes) + " bytes of one");
    if (part == 0 && a.type == "chlist")  // a channel is never shorter
      channels = std::max<std::uint64_t>(channels, a.bytes / 18);
    if (part != 0 || a.name != "dataWindow" || a.type != "box2i") return;
    BytesIn in(a.value, "EXR");
    const auto side = [&] { return std::int64_t{static_cast<std::int32_t>(in.u32())}; };
    const std::int64_t left = side(), top = side(), right = side(), bottom = side();
    width = static_cast<std::uint64_t>(std::max<std::int64_t>(0, right - left + 1));
    check_image_size(name, width, static_cast<std::uint64_t>(std::max<std::int64_t>(0, bottom - top + 1)),
                     limits);
  });
  if (width * channels > kFreeSamples && width * channels * kLines / kMostShrunk > bytes.size())
    throw InputError(name, "image header",
                     "rows that its " + std::to_string(bytes.size()) + " bytes can hold",
                     std::to_string(width) + " px in " + std::to_string(channels) + " channels");
}

}  // namespace

const ModuleReaders& module_readers(const std::string& name, const std::string& what,
                                    const std::string& package) {
  static const ReaderModule module = load_module();
  if (module.readers) return *module.readers;
  throw InputError(name, "",
                   "a reader for " + what + ": " + kModule +
                       ", which is installed with texmesh, and Debian's package " + package,
                   module.problem);
}

void for_each_exr_attribute(ByteSpan exr,
                            const std::function<void(std::size_t part, const ExrAttribute&)>& f) {
  constexpr std::size_t kFlagsAt = 5, kHead = 8;
  constexpr std::uint8_t kParts = 0x10;
  if (exr.size() < kHead) return;
  const bool many = (exr[kFlagsAt] & kParts) != 0;
  std::size_t part = 0;
  for (std::size_t at = kHead; at < exr.size();) {
    if (exr[at] == 0) {  // the end of a part's header; two of them end the headers
      if (!many || ++at >= exr.size() || exr[at] == 0) return;
      ++part;
    }
    ExrAttribute a;
    a.name = exr_text(exr, at), a.type = exr_text(exr, at);
    if (!a.name.data() || !a.type.data() || exr.size() - at < 4) return;
    a.bytes = BytesIn(exr.subspan(at, 4), "EXR").u32();
    at += 4;
    a.value = exr.subspan(at, std::min<std::size_t>(a.bytes, exr.size() - at));
    f(part, a);
    at += a.value.size();
  }
}

ImageHeader read_tiff_exr_header(const std::string& name, ImageFormat format, ByteSpan bytes,
                                 const ImageLimits& limits) {
  if (format == ImageFormat::kExr) check_exr_header(name, bytes, limits);
  return reader_for(name, format).read_tiff_exr_header(name, format, bytes, limits);
}

StoredSamples decode_tiff_exr(const Image& image) {
  return reader_for(image.name, image.format).decode_tiff_exr(image);
}

std::optional<WideJpegHeader> read_wide_jpeg_header(const std::string& name, ByteSpan bytes) {
  constexpr std::size_t kFrameBytes = 6;  // precision, height, width, components: T.81, B.2.2
  std::optional<WideJpegHeader> out;
  for_each_jpeg_segment(bytes, [&](std::uint8_t marker, ByteSpan frame) {
    if (!is_jpeg_frame(marker) || frame.size() < kFrameBytes || frame[0] <= 8 || frame[0] > 16 || out) return;
    const auto side = [&](std::size_t at) { return std::uint32_t{frame[at]} << 8 | frame[at + 1]; };
    out = WideJpegHeader{side(3), side(1), frame[5], frame[0]};
  });
  if (out && out->channels != 1 && out->channels != 3)
    throw InputError(name, "JPEG header", "1 or 3 components of " + std::to_string(out->bits) + " bits",
                     std::to_string(out->channels));
  return out;
}

std::vector<std::uint16_t> decode_wide_jpeg(const Image& image) {
  const std::optional<WideJpegHeader> header = read_wide_jpeg_header(image.name, image.bytes);
  if (!header || header->width_px != image.width_px || header->height_px != image.height_px ||
      header->channels != image.channels)
    throw InputError(image.name, "JPEG header", "the size that import had found", "another one");
  // A code of one bit for a block's DC: no Huffman-coded JPEG, progressive ones either, shrinks 64 samples
  // further.
  constexpr std::uint64_t kMostSamplesPerByte = 64 * 8;
  if (std::uint64_t{image.width_px} * image.height_px / kMostSamplesPerByte > image.bytes.size())
    throw InputError(image.name, "JPEG header",
                     "a size that its " + std::to_string(image.bytes.size()) + " bytes can hold",
                     std::to_string(image.width_px) + " x " + std::to_string(image.height_px));
  std::vector<std::uint16_t> samples = module_readers(image.name, "JPEGs of more than 8 bits", "libdcmtk17")
                                           .decode_wide_jpeg(image.name, image.bytes, *header);
  const std::uint32_t most = (1u << header->bits) - 1;
  for (std::uint16_t& sample : samples)
    sample = static_cast<std::uint16_t>((std::min<std::uint32_t>(sample, most) * 65535u + most / 2) / most);
  return samples;
}

}  // namespace texmesh
