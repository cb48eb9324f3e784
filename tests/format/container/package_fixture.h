#pragma once
#include <string>
#include <vector>

#include "format/container/layout.h"
#include "format/documents/package_writer.h"
#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::testing {

inline std::vector<std::uint8_t> fake_jpeg(std::size_t bytes, std::uint8_t value) {
  std::vector<std::uint8_t> b(bytes, value);
  b[0] = 0xff, b[1] = 0xd8, b[bytes - 2] = 0xff, b[bytes - 1] = 0xd9;
  return b;
}

/// The stream that make_package stores for a fragment.
inline std::vector<std::uint8_t> fake_fragment(const PlaneTables& t, std::size_t rung, std::size_t fragment) {
  return fake_jpeg(t.size_bytes[rung * t.fragment_count() + fragment],
                   static_cast<std::uint8_t>(16 * rung + fragment));
}

/// A whole package with scales 0, 4, 9 and `planes` planes of 2 x 1 fragments and 2 rungs; texture and mesh
/// data are stand-ins, everything about the format is real. Both fragments of a plane are stored.
inline std::vector<std::uint8_t> make_package(std::uint32_t planes, std::size_t mesh_bytes = 200) {
  Manifest m;
  m.title = "test";
  m.bounds_max = {1, 2, 3};
  m.object_height = 3;
  for (const int scale : {0, 4, 9}) {
    ManifestScale s;
    s.scale = scale;
    s.triangles = static_cast<std::uint32_t>(100 - scale);
    s.vertices = 50;
    s.display_px_jnd = s.display_px_error = s.display_px_edge = s.display_px_flip =
        scale == 0 ? kAnyDisplayPx : 1000 - 100 * scale;
    m.scales.push_back(s);
  }
  m.steps = {{100, 9}, {600, 4}, {kAnyDisplayPx, 0}};
  m.plane_count = planes;
  std::vector<TextureInfo> textures;
  std::vector<PackageEntry> entries;
  PackageTables tables;
  for (const int scale : {0, 4, 9})
    entries.push_back(
        {mesh_path(scale), std::vector<std::uint8_t>(mesh_bytes, static_cast<std::uint8_t>(scale))});
  for (std::uint32_t p = 0; p < planes; ++p) {
    PlaneTables t = make_tables(2, 1, 2, 3);
    t.order = {1, 0};
    t.covered_texels = {100, 200};
    t.skip_dssim = {1.5f, 1.5f};  // every rung shows more
    std::vector<std::uint8_t> streams;
    for (std::uint32_t r = 0; r < 2; ++r) {
      t.table_bytes[r] = 20 + r;
      const auto stream = fake_jpeg(t.table_bytes[r], static_cast<std::uint8_t>('t' + r));
      streams.insert(streams.end(), stream.begin(), stream.end());
      std::vector<std::uint8_t> pack;
      for (std::size_t f = 0; f < 2; ++f)
        t.size_bytes[r * 2 + f] = static_cast<std::uint32_t>(30 + 7 * r + f + p);
      for (const std::uint16_t f : t.order) {
        const auto bytes = fake_fragment(t, r, f);
        t.digest[r * 2 + f] = truncated(sha256(bytes));
        pack.insert(pack.end(), bytes.begin(), bytes.end());
      }
      entries.push_back({rung_path(p, r), pack});
    }
    entries.push_back({table_streams_path(p), streams});
    entries.push_back({preview_path(p), fake_jpeg(40, 'p')});
    TextureInfo info;
    info.image = p;
    info.role = "base-colour";
    info.name = "wall.jpg";
    info.colour_space = "srgb";
    info.width_px = 500;
    info.height_px = 256;
    info.fragment_width_px = info.fragment_height_px = 256;
    info.columns = 2;
    info.rows = 1;
    info.preview_width_px = 31;
    info.preview_height_px = 16;
    for (const std::uint8_t q : t.rung_quality) info.rung_quality.push_back(q);
    textures.push_back(info);
    tables.planes.push_back(t);
  }
  QualityTable quality{4, {128}, {0, 4, 9}, {}, {}, 1, 0};
  quality.geometry = {{{0, 0.1f, 0.2f}, {0, 0.2f, 0.4f}, {0, 0.1f, 0.2f}}};
  if (planes > 0)
    quality.groups = {{PlaneGroup::kColour,
                       {{{0.125f, 0.5f},
                         {{0.005f, 0.02f}, {0.01f, 0.04f}, {0.002f, 0.01f}},
                         {{1}, {1}, {1}},
                         {{0}, {0}, {0}},
                         {{}, {}, {}}}}}};
  const auto text = [](const std::string& s) { return std::vector<std::uint8_t>(s.begin(), s.end()); };
  entries.push_back({kTablesPath, write_tables(tables)});
  entries.push_back({kQualityPath, text(write_quality(quality))});
  entries.push_back({kProvenancePath, text("{}")});
  entries.push_back({kAboutPath, text(R"({"title":"test"})")});
  return write_package(m, textures, entries);
}

}  // namespace texmesh::testing
