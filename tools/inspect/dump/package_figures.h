#pragma once

#include "format/documents/manifest.h"
#include "format/documents/tables.h"
#include "format/split/split_stream.h"

namespace texmesh {

// What dump shows beyond the fields that stand in a package: sums and means, computed once for text and JSON.

struct KindBytes {
  std::string kind;  // "meshes", "textures", ...
  std::uint64_t entries = 0, bytes = 0;
};
/// Entries of a package by what they are for, in a fixed order; kinds without entries are left out.
std::vector<KindBytes> bytes_by_kind(const Manifest& manifest, std::uint64_t manifest_bytes,
                                     const std::vector<EntryRef>& index);

/// A scale of the vertex-split stream: its counts, and the bytes from the stream's start to it.
struct StreamFigures {
  int scale = 0;
  std::uint32_t points = 0, triangles = 0, blocks = 0;
  std::uint64_t bytes = 0;  // all of: head, connectivity, positions, texture coordinates, others
  std::uint64_t connectivity = 0, positions = 0, uv = 0, others = 0;
};
std::vector<StreamFigures> stream_figures(const SplitStreamHead& head);

struct RungFigures {
  int quality = 0;
  std::uint64_t bytes = 0, table_bytes = 0;  // of all fragments; of the table stream
  double mse = 0, ssim = 1;                  // means over covered texels
  double surface_ssim = 1;                   // mean over the object's surface, see surface_weights()
};
std::vector<RungFigures> rung_figures(const PlaneTables& tables);
std::uint64_t stored_fragments(const PlaneTables& tables);

/// The texture quality that the tables ask for at the scale of a row and Gamma.
struct AllocationFigures {
  double gamma = 0, quality_min = 0, quality_mean = 0, quality_max = 0;  // quality 0: skipped
  std::uint64_t bytes = 0;  // of the chosen rungs, table streams not counted
  // Per fragment: q_i(x, y) (with rd: the quality of the rung), its rung, d_i(x, y)
  std::vector<float> fragment_quality;
  std::vector<std::int16_t> fragment_rung;
  std::vector<std::uint32_t> fragment_bytes;
};
/// Without `gamma` (0..1): at the default one, the mean of eta.
AllocationFigures allocation_figures(const PlaneTables& tables, std::size_t row,
                                     std::optional<double> gamma = {});
std::string allocation_name(const PlaneTables& tables);  // "thesis", "log" or "rd"

}  // namespace texmesh
