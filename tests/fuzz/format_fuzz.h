#pragma once
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/documents/about.h"
#include "format/documents/index.h"
#include "format/documents/thesis_tables.h"
#include "format/rules/allocation.h"
#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "tests/format/container/package_fixture.h"
#include "tests/format/documents/manifest_fixture.h"
#include "tests/format/split/split_fixture.h"

namespace texmesh::fuzz {
namespace detail {

using Input = std::span<const std::uint8_t>;
using texmesh::testing::as_bytes;

inline void require(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "format fuzz: %s\n", what);
  std::abort();
}

inline void fuzz_container(Input input) {
  const auto source = memory_source(input);
  Bytes again;
  ContainerWriter writer([&](Input part) { again.insert(again.end(), part.begin(), part.end()); });
  for (const ContainerEntry& e : read_container(*source)) {
    check_crc(*source, e);
    writer.add(e.path, source->read(e.offset, e.bytes));
  }
  writer.finish();
  require(std::ranges::equal(again, input), "a container was accepted that its entries do not lead to");
}

inline void fuzz_manifest(Input input) {
  const Manifest m = read_manifest(input);
  std::string json;
  try {
    json = write_manifest(m);
  } catch (const FormatError&) {
    // Without its unknown fields it is shorter, but six digits can make two steps equal, and long numbers can
    // fill the 16 KiB that the file's own notation did not.
    return;
  }
  require(write_manifest(read_manifest(as_bytes(json))) == json, "a manifest changed by being written twice");
}

inline void fuzz_textures(Input input) {
  const auto textures = read_textures(input);
  require(read_textures(as_bytes(write_textures(textures))) == textures, "textures changed by being written");
}

inline void fuzz_index(Input input) {
  const auto entries = read_index(input);
  require(read_index(write_index(entries)) == entries, "an index changed by being written");
}

inline void fuzz_tables(Input input) {
  const Bytes once = write_tables(read_tables(input));
  require(write_tables(read_tables(once)) == once, "tables changed by being written twice");
  if (input[6] == 0 && input[7] == 0)
    require(std::ranges::equal(once, input), "tables of this version have a second form");
}

inline void fuzz_thesis(Input input) {
  const Bytes once = write_thesis(read_thesis(input).tables);
  require(write_thesis(read_thesis(once).tables) == once,
          "the thesis's tables changed by being written twice");
}

inline void fuzz_quality(Input input) {
  const QualityTable table = read_quality(input);
  require(read_quality(as_bytes(write_quality(table))) == table, "a quality table changed by being written");
}

inline void fuzz_about(Input input) {
  const std::string json = write_about(read_about(input));
  require(write_about(read_about(as_bytes(json))) == json, "about.json changed by being written twice");
}

inline void fuzz_package(Input input) {
  PackageReader reader(open_container(memory_source(input)));
  for (const EntryRef& e : reader.index()) reader.entry(e);
  for (const ManifestScale& s : reader.manifest().scales)
    s.has_glb() ? reader.scale_glb(s.scale) : reader.split_prefix(s.scale);
  reader.quality();
  for (std::uint32_t p = 0; p < reader.textures().size(); ++p) {
    reader.preview(p);
    const PlaneTables& t = reader.tables().planes[p];
    for (std::uint32_t r = 0; r < t.rung_count(); ++r)
      for (std::uint32_t f = 0; f < t.fragment_count(); ++f)
        if (reader.fragment_range(p, r, f).bytes > 0) reader.complete_fragment(p, r, f);
    reader.plane_thesis(p);
    for (std::size_t k = 0; k < t.scale_count(); ++k)
      for (const float q : quality_of(t, k, mean_eta(t, k)))
        require(nearest_rung(t, q) < t.rung_count(), "no such rung");
  }
}

/// Puts the right SHA-256 in front of every section: a fuzzer cannot find one, whoever makes a package on
/// purpose can. Index and tables have the same kind of head: `fixed` bytes with the count at 8, then records
/// of `record` bytes that hold the section's length at `length_at` and its digest behind it.
inline Bytes with_digests(Input input, std::size_t fixed, std::size_t record, std::size_t length_at) {
  Bytes bytes(input.begin(), input.end());
  const auto u32 = [&](std::size_t at) {
    return bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 |
           static_cast<std::uint32_t>(bytes[at + 3]) << 24;
  };
  if (bytes.size() < fixed) return bytes;
  const std::uint64_t count = u32(8);
  if (count > (bytes.size() - fixed) / record) return bytes;
  std::uint64_t at = fixed + count * record;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t length_place = fixed + i * record + length_at;
    const std::uint64_t length = u32(length_place);
    if (length > bytes.size() - at) break;
    const Sha256 digest = sha256(std::span(bytes).subspan(at, length));
    std::ranges::copy(digest, bytes.begin() + static_cast<std::ptrdiff_t>(length_place + 4));
    at += length;
  }
  return bytes;
}

inline void fuzz_index_with_digests(Input input) { fuzz_index(with_digests(input, 16, 44, 8)); }
inline void fuzz_tables_with_digests(Input input) { fuzz_tables(with_digests(input, 16, 36, 0)); }

/// Blocks go in part by part, so that their digests do not stand in the way.
inline void fuzz_split_stream(Input input) {
  constexpr SplitLimits kLimits{20000, 40000};
  const SplitStreamHead head = read_split_head(input);
  SplitStreamReader reader(head, kLimits);
  for (const SplitBlock& b : head.blocks) {
    if (b.offset + b.bytes() > input.size()) break;
    std::vector<Input> parts;
    std::uint64_t at = b.offset;
    for (const std::uint32_t size : b.parts) {
      parts.push_back(input.subspan(static_cast<std::size_t>(at), size));
      at += size;
    }
    reader.add_parts(parts);
  }
  const SplitMesh& mesh = reader.mesh();
  require(mesh.points().size() <= kLimits.points && mesh.faces().size() <= kLimits.faces, "a mesh too large");
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k)
      require(mesh.point_at(f, k) < mesh.points().size() && mesh.point_at(f, k) != mesh.point_at(f, k + 1),
              "a face without three points");
}

inline Bytes tagged(std::uint8_t kind, Input bytes) {
  Bytes out{kind};
  out.insert(out.end(), bytes.begin(), bytes.end());
  return out;
}

}  // namespace detail

/// Feeds bytes to the readers of the package format. The first byte chooses the reader, the rest is its
/// input: 0 container, 1 manifest, 2 textures, 3 index, 4 tables, 5 quality, 6 a whole package through
/// PackageReader, 9 a vertex-split stream, 10 the thesis's tables, 11 about.json. Anything but an answer or a
/// FormatError is a fault: it aborts. What is read must also be written again, unchanged where the format has
/// one form only.
inline void read_format(std::span<const std::uint8_t> input) {
  using namespace detail;
  constexpr void (*kReaders[])(Input) = {fuzz_container,
                                         fuzz_manifest,
                                         fuzz_textures,
                                         fuzz_index,
                                         fuzz_tables,
                                         fuzz_quality,
                                         fuzz_package,
                                         fuzz_index_with_digests,
                                         fuzz_tables_with_digests,
                                         fuzz_split_stream,
                                         fuzz_thesis,
                                         fuzz_about};
  if (input.empty()) return;
  try {
    kReaders[input[0] % std::size(kReaders)](input.subspan(1));
  } catch (const FormatError&) {
  }
}

/// Well-formed inputs of every kind, made by code.
inline std::vector<std::vector<std::uint8_t>> make_corpus() {
  using namespace detail;
  std::vector<Bytes> corpus;
  for (const std::uint32_t planes : {0u, 1u, 2u}) {
    const Bytes package = texmesh::testing::make_package(planes);
    corpus.push_back(tagged(0, package));
    corpus.push_back(tagged(6, package));
    PackageReader reader(open_container(memory_source(package)));
    corpus.push_back(tagged(1, reader.store().read_manifest()));
    corpus.push_back(tagged(2, reader.entry(kTexturesPath)));
    corpus.push_back(tagged(3, reader.entry(reader.manifest().index)));
    corpus.push_back(tagged(4, reader.entry(kTablesPath)));
    corpus.push_back(tagged(7, reader.entry(reader.manifest().index)));
    corpus.push_back(tagged(8, reader.entry(kTablesPath)));
    corpus.push_back(tagged(5, reader.entry(kQualityPath)));
  }
  corpus.push_back(tagged(1, as_bytes(write_manifest(texmesh::testing::make_manifest(40, 220, true)))));
  ThesisTables thesis;
  PlaneThesis& said = thesis.planes.emplace_back();
  said.z = said.i = said.zeta = said.m = said.vqp = {0.5f, 1};
  said.models.assign(2, {300, 0.5f, 0.98f});
  said.quality = {80, 40};
  said.total_bytes.assign(2 * kGammaSteps, 70000);
  PerceptualTable& chain = thesis.perceptual;
  chain.scale = {0, 2}, chain.triangles = {1260, 700}, chain.collapses = {0, 280};
  chain.average = {0, 0.04f}, chain.largest = {0, 0.2f}, chain.least = {0, 0}, chain.deviation = {0, 0.03f};
  chain.p95 = {0.05f}, chain.chain_average = {0.04f}, chain.chain_largest = {0.2f}, chain.chain_least = {0};
  corpus.push_back(tagged(10, write_thesis(thesis)));
  corpus.push_back(tagged(11, as_bytes(R"({"title":"A","licence":"MIT","licenceUrl":"https://a.b/",
    "identifiers":[{"scheme":"doi","value":"1"}],"unit":{"name":"m","metres":1},"upAxis":"y",
    "coordinateReference":{"text":"t","epsg":4326},"source":{"format":"obj","x":[1.5,null]},"extras":-1e9})")));
  for (const std::uint32_t n : {3u, 9u})
    corpus.push_back(tagged(9, write_split_stream(texmesh::testing::split_fixture(n).source)));
  return corpus;
}

}  // namespace texmesh::fuzz
