#pragma once
#include <gtest/gtest.h>
#include <algorithm>
#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "format/documents/package_writer.h"
#include "stages/base/run_context.h"
#include "stages/gltf/glb_container.h"
#include "stages/package/package.h"
#include "tests/format/documents/tables_fixture.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

inline Bytes fake_jpeg(std::size_t bytes, std::uint8_t value) {
  Bytes b(bytes, value);
  b[0] = 0xff, b[1] = 0xd8, b[bytes - 2] = 0xff, b[bytes - 1] = 0xd9;
  return b;
}

/// What the stages would hand over: three scales (0, 4, 9) of a cube and `planes` planes of 3 x 2 fragments,
/// two rungs.
struct Inputs {
  NestedScales scales;
  PerceptualValues perceptual;
  std::vector<Image> images;
  Fragments fragments;
  Ladder ladder;
  Previews previews;
  PackageTables tables;
  ThesisTables thesis;
  ScaleFiles files;
  GltfScales gltf;
  MeasuredQuality quality;
  PackageOptions options;

  explicit Inputs(std::size_t planes) {
    scales.mesh = testing::cube();
    scales.mesh.origin = {5e6, 0, -5e6};
    for (const int scale : {0, 4, 9}) {
      scales.scales.emplace_back().scale = scale;
      scales.scales.back().error_max = 0.01f * static_cast<float>(scale);
      files.files.push_back({scale, Bytes(static_cast<std::size_t>(1000 - 100 * scale), 'g'),
                             static_cast<std::uint32_t>(100 - scale),
                             static_cast<std::uint32_t>(60 - scale)});
    }
    perceptual.p95 = {0, 0.05f, 0.2f, 0, 0, 0.15f, 0, 0, 0};
    perceptual.p99 = {0, 0.06f, 0.3f, 0, 0, 0.25f, 0, 0, 0};
    perceptual.step.resize(3);
    for (auto* chain : {&perceptual.chain_average, &perceptual.chain_largest, &perceptual.chain_least})
      chain->assign(9, 0.02f);
    perceptual.major = {1, 0, 1};
    perceptual.kept = {1, 1, 1};
    perceptual.display_px_edge = {3e9f, 400, 100};
    perceptual.display_px_error = {2e9f, 500, 200};
    perceptual.display_px_jnd = {2e9f, 700, 150};
    perceptual.object_height = 2;
    quality.table.views = 4;
    quality.table.sizes_px = {128};
    quality.table.scales = {0, 4, 9};
    quality.table.geometry = {{{0, 0.1f, 0.2f}, {0, 0.3f, 0.4f}, {0, 0.1f, 0.2f}}};
    quality.display_px_flip = {1e9f, 512, 128};
    for (std::size_t p = 0; p < planes; ++p) add_plane(p);
  }

  void add_plane(std::size_t p) {
    PlaneTables t = testing::make_tables(3, 2, 2, 10);
    PlaneLadder rungs;
    for (std::size_t r = 0; r < 2; ++r) {
      LadderRung rung;
      rung.quality = t.rung_quality[r];
      rung.table_stream = fake_jpeg(t.table_bytes[r], 't');
      rung.offset.push_back(0);
      for (std::size_t f = 0; f < 6; ++f) {
        const std::size_t bytes = t.size_bytes[r * 6 + f];
        const Bytes stream = bytes ? fake_jpeg(bytes, static_cast<std::uint8_t>(f)) : Bytes{};
        if (bytes) t.digest[r * 6 + f] = truncated(sha256(stream));
        rung.data.insert(rung.data.end(), stream.begin(), stream.end());
        rung.offset.push_back(rung.data.size());
      }
      rungs.rungs.push_back(std::move(rung));
    }
    previews.planes.push_back({fake_jpeg(300 + p, 'p'), 48, 32});
    TexturePlane plane;
    plane.image = static_cast<std::uint32_t>(p);
    plane.width_px = 760;
    plane.height_px = 500;
    plane.fragment_width_px = plane.fragment_height_px = 256;
    plane.columns = 3;
    plane.rows = 2;
    plane.grid_reason = "fits";
    Image image;
    image.name = "wall.jpg";
    images.push_back(image);
    fragments.planes.push_back(plane);
    ladder.planes.push_back(std::move(rungs));
    PlaneThesis& said = thesis.planes.emplace_back();
    said.quality = t.quality;
    said.total_bytes.assign(10 * kGammaSteps, 1000);
    tables.planes.push_back(std::move(t));
  }

  Poster poster;    // none
  Proxies proxies;  // none
  About about;

  Bytes assemble() const {
    return assemble_package(scales, perceptual, images, fragments, ladder, previews, tables, thesis, files,
                            gltf, quality, poster, proxies, about, 0.1, "{\"texmesh\":\"test\"}", options,
                            {});
  }
};

inline Manifest manifest_of(const Bytes& package) {
  const auto source = memory_source(package);
  const ContainerEntry entry = read_container(*source).front();
  EXPECT_EQ(entry.path, "manifest.json");
  EXPECT_LE(entry.offset + entry.bytes, kBootstrapBytes);
  return read_manifest(source->read(entry.offset, entry.bytes));
}

inline Bytes part(const Bytes& package, const EntryRef& ref) {
  return memory_source(package)->read(ref.offset, ref.bytes);
}

}  // namespace texmesh::testing
