#pragma once
// The packages that the vectors speak of: the golden ones, with a quality table and a column of switch sizes
// made by code, as formats before these have neither. They stand beside the vectors, so that both clients
// read them.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/package_writer.h"
#include "format/documents/quality_table.h"
#include "format/rules/viewing.h"

namespace texmesh {

inline PictureLosses losses_of(std::vector<float> flip) {
  PictureLosses losses{flip, flip, flip};
  for (float& v : losses.flip_p95) v = std::min(1.0f, 3 * v);
  for (float& v : losses.dssim) v /= 2;
  return losses;
}

/// Losses that grow with scale, texels' loss, levels and displayed height; each group has its own.
inline QualityTable made_quality_table(const std::vector<ManifestScale>& scales,
                                       const std::vector<TextureInfo>& textures, float exponent) {
  QualityTable table;
  table.views = 4;
  table.sizes_px = {64, 256, 1024};
  table.exponent = exponent;
  table.error = 0.0625f;
  for (const ManifestScale& s : scales) table.scales.push_back(s.scale);
  for (std::size_t g = 0; g < kPlaneGroups; ++g)
    if (std::ranges::any_of(
            textures, [&](const TextureInfo& t) { return group_of(t.role) == static_cast<PlaneGroup>(g); }))
      table.groups.push_back({static_cast<PlaneGroup>(g), {}});
  for (std::size_t k = 0; k < table.sizes_px.size(); ++k) {
    const float shown = 0.5f + 0.25f * static_cast<float>(k);
    std::vector<float> geometry;
    for (std::size_t i = 0; i < scales.size(); ++i)
      geometry.push_back(0.0125f * static_cast<float>(i * (i + 1)) * shown);
    table.geometry.push_back(losses_of(geometry));
    for (GroupLosses& group : table.groups) {
      const float part = shown / (1 + 0.75f * static_cast<float>(group.group));
      group.sizes.push_back({{0.002f, 0.03125f, 0.25f},
                             losses_of({0.011f * part, 0.0475f * part, 0.17f * part}),
                             losses_of({0.031f * part, 0.075f * part, 0.123f * part})});
    }
  }
  return table;
}

/// The golden package at that path, as it would be with what it lacks. Its coarsest scale passes for S_0 at
/// some heights or at none.
inline std::vector<std::uint8_t> vector_package(const std::string& golden, float exponent,
                                                bool coarsest_passes) {
  const auto source = open_file_source(golden);
  std::vector<PackageEntry> entries;
  std::vector<std::uint8_t> manifest_bytes, textures_bytes;
  for (const ContainerEntry& e : read_container(*source)) {
    std::vector<std::uint8_t> bytes = source->read(e.offset, e.bytes);
    if (e.path == kManifestPath)
      manifest_bytes = std::move(bytes);
    else if (e.path == kTexturesPath)
      textures_bytes = std::move(bytes);
    else if (e.path != kIndexPath && e.path != kQualityPath)
      entries.push_back({e.path, std::move(bytes)});
  }
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(manifest_bytes);
  nlohmann::ordered_json& scales = json["scales"];
  for (std::size_t i = 0; i < scales["scale"].size(); ++i) {
    const double error = scales["displayPxError"][i];
    const bool coarsest = i + 1 == scales["scale"].size();
    scales["displayPxFlip"].push_back(i == 0                         ? kAnyDisplayPx
                                      : coarsest && !coarsest_passes ? 0.0
                                                                     : std::clamp(0.75 * error, 32.0, 1024.0));
  }
  const std::string text = json.dump();
  Manifest manifest =
      read_manifest(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  manifest.steps = step_function(manifest.scales, StepRule::kFlip);
  const std::vector<TextureInfo> textures = read_textures(textures_bytes);
  const std::string quality = write_quality(made_quality_table(manifest.scales, textures, exponent));
  entries.push_back({kQualityPath, {quality.begin(), quality.end()}});
  return write_package(manifest, textures, entries);
}

}  // namespace texmesh
