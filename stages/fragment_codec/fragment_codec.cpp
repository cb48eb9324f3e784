#include "stages/fragment_codec/fragment_codec.h"

#include <string>

#include "format/base/errors.h"
#include "stages/fragment_codec/codec_list.h"
#include "stages/fragment_codec/rebuilt_z.h"
#include "stages/image/webp.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {

JpegKind jpeg_kind(const PlaneCoding& plane, int quality) {
  JpegKind kind;
  kind.channels = plane.channels;
  kind.quality = quality;
  kind.subsampling = plane.apart ? Subsampling::k444 : plane.subsampling;
  kind.rgb = plane.channels == 3 && plane.apart;
  kind.coarse_last = kind.rgb && plane.coarse_last;
  return kind;
}

JpegKind baseline_kind(const PlaneCoding& plane, int quality) {
  JpegKind kind = jpeg_kind(plane, quality);
  if (quality < kFinestQuality || plane.channels != 3) return kind;
  kind.subsampling = Subsampling::k444;
  kind.rgb = true;
  kind.coarse_last = false;
  return kind;
}

std::unique_ptr<TextureCodec> make_texture_codec(Codec codec, const PlaneCoding& plane) {
  if (plane.channels != 1 && plane.channels != 3)
    throw StageError("ladder", "channels", "1 or 3", std::to_string(plane.channels));
  if (plane.qualities.empty()) throw StageError("ladder", "rungs", "at least one", "none");
  switch (codec) {
    case Codec::kJpegProgressive:
      return make_progressive_codec(plane);
    case Codec::kWebp:
      return make_webp_codec(plane);
    case Codec::kJpeg:
    case Codec::kJpegXy:
      break;
  }
  return make_jpeg_codec(plane);
}

Pixels decode_fragment_file(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels) {
  if (codec == Codec::kWebp) return decode_lossy_webp(file, max_pixels);
  Pixels pixels = decode_jpeg(file, max_pixels);
  if (codec == Codec::kJpegXy) rebuild_z(pixels);
  return pixels;
}

Pixels decode_fragment_file_luma(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels) {
  return codec == Codec::kJpeg || codec == Codec::kJpegProgressive
             ? decode_jpeg_luma(file, max_pixels)
             : luma_of(decode_fragment_file(codec, file, max_pixels));
}

}  // namespace texmesh
