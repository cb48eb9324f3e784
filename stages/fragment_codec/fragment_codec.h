#pragma once

#include "stages/base/run_context.h"
#include "stages/data/ladder.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {

/// All quantisers are 1. Baseline JPEGs of this quality have their channels apart, because YCbCr, in whole
/// numbers, loses more than these quantisers: on a helmet whose textures are PNGs half of the lit pictures'
/// FLIP.
inline constexpr int kFinestQuality = 100;

/// What is coded: all fragments of one plane.
struct PlaneCoding {
  std::uint32_t channels = 3;                                   // 1 or 3
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0;  // multiples of 16
  bool apart = false;        // three channels are coded as they are; otherwise as YCbCr
  bool coarse_last = false;  // with `apart`: the last channel is quantised more coarsely (JpegKind)
  bool without_z = false;    // with `apart`: windows are those of without_z(), Codec::kJpegXy
  Subsampling subsampling = Subsampling::k420;  // of YCbCr
  std::vector<int> qualities;                   // wanted rungs, IJG scale, strictly rising
};

/// How a plane's JPEGs are coded.
JpegKind jpeg_kind(const PlaneCoding& plane, int quality);
/// Of baseline JPEGs, whose rungs need not be alike: at kFinestQuality three channels are coded as they are.
JpegKind baseline_kind(const PlaneCoding& plane, int quality);

/// A rung as the package describes it.
struct CodecRung {
  int quality = 0;                         // IJG's scale
  std::vector<std::uint8_t> table_stream;  // what its fragments' streams share
};

/// Encodes fragments, one thread's at a time.
class FragmentEncoder {
 public:
  virtual ~FragmentEncoder() = default;
  /// Appends the fragment's stream of the encoder's rung r to streams[r].
  virtual void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) = 0;
};

/// A way to code the fragments of one plane at all rungs. What is done with the streams afterwards (joining
/// them to files, cutting files to streams) needs no pixels and stands in format/model/codec.h.
class TextureCodec {
 public:
  virtual ~TextureCodec() = default;
  virtual Codec id() const = 0;
  /// Chooses rungs and makes their table streams from a sample of the plane; once, before encoder(). The
  /// sample may be empty. Same result for any thread count.
  virtual std::vector<CodecRung> train(std::span<const PixelWindow> sample, const RunContext& context) = 0;
  /// Encoders of several threads may run at once. The codec must outlive them. `rungs`: rising indices of
  /// those that are wanted, of an incremental codec (format/model/codec.h) the first ones; none stands for
  /// all.
  virtual std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs = {}) const = 0;
};

/// StageError when the codec cannot code such planes.
std::unique_ptr<TextureCodec> make_texture_codec(Codec codec, const PlaneCoding& plane);

/// Pixels of a complete file (join_fragment()), 1 or 3 channels. FormatError when it is damaged, larger than
/// max_pixels, or not of that codec; nothing is allocated for pixels before their number is checked.
Pixels decode_fragment_file(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels);
/// The same, but luma as JPEG defines it (grey planes: as they are).
Pixels decode_fragment_file_luma(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels);

/// The complete image file of a stored fragment at a rung. FormatError when a part is damaged.
std::vector<std::uint8_t> fragment_file(const PlaneLadder& plane, std::size_t rung, std::size_t fragment);

/// Its pixels, or luma only. FormatError when it is damaged or has more than max_pixels.
Pixels decode_fragment(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels);

Pixels decode_fragment_luma(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                            std::uint64_t max_pixels);

/// The z of unit vectors of whose components the bytes b stand for 2 b / 255 - 1 (SPEC.md, F24): the third
/// channel of every texel becomes what makes the length 1, never below 128. Of three channels; others stay.
void rebuild_z(Pixels& pixels);

/// What codec jpeg-xy codes: x and y of the vectors made as long as 1, and 128 for z. Of three channels.
Pixels without_z(const PixelWindow& window);

/// How three channels become the components of JPEGs.
struct CodingSpace {
  bool apart = true;                            // as they are; otherwise as YCbCr
  Subsampling subsampling = Subsampling::k444;  // of YCbCr
  bool coarse_last = false;                     // of channels apart: JpegKind::coarse_last
  bool without_z = false;                       // x and y apart, z is rebuilt: Codec::kJpegXy
  friend bool operator==(const CodingSpace&, const CodingSpace&) = default;
};

/// What three channels of data are: the vectors of a normal map, whose error is the angle, or numbers.
enum class DataKind : std::uint8_t { kVectors, kNumbers };

/// The space in which baseline JPEGs of the data have the least mean error for their bytes: channels apart,
/// vectors with a coarse z or not or with z left to the reader (unless `needs_z`), YCbCr 4:4:4 or YCbCr
/// 4:2:0. Error is the angle of vectors and the squared error of numbers, over covered texels. Measured on at
/// most 32 windows of `sample` at three qualities; bytes are compared at equal errors. A space is left out
/// whose least error is more than twice that of channels apart. Channels apart for an empty sample. `sample`:
/// windows of 3 channels, whose sides are multiples of 16. Same result for any thread count.
CodingSpace measure_coding_space(DataKind kind, bool needs_z, std::span<const PixelWindow> sample,
                                 const RunContext& context);

}  // namespace texmesh
