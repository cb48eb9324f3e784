#include "stages/image/avif.h"

#include <memory>

#include <avif/avif.h>

namespace texmesh {
namespace {

/// libaom's levels that have the 1 - SSIM of JPEGs of these qualities (mips of five scans, mean).
struct QualityLevel {
  double quality, level;
};
constexpr std::array<QualityLevel, 12> kLevels{{{0, 63},
                                                {5, 61},
                                                {8, 57},
                                                {11, 53},
                                                {18, 46},
                                                {30, 38},
                                                {53, 31},
                                                {75, 24},
                                                {86, 17},
                                                {93, 10},
                                                {97, 3},
                                                {100, 0}}};
constexpr int kSpeed = 6, kQuickSpeed = 8;
constexpr const char* kAlphaLevel = "10";

int level_of(double quality) {
  const double q = std::clamp(quality, kLevels.front().quality, kLevels.back().quality);
  std::size_t i = 1;
  while (q > kLevels[i].quality) ++i;
  const QualityLevel &a = kLevels[i - 1], &b = kLevels[i];
  const double share = (q - a.quality) / (b.quality - a.quality);
  return static_cast<int>(std::floor(a.level + (b.level - a.level) * share + 0.5));
}

void require_done(avifResult result) {
  if (result != AVIF_RESULT_OK)
    throw StageError("avif", "", "an image that libavif can code", avifResultToString(result));
}

using ImagePointer = std::unique_ptr<avifImage, void (*)(avifImage*)>;

/// The planes that are coded.
ImagePointer planes_of(const Pixels& pixels, const AvifOptions& options) {
  const bool grey = pixels.channels == 1, plain = options.data && !grey;
  ImagePointer image(avifImageCreate(pixels.width_px, pixels.height_px, 8,
                                     grey ? AVIF_PIXEL_FORMAT_YUV400 : AVIF_PIXEL_FORMAT_YUV444),
                     avifImageDestroy);
  if (!image) throw StageError("avif", "", "memory for an image", "none");
  image->yuvRange = AVIF_RANGE_FULL;
  image->colorPrimaries = AVIF_COLOR_PRIMARIES_BT709;
  image->transferCharacteristics = AVIF_TRANSFER_CHARACTERISTICS_SRGB;
  image->matrixCoefficients = plain ? AVIF_MATRIX_COEFFICIENTS_IDENTITY : AVIF_MATRIX_COEFFICIENTS_BT601;
  Bytes three;
  for (const std::uint8_t v : grey ? pixels.data : Bytes()) three.insert(three.end(), 3, v);
  avifRGBImage rgb;
  avifRGBImageSetDefaults(&rgb, image.get());
  rgb.format = pixels.channels == 4 ? AVIF_RGB_FORMAT_RGBA : AVIF_RGB_FORMAT_RGB;
  rgb.depth = 8;
  rgb.pixels = const_cast<std::uint8_t*>(grey ? three.data() : pixels.data.data());  // is only read
  rgb.rowBytes = pixels.width_px * (pixels.channels == 4 ? 4 : 3);
  require_done(avifImageRGBToYUV(image.get(), &rgb));
  return image;
}

struct Decoder {
  const std::unique_ptr<avifDecoder, void (*)(avifDecoder*)> owner{avifDecoderCreate(), avifDecoderDestroy};
  avifDecoder* const avif = owner.get();
  const std::string& name;
  Decoder(const std::string& file, ByteSpan bytes, const ImageLimits& limits) : name(file) {
    if (!avif) throw InputError(name, "image header", "memory for an AVIF decoder", "none");
    avif->maxThreads = 1;
    avif->ignoreExif = avif->ignoreXMP = AVIF_TRUE;
    check("image header", avifDecoderSetIOMemory(avif, bytes.data(), bytes.size()));
    check("image header", avifDecoderParse(avif));
    // libavif would call too large an image a file that cannot be parsed. No pixel has been decoded.
    check_image_size(name, avif->image->width, avif->image->height, limits);
    avif->imageSizeLimit = static_cast<std::uint32_t>(
        std::clamp<std::uint64_t>(limits.max_pixels, 1, AVIF_DEFAULT_IMAGE_SIZE_LIMIT));
    avif->imageDimensionLimit =
        std::min<std::uint32_t>(limits.max_side_px, AVIF_DEFAULT_IMAGE_DIMENSION_LIMIT);
  }
  void check(const char* place, avifResult result) const {
    if (result != AVIF_RESULT_OK) throw InputError(name, place, "a whole AVIF", avifResultToString(result));
  }
};

/// The first or the last channel of RGB or RGBA that has but grey.
template <class T>
std::vector<T> grey_of(const std::vector<T>& samples, std::uint32_t channels) {
  std::vector<T> out;
  out.reserve(samples.size() / channels * (channels - 2));
  for (std::size_t i = 0; i < samples.size(); i += channels) {
    out.push_back(samples[i]);
    if (channels == 4) out.push_back(samples[i + 3]);
  }
  return out;
}

template <class T>
std::vector<T> samples_of(const Decoder& decoder, bool alpha) {
  const avifImage& image = *decoder.avif->image;
  const std::uint32_t channels = alpha ? 4 : 3;
  std::vector<T> out(std::size_t{image.width} * image.height * channels);
  avifRGBImage rgb;
  avifRGBImageSetDefaults(&rgb, &image);
  rgb.format = alpha ? AVIF_RGB_FORMAT_RGBA : AVIF_RGB_FORMAT_RGB;
  rgb.depth = 8 * sizeof(T);
  rgb.pixels = reinterpret_cast<std::uint8_t*>(out.data());
  rgb.rowBytes = static_cast<std::uint32_t>(image.width * channels * sizeof(T));
  decoder.check("pixels", avifImageYUVToRGB(&image, &rgb));
  return image.yuvFormat == AVIF_PIXEL_FORMAT_YUV400 ? grey_of(out, channels) : out;
}

}  // namespace

bool is_avif(ByteSpan bytes) {
  const avifROData data{bytes.data(), bytes.size()};
  return bytes.size() >= 16 && avifPeekCompatibleFileType(&data);
}

AvifPicture decode_avif(const std::string& name, ByteSpan bytes, const ImageLimits& limits) {
  const Decoder decoder(name, bytes, limits);
  const avifImage& image = *decoder.avif->image;
  if (image.transformFlags & (AVIF_TRANSFORM_CLAP | AVIF_TRANSFORM_IROT | AVIF_TRANSFORM_IMIR))
    throw InputError(name, "image header", "a picture that is not to be cut, turned or mirrored",
                     "one that is");
  decoder.check("pixels", avifDecoderNextImage(decoder.avif));
  const bool alpha = decoder.avif->alphaPresent == AVIF_TRUE;
  AvifPicture out;
  out.width_px = image.width, out.height_px = image.height;
  out.channels = (image.yuvFormat == AVIF_PIXEL_FORMAT_YUV400 ? 1 : 3) + (alpha ? 1 : 0);
  out.more_pictures = decoder.avif->imageCount > 1;
  out.profile = image.icc.size > 0;
  if (image.depth > 8)
    out.samples = samples_of<std::uint16_t>(decoder, alpha);
  else
    out.samples = samples_of<std::uint8_t>(decoder, alpha);
  return out;
}

Bytes encode_avif(const Pixels& pixels, const AvifOptions& options) {
  const ImagePointer image = planes_of(pixels, options);
  const std::unique_ptr<avifEncoder, void (*)(avifEncoder*)> encoder(avifEncoderCreate(), avifEncoderDestroy);
  if (!encoder) throw StageError("avif", "", "memory for a coder", "none");
  encoder->codecChoice = AVIF_CODEC_CHOICE_AOM;
  encoder->maxThreads = 1;
  encoder->speed = options.quick ? kQuickSpeed : kSpeed;
  encoder->minQuantizer = encoder->minQuantizerAlpha = AVIF_QUANTIZER_BEST_QUALITY;
  encoder->maxQuantizer = encoder->maxQuantizerAlpha = AVIF_QUANTIZER_WORST_QUALITY;
  const std::string level = std::to_string(level_of(options.quality));
  avifEncoderSetCodecSpecificOption(encoder.get(), "end-usage", "q");
  avifEncoderSetCodecSpecificOption(encoder.get(), "color:cq-level", level.c_str());
  avifEncoderSetCodecSpecificOption(encoder.get(), "alpha:cq-level", kAlphaLevel);
  avifEncoderSetCodecSpecificOption(encoder.get(), "tune", "ssim");
  avifRWData coded = AVIF_DATA_EMPTY;
  const std::unique_ptr<avifRWData, void (*)(avifRWData*)> owner(&coded, avifRWDataFree);
  require_done(avifEncoderWrite(encoder.get(), image.get(), &coded));
  return {coded.data, coded.data + coded.size};
}

std::string avif_version() {
  char codecs[256];
  avifCodecVersions(codecs);
  return std::string(avifVersion()) + " (" + codecs + ")";
}

}  // namespace texmesh
