#pragma once
#include "format/model/model.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kLadderVersion = 20;

/// Side of the smallest fragments that are coded progressively: below it scans' headers and tables cost more
/// than refinement saves.
inline constexpr std::uint32_t kLeastProgressiveSide = 256;

enum class LadderMode : std::uint8_t { kJpeg, kProgressive, kWebp };
template <>
struct EnumNames<LadderMode> {
  static constexpr std::array<std::string_view, 3> names{"jpeg", "progressive", "webp"};
};

enum class Uncovered : std::uint8_t { kFree, kKept };
template <>
struct EnumNames<Uncovered> {
  static constexpr std::array<std::string_view, 2> names{"free", "kept"};
};

struct LadderOptions {
  LadderMode mode = LadderMode::kJpeg;
  // IJG qualities, strictly rising, for colours, normals, other data, and alpha:
  std::vector<int> rungs{5, 8, 11, 18, 30, 53, 75, 86, 93, 97};
  std::vector<int> normal_rungs{30, 53, 75, 86, 93, 97};
  std::vector<int> data_rungs{18, 30, 53, 75, 86, 93, 97};
  std::vector<int> alpha_rungs{18, 30, 53, 75, 86, 93, 97};
  int progressive_quality = 92;                 // of a colour plane's whole progressive files
  Subsampling subsampling = Subsampling::k420;  // of sRGB planes
  Uncovered uncovered = Uncovered::kFree;
  int training_fragments = 64;
  int preview_quality = 60;  // stages/previews reads it; the ladder is made from the previews
  bool prune = true;
  bool keep_source = false;
  static void fields(auto& s, auto&& v) {
    v("mode", s.mode,
      "jpeg = baseline JPEGs; progressive = one progressive JPEG per fragment, of which each rung is a "
      "beginning (fragments then have 256 px or more, unless min_fragment_px is set); webp = lossy WebP for "
      "colours");
    v("rungs", s.rungs, Range{1, 100},
      "JPEG qualities of colour textures, strictly rising, at most 16; the last rung of a JPEG is its own");
    v("normal_rungs", s.normal_rungs, Range{1, 100}, "JPEG qualities of normal maps");
    v("data_rungs", s.data_rungs, Range{1, 100}, "JPEG qualities of occlusion, roughness, metalness");
    v("alpha_rungs", s.alpha_rungs, Range{1, 100}, "JPEG qualities of alpha channels");
    v("progressive_quality", s.progressive_quality, Range{10, 100},
      "JPEG quality of a colour texture's whole progressive files; data use their highest rung");
    v("subsampling", s.subsampling, "chroma resolution of colour textures: 420 halves it, 444 keeps it");
    v("uncovered", s.uncovered,
      "what baseline JPEGs keep of texels that no chart covers: free = whatever makes their blocks "
      "cheap; kept = what the fill, or the source with --fill none, has there");
    v("training_fragments", s.training_fragments, Range{1, 256}, ProfileOnly{},
      "fragments that a rung's Huffman tables are trained on");
    v("preview_quality", s.preview_quality, Range{1, 100}, ProfileOnly{}, "JPEG quality of the preview");
    v("prune", s.prune,
      "store only the rungs, of full size and mips, that simulated loads choose and that are worth their bytes; "
      "false = store all of them");
    v("keep_source", s.keep_source, "keep the source images as files");
  }
};

/// The qualities that `options` has for planes of a role.
const std::vector<int>& ladder_rungs(TextureRole role, const LadderOptions& options);

/// Whether the encoder knows which texels are uncovered and makes them cheap itself, so that their fill need
/// not.
inline bool encoder_frees_uncovered(LadderMode mode, Uncovered uncovered) {
  return mode == LadderMode::kJpeg && uncovered == Uncovered::kFree;
}

/// Encodes every covered fragment at rungs of its plane's role.
/// - JPEGs by libjpeg-turbo, ISLOW DCT: colours as YCbCr with the chroma resolution of `subsampling`, data in
///   the space that has the least error for its bytes (stages/fragment_codec/fragment_codec.h). Fragments
///   with uncovered texels go through stages/jpeg/masked_jpeg.h where such texels are free, so that only
///   covered texels cost bytes.
/// - Tables are trained on covered fragments spread over the plane. The tables have a code for every symbol,
///   so that no fragment needs tables of its own. A plane without a covered fragment has tables but no data.
/// - A few fragments are encoded at every rung. With `prune` they decide which rungs are worth storing
///   (stages/ladder/choose_rungs.h); the others are encoded at these only.
/// - Mode jpeg: full-size planes whose source is a JPEG keep its coefficients as their last rung, and the
/// rungs
///   below are made from these (encode_rungs.h). A note says why a JPEG's plane is coded from
///   pixels instead, and how far its last rung is off.
/// - With `keep_source` full-size planes but alpha name their image's file for the package: an alpha plane
///   relies on its image's colour plane.
/// `pixels` are fill_planes()'s. `previews` are make_previews()'s and read with `prune`; `images`
/// are the model's; empty: no plane has a source. Beside the result it takes some fragments' streams per
/// thread, and two bytes for every sample of the source JPEGs. Throws StageError for rungs that do not rise
/// or lie outside 1..100 and for inputs that do not fit each other. Same bytes for any thread count.
Ladder encode_ladder(const Fragments& fragments, const std::vector<Pixels>& pixels, const Previews& previews,
                     const std::vector<Image>& images, const LadderOptions& options,
                     const RunContext& context);

}  // namespace texmesh
