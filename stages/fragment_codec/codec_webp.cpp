// Lossy WebP: a complete file per fragment and rung.
#include <utility>

#include "format/base/errors.h"
#include "stages/fragment_codec/codec_list.h"
#include "stages/image/webp.h"

namespace texmesh {
namespace {

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
      WebpOptions options;
      options.as_large_as_jpeg = true;
      for (std::size_t r = 0; r < qualities_.size(); ++r) {
        options.quality = static_cast<float>(qualities_[r]);
        append_webp(fragment, 3, options, streams[r]);
      }
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

}  // namespace texmesh
