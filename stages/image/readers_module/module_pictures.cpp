// The module texmesh_readers.so: see stages/image/decode_tiff_exr.cpp.
#include "stages/image/readers_module/other_pictures.h"

#include <memory>
#include <mutex>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

namespace texmesh {
namespace {

/// What a message calls the kind of a file, and OpenImageIO its reader.
struct FileKind {
  const char *name, *reader;
};

FileKind kind_of(ImageFormat format) {
  return {image_format_name(format), format == ImageFormat::kTiff ? "tiff" : "openexr"};
}

/// OpenImageIO's own IOMemReader believes a place before the begin, which an EXR's table of rows can name.
class MemoryFile final : public OIIO::Filesystem::IOProxy {
 public:
  explicit MemoryFile(ByteSpan bytes) : IOProxy("", Mode::Read), bytes_(bytes) {}
  const char* proxytype() const override { return "texmesh"; }
  std::size_t read(void* to, std::size_t size) override {
    const std::size_t n = pread(to, size, m_pos);
    m_pos += static_cast<std::int64_t>(n);
    return n;
  }
  std::size_t pread(void* to, std::size_t size, std::int64_t offset) override {
    if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes_.size()) return 0;
    const ByteSpan rest = bytes_.subspan(static_cast<std::size_t>(offset));
    const std::size_t n = std::min(size, rest.size());
    if (n > 0) std::memcpy(to, rest.data(), n);
    return n;
  }
  std::size_t size() const override { return bytes_.size(); }

 private:
  ByteSpan bytes_;
};

// An image file opened by the reader of its format, in memory; keep the bytes alive.
struct OpenImage {
  std::unique_ptr<MemoryFile> memory;
  std::unique_ptr<OIIO::ImageInput> input;
  OIIO::ImageSpec spec;
};

std::string reader_error(OIIO::ImageInput& input) {
  std::string s = input.geterror();
  // OpenImageIO repeats and ends messages with line feeds.
  while (!s.empty() && (s.back() == '\n' || s.back() == ' ')) s.pop_back();
  std::replace(s.begin(), s.end(), '\n', ' ');
  return s.empty() ? "an error without a message" : s;
}

OpenImage open_image(const std::string& name, FileKind kind, ByteSpan bytes) {
  static std::once_flag once;
  std::call_once(once, [] {
    // One model, one child process, --jobs of them: the pools of OpenImageIO and OpenEXR would only add
    // threads.
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
    OIIO::attribute("dds:bc5normal", 1);  // the third channel of normals, which have two in the file
  });
  OpenImage open;
  open.memory = std::make_unique<MemoryFile>(bytes);
  open.input = OIIO::ImageInput::create(kind.reader);
  if (!open.input) throw InputError(name, "", std::string("OpenImageIO's reader for ") + kind.name, "none");
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  open.input->set_ioproxy(open.memory.get());
  if (!open.input->open("memory", open.spec, config))
    throw InputError(name, "image header", std::string("a readable ") + kind.name, reader_error(*open.input));
  return open;
}

/// Of an EXR, whose channels have names: colours and their alpha come first, then Z, ids and others.
std::uint32_t exr_channels(const OIIO::ImageSpec& spec) {
  if (spec.alpha_channel == 1 || spec.alpha_channel == 3)
    return static_cast<std::uint32_t>(spec.alpha_channel) + 1;
  const bool grey = spec.nchannels < 3 || (spec.channelnames[0] == "Y" && spec.channelnames[1] != "RY" &&
                                           spec.channelnames[1] != "BY");
  return grey ? 1 : 3;
}

std::uint32_t colour_channels(const OIIO::ImageSpec& spec, ImageFormat format) {
  if (format == ImageFormat::kExr && spec.nchannels > 0) return exr_channels(spec);
  const auto n = static_cast<std::uint32_t>(std::max(spec.nchannels, 0));
  if (n <= 4) return n;
  return spec.alpha_channel == 3 ? 4 : 3;
}

std::uint8_t bits_of(const OIIO::ImageSpec& spec) {
  const auto type = spec.format.basetype;
  return type == OIIO::TypeDesc::UINT8 ? 8 : type == OIIO::TypeDesc::UINT16 ? 16 : 32;
}

void check_spec(const std::string& name, const OIIO::ImageSpec& spec, const ImageLimits& limits) {
  check_image_size(name, static_cast<std::uint64_t>(std::max(spec.width, 0)),
                   static_cast<std::uint64_t>(std::max(spec.height, 0)), limits);
  if (spec.depth > 1) throw InputError(name, "image header", "a flat image", "a volume");
  if (spec.deep) throw InputError(name, "image header", "a flat image", "deep data");
  if (spec.nchannels < 1 || spec.nchannels > 64)
    throw InputError(name, "image header", "1 to 64 channels", std::to_string(spec.nchannels));
}

/// No packer of TIFF or EXR shrinks a picture with any noise further. A header that claims more lies about
/// the size, and is refused before memory is taken. (Deflate ends at 1032; the rest is for the newer
/// packers.) Whole tiles and strips are read, however little of them the image has.
void check_plausible(const Image& image, const OIIO::ImageSpec& spec) {
  constexpr std::uint64_t kMostShrunk = 20000;
  const auto in_tiles = [](std::uint32_t px, int tile_px) {
    const auto tile = static_cast<std::uint64_t>(std::max(1, tile_px));
    return (px + tile - 1) / tile * tile;
  };
  const std::uint64_t width = in_tiles(image.width_px, spec.tile_width);
  const int strip_rows = spec.get_int_attribute("tiff:RowsPerStrip");  // below 0: all
  const std::uint64_t height = in_tiles(image.height_px, std::max(spec.tile_height, strip_rows));
  // Both sides are below 2^32, so that their product is whole.
  const std::uint64_t samples = static_cast<std::uint64_t>(spec.nchannels) * std::max(1, spec.tile_depth);
  if (width * height / kMostShrunk <= image.bytes.size() / samples) return;
  std::string found = std::to_string(image.width_px) + " x " + std::to_string(image.height_px);
  if (spec.tile_width > 0)
    found += " in tiles of " + std::to_string(spec.tile_width) + " x " + std::to_string(spec.tile_height);
  else if (strip_rows > 0)
    found += " in strips of " + std::to_string(strip_rows) + " rows";
  throw InputError(image.name, "image header",
                   "a size that its " + std::to_string(image.bytes.size()) + " bytes can hold", found);
}

OpenImage open_checked(const Image& image) {
  OpenImage open = open_image(image.name, kind_of(image.format), image.bytes);
  if (static_cast<std::uint32_t>(open.spec.width) != image.width_px ||
      static_cast<std::uint32_t>(open.spec.height) != image.height_px ||
      colour_channels(open.spec, image.format) != image.channels)
    throw InputError(image.name, "image header", "the size that import had found", "another one");
  check_plausible(image, open.spec);
  return open;
}

// The file's own samples as T. Errors of the reader, truncation included, are InputError and name the rows.
template <class T>
std::vector<T> read_samples(const std::string& name, FileKind kind, std::uint32_t channels, OpenImage& open,
                            OIIO::TypeDesc type) {
  const int n = static_cast<int>(channels), height = open.spec.height;
  const std::size_t row = static_cast<std::size_t>(open.spec.width) * channels;
  const auto check = [&](bool is_read, const auto& place) {
    if (!is_read || open.input->has_error())
      throw InputError(name, place(), std::string("a whole ") + kind.name, reader_error(*open.input));
  };
  std::vector<T> samples;
  if (open.spec.tile_width > 0) {
    samples.resize(row * static_cast<std::size_t>(height));
    check(open.input->read_image(0, 0, 0, n, type, samples.data()), [] { return "pixels"; });
    return samples;
  }
  // OpenImageIO takes and frees 64 MB at every call that names a type, be it the file's own: none is named
  // then. Of calls that convert there are few, even for an image of many short rows.
  const bool as_stored = open.spec.format == type && open.spec.channelformats.empty();
  const OIIO::TypeDesc asked = as_stored ? OIIO::TypeDesc() : type;
  const int rows = std::max(64, height / 16);
  samples.reserve(row * static_cast<std::size_t>(height));  // not touched before it is read
  const int first = open.spec.y;                            // the data window of an EXR may begin anywhere
  for (int y = 0; y < height; y += rows) {
    const int end = std::min(height, y + rows);
    samples.resize(row * static_cast<std::size_t>(end));
    T* to = samples.data() + row * static_cast<std::size_t>(y);
    check(open.input->read_scanlines(0, 0, first + y, first + end, 0, 0, n, asked, to), [&] {
      return "rows " + std::to_string(y) + " to " + std::to_string(end - 1) + " of " + std::to_string(height);
    });
  }
  return samples;
}

StoredSamples read_stored(const std::string& name, FileKind kind, std::uint32_t channels, OpenImage& open) {
  const std::uint8_t bits = bits_of(open.spec);
  if (bits == 8) return read_samples<std::uint8_t>(name, kind, channels, open, OIIO::TypeDesc::UINT8);
  if (bits == 16) return read_samples<std::uint16_t>(name, kind, channels, open, OIIO::TypeDesc::UINT16);
  return read_samples<float>(name, kind, channels, open, OIIO::TypeDesc::FLOAT);
}

ImageHeader read_module_header(const std::string& name, ImageFormat format, ByteSpan bytes,
                               const ImageLimits& limits) {
  const OpenImage open = open_image(name, kind_of(format), bytes);
  check_spec(name, open.spec, limits);
  return {static_cast<std::uint32_t>(open.spec.width), static_cast<std::uint32_t>(open.spec.height),
          static_cast<std::uint8_t>(colour_channels(open.spec, format)), bits_of(open.spec)};
}

StoredSamples decode(const Image& image) {
  OpenImage open = open_checked(image);
  return read_stored(image.name, kind_of(image.format), image.channels, open);
}

PictureSamples read_picture(const std::string& name, OtherPicture other, ByteSpan bytes,
                            const PictureSize& size) {
  constexpr const char* kReaders[] = {"bmp", "targa", "gif", "dds", "jpeg2000", "hdr"};
  const FileKind kind{other_picture_name(other), kReaders[static_cast<std::size_t>(other)]};
  OpenImage open = open_image(name, kind, bytes);
  const OIIO::ImageSpec& spec = open.spec;
  if (spec.width != static_cast<int>(size.width_px) || spec.height != static_cast<int>(size.height_px) ||
      spec.depth > 1 || spec.nchannels < 1)
    throw InputError(name, "image header", "the size that its first bytes say, and channels",
                     std::to_string(spec.width) + " x " + std::to_string(spec.height) + " in " +
                         std::to_string(spec.nchannels) + " channels");
  PictureSamples out;
  out.channels = colour_channels(spec, ImageFormat::kTiff);
  out.profile = spec.find_attribute("ICCProfile") != nullptr;
  out.samples = read_stored(name, kind, out.channels, open);
  out.more_pictures = other == OtherPicture::kGif && open.input->seek_subimage(1, 0);
  return out;
}

constexpr ModuleReaders kReader{&read_module_header, &decode, &read_picture, &decode_wide_jpeg_file};

}  // namespace
}  // namespace texmesh

extern "C" __attribute__((visibility("default"))) const texmesh::ModuleReaders* texmesh_readers_3() {
  return &texmesh::kReader;
}
