#pragma once
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "format/fields.h"
#include "stages/fragmentation.h"
#include "stages/jpeg.h"

namespace texmesh {

inline constexpr int kLadderVersion = 1;

struct LadderOptions {
  std::vector<int> rungs{5, 8, 11, 18, 30, 53, 75, 86, 93, 97};  // IJG qualities, strictly rising
  Subsampling subsampling = Subsampling::k420;  // of sRGB planes; data planes (normal, ORM) are always 4:4:4
  int training_fragments = 16;
  int preview_quality = 60;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("rungs", s.rungs, Range{1, 100}, "JPEG qualities of the ladder, strictly rising, at most 16");
    v("subsampling", s.subsampling, "chroma resolution of colour textures: 420 halves it, 444 keeps it");
    v("training_fragments", s.training_fragments, Range{1, 256},
      "fragments that a rung's Huffman tables are trained on");
    v("preview_quality", s.preview_quality, Range{1, 100}, "JPEG quality of the preview");
  }
};

/// One rung of one plane: SPEC.md's table stream and the fragments as abbreviated baseline JPEGs (ISO 10918-1
/// B.5).
struct LadderRung {
  int quality = 0;
  std::vector<std::uint8_t> tables;   // SOI DQT DHT EOI
  std::vector<std::uint8_t> data;     // the fragments' streams, in fragment order
  std::vector<std::uint64_t> offset;  // [fragments + 1] into data; empty range = fragment not stored
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.quality, s.tables, s.data, s.offset);
  }
};
struct PlaneLadder {
  std::vector<LadderRung> rungs;  // rising quality
  std::vector<std::uint8_t>
      preview;  // a complete JPEG of the whole plane, 1/16, or 1/8 where that stays < 16 KB
  std::uint32_t preview_width_px = 0, preview_height_px = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.rungs, s.preview, s.preview_width_px, s.preview_height_px);
  }
};
struct Ladder {
  std::vector<PlaneLadder> planes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes);
  }
};

/// Encodes with libjpeg-turbo, ISLOW DCT; data planes (normal, ORM) and `subsampling = 444` without chroma
/// subsampling. Huffman tables of a rung are trained on covered fragments spread over the plane, with a small
/// admixture of the typical tables of ISO 10918-1 annex K.3, so that every symbol that baseline coding can
/// produce has a code: no fragment needs tables of its own. `pixels` are fill_planes()'s. A plane without a
/// covered fragment has tables and a preview but no data. Throws StageError for rungs that do not rise or lie
/// outside 1..100 and for pixels that do not fit the planes. Same bytes for any thread count.
Ladder encode_ladder(const Fragments& fragments, const std::vector<Pixels>& pixels,
                     const LadderOptions& options, const RunContext& context);

/// The rung's stream of one fragment; empty when it is not stored.
std::span<const std::uint8_t> fragment_stream(const LadderRung& rung, std::size_t fragment);

}  // namespace texmesh
