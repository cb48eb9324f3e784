#pragma once

#include "format/base/note.h"
#include "format/model/codec.h"

namespace texmesh {

/// PlaneTables::knot_quality and knot_position.
struct SizeKnots {
  std::vector<std::uint8_t> quality;
  std::vector<float> position;
  static void archive(auto& s, auto& a) { a(s.quality, s.position); }
};

/// One rung of one plane: the table stream and the fragments' streams, as SPEC.md has them.
struct LadderRung {
  int quality = 0;  // IJG's scale; of the baseline JPEG of equal error for progressive files
  std::vector<std::uint8_t> table_stream;  // what the rung's streams share: Huffman and quantiser tables
  std::vector<std::uint8_t> data;          // the fragments' streams, in fragment order
  std::vector<std::uint64_t> offset;       // [fragments + 1] into data; empty range = fragment not stored
  static void archive(auto& s, auto& a) { a(s.quality, s.table_stream, s.data, s.offset); }
};

/// Whether the package holds the plane's source image as a file, and whether its colours are the plane's.
enum class SourceFile : std::uint8_t { kNone, kSameColours, kOtherColours };

struct PlaneLadder {
  Codec codec = Codec::kJpeg;
  bool source_rung = false;  // the last rung holds the coefficients of the source, a JPEG
  SourceFile source = SourceFile::kNone;
  std::vector<LadderRung> rungs;  // rising quality
  // Sizes between the rungs; of full-size colours as baseline JPEGs only: halving a texture takes the traces
  // of its source's quantisers away
  SizeKnots knots;
  static void archive(auto& s, auto& a) { a(s.codec, s.source_rung, s.source, s.rungs, s.knots); }
};

struct Ladder {
  std::vector<PlaneLadder> planes;
  Notes notes;
  static void archive(auto& s, auto& a) { a(s.planes, s.notes); }
};

/// The rung's own stream of one fragment; empty when it is not stored.
std::span<const std::uint8_t> fragment_stream(const LadderRung& rung, std::size_t fragment);

/// The bytes a client needs to show a fragment at a rung: its stream, and those below it where they are parts
/// of one file. 0 when it is not stored.
std::uint64_t bytes_to_show(const PlaneLadder& plane, std::size_t rung, std::size_t fragment);

}  // namespace texmesh
