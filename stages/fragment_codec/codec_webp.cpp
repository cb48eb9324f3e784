// Lossy WebP: a complete file per fragment and rung.
#include <webp/decode.h>
#include <webp/encode.h>

#include <string>
#include <utility>

#include "format/base/errors.h"
#include "stages/fragment_codec/codec_list.h"

namespace texmesh {
namespace {

constexpr int kMethod = 4;  // 6 costs twice the time for 1 % fewer bytes

[[noreturn]] void fail(const std::string& expected, const std::string& found) {
  throw FormatError("WebP", "", expected, found);
}

WebPConfig config_of(int quality) {
  WebPConfig config;
  if (!WebPConfigInit(&config))
    throw StageError("webp", "", "libwebp of the version compiled with", "another");
  config.method = kMethod;
  config.quality = static_cast<float>(quality);
  config.emulate_jpeg_size = 1;  // so that rungs mean about the same bytes as those of JPEG
  config.thread_level = 0;
  return config;
}

class Picture {
 public:
  explicit Picture(const PixelWindow& window) {
    if (!WebPPictureInit(&picture_))
      throw StageError("webp", "", "libwebp of the version compiled with", "another");
    picture_.width = static_cast<int>(window.width_px);
    picture_.height = static_cast<int>(window.height_px);
    if (!WebPPictureImportRGB(&picture_, window.data, static_cast<int>(window.stride_bytes))) {
      WebPPictureFree(&picture_);
      throw StageError("webp", "", "memory for a fragment", "none");
    }
  }
  ~Picture() { WebPPictureFree(&picture_); }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;

  void encode(int quality, std::vector<std::uint8_t>& out) {
    picture_.writer = [](const std::uint8_t* data, std::size_t size, const WebPPicture* picture) {
      auto& to = *static_cast<std::vector<std::uint8_t>*>(picture->custom_ptr);
      try {
        to.insert(to.end(), data, data + size);
      } catch (const std::bad_alloc&) {  // must not cross libwebp's frames
        return 0;
      }
      return 1;
    };
    picture_.custom_ptr = &out;
    const WebPConfig config = config_of(quality);
    if (!WebPEncode(&config, &picture_))
      throw StageError("webp", "", "an image that libwebp can code",
                       "error " + std::to_string(picture_.error_code));
  }

 private:
  WebPPicture picture_{};
};

class WebpCodec : public TextureCodec {
 public:
  explicit WebpCodec(const PlaneCoding& plane) : plane_(plane) {}
  Codec id() const override { return Codec::kWebp; }
  std::vector<CodecRung> train(std::span<const PixelWindow>, const RunContext&) override {
    std::vector<CodecRung> rungs;
    for (const int quality : plane_.qualities) rungs.push_back({quality, {}});
    return rungs;
  }
  std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs) const override {
    if (rungs.empty()) return std::make_unique<Encoder>(plane_.qualities);
    std::vector<int> qualities;
    for (const std::size_t r : rungs) qualities.push_back(plane_.qualities[r]);
    return std::make_unique<Encoder>(std::move(qualities));
  }

 private:
  class Encoder : public FragmentEncoder {
   public:
    explicit Encoder(std::vector<int> qualities) : qualities_(std::move(qualities)) {}
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      for (std::size_t r = 0; r < qualities_.size(); ++r)  // WebPEncode() changes the picture
        Picture(fragment).encode(qualities_[r], streams[r]);
    }

   private:
    std::vector<int> qualities_;
  };
  PlaneCoding plane_;
};

}  // namespace

std::unique_ptr<TextureCodec> make_webp_codec(const PlaneCoding& plane) {
  // Lossy WebP is always 4:2:0 YCbCr, which data do not bear, and knows no grey.
  if (plane.channels != 3 || plane.apart)
    throw StageError("ladder", "WebP", "a plane of colours", "data or a single channel");
  return std::make_unique<WebpCodec>(plane);
}

Pixels decode_webp(std::span<const std::uint8_t> file, std::uint64_t max_pixels) {
  constexpr std::size_t kRiffHeader = 8;
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(file.data(), file.size(), &features) != VP8_STATUS_OK)
    fail("a WebP file", "other bytes");
  // RIFF counts the bytes behind its own header, so a longer or shorter file shows here.
  const std::size_t stated =
      kRiffHeader + (file[4] | file[5] << 8 | file[6] << 16 | std::size_t{file[7]} << 24);
  if (stated != file.size())
    fail(std::to_string(stated) + " bytes, as the header says", std::to_string(file.size()));
  if (features.has_alpha || features.has_animation || features.format != 1)
    fail("a lossy picture without alpha", "another kind");
  Pixels out{static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height), 3, {}};
  const std::uint64_t pixels = std::uint64_t{out.width_px} * out.height_px;
  if (pixels > max_pixels)
    fail("at most " + std::to_string(max_pixels) + " pixels",
         std::to_string(out.width_px) + " x " + std::to_string(out.height_px));
  out.data.resize(static_cast<std::size_t>(pixels) * 3);
  if (!WebPDecodeRGBInto(file.data(), file.size(), out.data.data(), out.data.size(),
                         static_cast<int>(out.width_px * 3)))
    fail("an image that decodes", "damaged data");
  return out;
}

}  // namespace texmesh
