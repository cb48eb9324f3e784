#include "stages/image/ktx2/read_ktx2.h"

#include <zstd.h>

#include <memory>

#include "stages/image/png_writer.h"

namespace texmesh {
namespace {

constexpr std::string_view kKtx2Magic("\xabKTX 20\xbb\r\n\x1a\n", 12);
constexpr std::size_t kKtx2HeaderBytes = 80, kLevelBytes = 24;
constexpr const char* kReadable = "texels R8, RG8, RGB8 or RGBA8, plain or packed with Zstandard";
constexpr const char* kReadableNotBasis =
    "texels R8, RG8, RGB8 or RGBA8, plain or packed with Zstandard: Basis Universal cannot be read; convert "
    "the file with `ktx extract --transcode rgba8` to a PNG or with `ktx transcode --target rgba8` to a KTX2";

/// By VkFormat.
struct TexelKind {
  std::uint32_t vk_format, channels;
  bool srgb;
};
constexpr TexelKind kTexelKinds[] = {{9, 1, false},  {15, 1, true}, {16, 2, false}, {22, 2, true},
                                     {23, 3, false}, {29, 3, true}, {37, 4, false}, {43, 4, true}};
constexpr std::uint32_t kFirstBlock = 131, kLastBlock = 184;  // BC1 to ASTC 12x12 of Vulkan 1.0

enum Supercompression : std::uint32_t { kPlain = 0, kBasisLz = 1, kZstandard = 2, kZlib = 3 };
enum ColourModel : std::uint8_t { kRgbsda = 1, kEtc1s = 163, kUastc = 166 };

/// A file whose header, level index, descriptor and key/value data have been checked.
class Ktx2File {
 public:
  Ktx2File(const std::string& name, ByteSpan bytes, const ImageLimits& limits) : name_(name), bytes_(bytes) {
    read_header();
    read_descriptor();
    check_kind();
    check_image_size(name_, width_, height_, limits);  // products of sides fit 64 bits from here on
    read_levels();
    read_key_values();
  }
  Ktx2Picture picture() const;

 private:
  [[noreturn]] void fail(const std::string& place, const std::string& expected,
                         const std::string& found) const {
    throw InputError(name_, place, expected, found);
  }
  void check_number(const char* what, std::uint64_t found, std::uint64_t expected) const {
    if (found != expected)
      fail("KTX2 header", std::string(what) + " " + std::to_string(expected), std::to_string(found));
  }
  ByteSpan range(const std::string& place, std::uint64_t at, std::uint64_t count) const {
    if (at > bytes_.size() || count > bytes_.size() - at)
      fail(place, "a range within the " + std::to_string(bytes_.size()) + " bytes of the file",
           std::to_string(count) + " bytes from byte " + std::to_string(at));
    return bytes_.subspan(static_cast<std::size_t>(at), static_cast<std::size_t>(count));
  }
  void read_header();
  void read_descriptor();
  void check_kind();
  void read_levels();
  void read_key_values();
  void read_key(std::string_view key, std::string_view value);
  std::unique_ptr<std::uint8_t[]> unpacked(std::size_t size) const;

  const std::string& name_;
  ByteSpan bytes_;
  std::uint32_t vk_format_ = 0, width_ = 0, height_ = 0, levels_ = 0, scheme_ = 0, channels_ = 0;
  ByteSpan descriptor_, key_values_, base_;
  std::uint8_t model_ = 0;
  bool linear_ = false, bottom_first_ = false;
  std::array<char, 4> swizzle_{};
};

void Ktx2File::read_header() {
  if (!is_ktx2(bytes_) || bytes_.size() < kKtx2HeaderBytes)
    fail("KTX2 header", std::to_string(kKtx2HeaderBytes) + " bytes",
         std::to_string(bytes_.size()) + " bytes");
  BytesIn in(bytes_, name_);
  in.raw(kKtx2Magic.size());
  vk_format_ = in.u32();
  const std::uint32_t type_size = in.u32();
  width_ = in.u32(), height_ = in.u32();
  const std::uint32_t depth = in.u32(), layers = in.u32(), faces = in.u32();
  levels_ = in.u32(), scheme_ = in.u32();
  const std::uint64_t descriptor_at = in.u32(), descriptor_size = in.u32();
  const std::uint64_t values_at = in.u32(), values_size = in.u32();
  const std::uint64_t global_at = in.u64(), global_size = in.u64();
  check_number("size of a channel", type_size, 1);
  check_number("depth", depth, 0);
  if (layers > 1) check_number("layers", layers, 1);
  check_number("faces", faces, 1);
  levels_ = std::max(levels_, 1u);  // 0: to be made by who shows it
  descriptor_ = range("data format descriptor", descriptor_at, descriptor_size);
  key_values_ = range("key/value data", values_at, values_size);
  range("supercompression global data", global_at, global_size);
}

/// The basic block alone (Khronos Data Format 1.3, section 5), which KTX2 asks for.
void Ktx2File::read_descriptor() {
  constexpr std::size_t kLeast = 28;
  BytesIn in(descriptor_, name_);
  if (descriptor_.size() < kLeast || in.u32() != descriptor_.size() || in.u32() != 0)
    fail("data format descriptor", "a basic block of Khronos", "another one or none");
  in.u32();  // version and size of the block
  constexpr std::uint8_t kUnspecified = 0, kBt709 = 1, kLight = 1, kMultiplied = 1;
  model_ = in.u8();
  const std::uint8_t primaries = in.u8(), transfer = in.u8(), flags = in.u8();
  if (model_ == kEtc1s || model_ == kUastc) return;  // refused for what it is
  if (primaries != kUnspecified && primaries != kBt709)
    fail("data format descriptor", "primaries of sRGB (1) or none (0)", std::to_string(primaries));
  if (flags & kMultiplied) fail("data format descriptor", "straight alpha", "alpha that is multiplied in");
  linear_ = transfer == kLight;
}

void Ktx2File::check_kind() {
  if (scheme_ == kBasisLz || model_ == kEtc1s)
    fail("KTX2 header", kReadableNotBasis, "Basis Universal (ETC1S)");
  if (model_ == kUastc) fail("KTX2 header", kReadableNotBasis, "Basis Universal (UASTC)");
  if (scheme_ == kZlib) fail("KTX2 header", kReadable, "texels packed with ZLIB");
  if (scheme_ > kZlib) fail("KTX2 header", kReadable, "supercompression scheme " + std::to_string(scheme_));
  const auto kind = std::ranges::find(kTexelKinds, vk_format_, &TexelKind::vk_format);
  if (kind == std::end(kTexelKinds)) {
    const bool blocks = vk_format_ >= kFirstBlock && vk_format_ <= kLastBlock;
    fail("KTX2 header", kReadable,
         "VkFormat " + std::to_string(vk_format_) + (blocks ? ", blocks of a GPU" : ""));
  }
  if (model_ != kRgbsda) fail("data format descriptor", "colour model RGBSDA (1)", std::to_string(model_));
  channels_ = kind->channels;
  if (kind->srgb) linear_ = false;
  constexpr std::array<char, 4> kMissing[] = {
      {'r', 'r', 'r', '1'}, {'r', 'g', '0', '1'}, {'r', 'g', 'b', '1'}, {'r', 'g', 'b', 'a'}};
  swizzle_ = kMissing[channels_ - 1];
}

void Ktx2File::read_levels() {
  const auto most = static_cast<std::uint32_t>(std::bit_width(std::max(width_, height_)));
  if (levels_ > most)
    fail("KTX2 header", "at most " + std::to_string(most) + " levels", std::to_string(levels_));
  const std::uint64_t index_end = kKtx2HeaderBytes + levels_ * kLevelBytes;
  BytesIn in(range("level index", kKtx2HeaderBytes, levels_ * kLevelBytes), name_);
  for (std::uint32_t level = 0; level < levels_; ++level) {
    const std::string place = "level " + std::to_string(level);
    const std::uint64_t at = in.u64(), packed = in.u64(), unpacked = in.u64();
    const std::uint64_t size =
        std::uint64_t{std::max(width_ >> level, 1u)} * std::max(height_ >> level, 1u) * channels_;
    const ByteSpan stored = range(place, at, packed);
    if (at < index_end) fail(place, "bytes behind the level index", "byte " + std::to_string(at));
    if (unpacked != size)
      fail(place, std::to_string(size) + " bytes of texels, as its size says", std::to_string(unpacked));
    if (scheme_ == kPlain && packed != size)
      fail(place, std::to_string(size) + " plain bytes", std::to_string(packed));
    if (level == 0) base_ = stored;
  }
}

void Ktx2File::read_key_values() {
  BytesIn in(key_values_, name_);
  while (in.left() >= 4) {
    const std::uint32_t size = in.u32();
    if (size > in.left()) fail("key/value data", std::to_string(size) + " bytes", std::to_string(in.left()));
    const std::string entry = in.text(size);
    const std::size_t end = entry.find('\0');
    if (end == std::string::npos) fail("key/value data", "a key that ends", "one without an end");
    // A text ends in a zero, which some writers leave out.
    const std::string_view value = std::string_view(entry).substr(end + 1);
    read_key(entry.substr(0, end), value.substr(0, value.find('\0')));
    in.raw(std::min<std::size_t>((4 - size % 4) % 4, in.left()));
  }
}

void Ktx2File::read_key(std::string_view key, std::string_view value) {
  const auto shown = [&] { return std::string(1, '"').append(value.substr(0, 20)).append(1, '"'); };
  if (key == "KTXorientation") {
    if (value != "rd" && value != "ru") fail("KTXorientation", "\"rd\" or \"ru\"", shown());
    bottom_first_ = value == "ru";
  }
  if (key == "KTXswizzle") {
    if (value.size() != 4 || value.find_first_not_of("rgba01") != std::string_view::npos)
      fail("KTXswizzle", "four of \"rgba01\"", shown());
    // What a texel does not have is 0, its alpha 1.
    constexpr std::string_view kNames = "rgba";
    for (std::size_t c = 0; c < 4; ++c) {
      const std::size_t from = kNames.find(value[c]);
      const bool missing = from != std::string_view::npos && from >= channels_;
      swizzle_[c] = !missing ? value[c] : value[c] == 'a' ? '1' : '0';
    }
  }
}

/// Untouched memory: only texels that are there take any.
std::unique_ptr<std::uint8_t[]> Ktx2File::unpacked(std::size_t size) const {
  const unsigned long long claimed = ZSTD_getFrameContentSize(base_.data(), base_.size());
  if (claimed == ZSTD_CONTENTSIZE_ERROR) fail("level 0", "a frame of Zstandard", "other bytes");
  if (claimed != ZSTD_CONTENTSIZE_UNKNOWN && claimed != size)
    fail("level 0", "a Zstandard frame of " + std::to_string(size) + " bytes", std::to_string(claimed));
  auto texels = std::make_unique_for_overwrite<std::uint8_t[]>(size);
  const std::size_t written = ZSTD_decompress(texels.get(), size, base_.data(), base_.size());
  if (ZSTD_isError(written)) fail("level 0", "a whole Zstandard frame", ZSTD_getErrorName(written));
  if (written != size)
    fail("level 0", "a Zstandard frame of " + std::to_string(size) + " bytes", std::to_string(written));
  return texels;
}

Ktx2Picture Ktx2File::picture() const {
  const std::size_t row = std::size_t{width_} * channels_, size = row * height_;
  const auto memory = scheme_ == kZstandard ? unpacked(size) : nullptr;
  const std::uint8_t* texels = memory ? memory.get() : base_.data();
  const bool grey = swizzle_[0] == swizzle_[1] && swizzle_[1] == swizzle_[2];
  const std::uint32_t made = swizzle_[3] != '1' ? 4 : grey ? 1 : 3;
  std::array<std::size_t, 4> from{};  // 4 and 5 are the constants behind a texel
  for (std::size_t c = 0; c < 4; ++c) from[c] = std::string_view("rgba01").find(swizzle_[c]);
  Ktx2Picture out{{width_, height_, made, {}}, linear_, levels_};
  out.pixels.data.reserve(std::size_t{width_} * height_ * made);
  std::array<std::uint8_t, 6> texel{0, 0, 0, 255, 0, 255};
  for (std::uint32_t y = 0; y < height_; ++y) {
    const std::uint8_t* at = texels + row * (bottom_first_ ? height_ - 1 - y : y);
    for (std::uint32_t x = 0; x < width_; ++x, at += channels_) {
      std::copy_n(at, channels_, texel.begin());
      for (std::uint32_t c = 0; c < made; ++c) out.pixels.data.push_back(texel[from[c]]);
    }
  }
  return out;
}

}  // namespace

bool is_ktx2(ByteSpan bytes) {
  return bytes.size() >= kKtx2Magic.size() &&
         !std::memcmp(bytes.data(), kKtx2Magic.data(), kKtx2Magic.size());
}

Ktx2Picture read_ktx2(const std::string& name, ByteSpan bytes, const ImageLimits& limits) {
  return Ktx2File(name, bytes, limits).picture();
}

Bytes png_of_ktx2(const std::string& name, ByteSpan bytes, const ImageLimits& limits) {
  const Ktx2Picture picture = read_ktx2(name, bytes, limits);
  // A fast level: the file is seldom kept.
  constexpr int kFast = 1;
  return write_png(picture.pixels, {.level = kFast, .linear = picture.linear});
}

}  // namespace texmesh
