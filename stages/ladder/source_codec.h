#pragma once
// Inside the ladder only.
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/ladder/ladder.h"

namespace texmesh {

/// The codec of a plane whose source image is a JPEG.
struct SourceCodec {
  std::unique_ptr<TextureCodec> codec;  // of codec id jpeg; none: the plane is coded from its pixels
  std::string why_not;                  // of a JPEG without codec
  /// What a sample of the plane takes at each whole quality, [0..100], and at the top rung's what that takes;
  /// 0 above it, and of data at most qualities. Empty for an empty sample.
  std::vector<double> bits;
};

/// Codes the fragments of a full-size plane from the coefficients of its source, a JPEG that libjpeg reads as
/// 8-bit coefficients, in the source's components.
/// - The last rung has the source's coefficients wherever a covered texel is seen (RequantisedJpeg), and
/// Huffman
///   tables of exactly its symbols. Its quality is quality_of() the source's quantisers, or one more than
///   that of the highest rung that was asked for.
/// - The rungs below are requantised by IJG's tables: colours by both, data by the luma table alone, because
///   their chroma is as good as any channel (a turtle's normals: 525 kB and 2.7 degrees instead of 621 kB and
///   3.0). Multiples of the source's own quantisers were tried: on four scans the same bytes at equal error
///   at high qualities, up to a tenth more at low ones.
/// - `options.prune`: the qualities below are those whose bytes are nearest to fixed parts of the top's.
///   Otherwise they are all that `options` asks for, but 100.
/// The codec's train() has no use for its sample. `pixels` are the plane's, filled; `plane`, `pixels` and
/// `options` outlive the codec. It holds two bytes for every sample of the source. No codec for mips, alpha
/// planes and other formats. Same bytes for any thread count.
SourceCodec make_source_codec(const TexturePlane& plane, const Pixels& pixels, const Image& image,
                              const LadderOptions& options, const RunContext& context);

}  // namespace texmesh
