// The readers of the package format. What is read must also be written again, unchanged where the format has
// one form only.
#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "format/documents/annotations.h"
#include "format/documents/index.h"
#include "format/documents/thesis_tables.h"
#include "format/rules/allocation.h"
#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "tests/format/container/package_fixture.h"
#include "tests/format/documents/manifest_fixture.h"
#include "tests/format/split/split_fixture.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/check_crc.h"

namespace texmesh::fuzz {
namespace {

using texmesh::testing::as_bytes;

template <void (*kRead)(ByteSpan)>
bool unless_format_error(ByteSpan input) {
  try {
    kRead(input);
    return true;
  } catch (const FormatError& e) {
    return refused(e);
  }
}

void read_container_again(ByteSpan input) {
  const auto source = memory_source(input);
  Bytes again;
  ContainerWriter writer([&](ByteSpan part) { again.insert(again.end(), part.begin(), part.end()); });
  for (const ContainerEntry& e : read_container(*source)) {
    check_crc(*source, e);
    writer.add(e.path, source->read(e.offset, e.bytes));
  }
  writer.finish();
  require(std::ranges::equal(again, input), "a container was accepted that its entries do not lead to");
}

void read_manifest_twice(ByteSpan input) {
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

void read_textures_twice(ByteSpan input) {
  const auto textures = read_textures(input);
  require(read_textures(as_bytes(write_textures(textures))) == textures, "textures changed by being written");
}

void read_index_twice(ByteSpan input) {
  const auto entries = read_index(input);
  require(read_index(write_index(entries)) == entries, "an index changed by being written");
}

/// Few bytes of tables may claim millions of cells of fragments that are not stored. One in sixteen of these
/// takes place: with all of them there were 230 runs a second, and 7,500 now.
bool is_left_out(ByteSpan input) {
  constexpr std::size_t kHead = 16, kRecord = 36;
  constexpr std::uint64_t kMostFragments = 65535, kManyCells = 1 << 14;
  if (input.size() < kHead) return false;
  const std::uint64_t count = Choices(input.subspan(8)).number(4);
  if (count > (input.size() - kHead) / kRecord) return false;
  std::uint64_t at = kHead + count * kRecord, cells = 0;
  for (std::size_t i = 0; i < count && at < input.size(); ++i) {
    Choices section(input.subspan(static_cast<std::size_t>(at)));
    const std::uint64_t columns = section.number(4), fragments = columns * section.number(4);
    const std::uint64_t lines = section.number(1) + section.number(1);  // scales, rungs
    if (fragments <= kMostFragments) cells += fragments * lines;
    at += Choices(input.subspan(kHead + i * kRecord)).number(4);
  }
  return cells > kManyCells && sha256(input)[0] % 16 != 0;
}

void read_tables_twice(ByteSpan input) {
  if (is_left_out(input)) return;
  const Bytes once = write_tables(read_tables(input));
  require(write_tables(read_tables(once)) == once, "tables changed by being written twice");
  if (input[6] == 0 && input[7] == 0)
    require(std::ranges::equal(once, input), "tables of this version have a second form");
}

void read_thesis_twice(ByteSpan input) {
  const Bytes once = write_thesis(read_thesis(input).tables);
  require(write_thesis(read_thesis(once).tables) == once,
          "the thesis's tables changed by being written twice");
}

void read_quality_twice(ByteSpan input) {
  const QualityTable table = read_quality(input);
  require(read_quality(as_bytes(write_quality(table))) == table, "a quality table changed by being written");
}

void read_about_twice(ByteSpan input) {
  const std::string json = write_about(read_about(input));
  require(write_about(read_about(as_bytes(json))) == json, "about.json changed by being written twice");
}

void read_annotations_twice(ByteSpan input) {
  const std::string json = write_annotations(read_annotations(input));
  require(write_annotations(read_annotations(as_bytes(json))) == json,
          "annotations.json changed by being written twice");
}

void read_package(ByteSpan input) {
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
Bytes with_digests(ByteSpan input, std::size_t fixed, std::size_t record, std::size_t length_at) {
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

/// Blocks go in part by part, so that their digests do not stand in the way.
void read_split_stream(ByteSpan input) {
  constexpr SplitLimits kLimits{20000, 40000, 120000};
  const SplitStreamHead head = read_split_head(input);
  SplitStreamReader reader(head, kLimits);
  for (const SplitBlock& b : head.blocks) {
    if (b.offset + b.bytes() > input.size()) break;
    std::vector<ByteSpan> parts;
    std::uint64_t at = b.offset;
    for (const std::uint32_t size : b.parts) {
      parts.push_back(input.subspan(static_cast<std::size_t>(at), size));
      at += size;
    }
    reader.add_parts(parts);
  }
  const SplitMesh& mesh = reader.mesh();
  require(mesh.points().size() <= kLimits.points && mesh.face_count() <= kLimits.faces, "a mesh too large");
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k)
      require(mesh.point_at(f, k) < mesh.points().size() && mesh.point_at(f, k) != mesh.point_at(f, k + 1),
              "a face without three points");
}

// ---- seeds

std::vector<Bytes> packages() {
  return {texmesh::testing::make_package(0), texmesh::testing::make_package(1),
          texmesh::testing::make_package(2)};
}

/// The entry of each of the packages.
std::vector<Bytes> entries(const std::string& path) {
  std::vector<Bytes> list;
  for (const Bytes& package : packages()) {
    PackageReader reader(open_container(memory_source(package)));
    list.push_back(path == kManifestPath ? reader.store().read_manifest()
                   : path == kIndexPath  ? reader.entry(reader.manifest().index)
                                         : reader.entry(path));
  }
  return list;
}

/// Small ones: what the entries hold is nothing to the container.
std::vector<Bytes> containers() {
  std::vector<Bytes> list;
  for (const std::size_t count : {1u, 2u, 4u}) {
    Bytes& out = list.emplace_back();
    ContainerWriter writer([&](ByteSpan part) { out.insert(out.end(), part.begin(), part.end()); });
    for (std::size_t k = 0; k < count; ++k)
      writer.add(k == 0 ? kManifestPath : mesh_path(static_cast<int>(k)),
                 Bytes(30 * k + 3, static_cast<std::uint8_t>(k)));
    writer.finish();
  }
  return list;
}

std::vector<Bytes> manifests() {
  using texmesh::testing::make_manifest;
  return {to_bytes(write_manifest(make_manifest(1, 0))), to_bytes(write_manifest(make_manifest(2, 1)))};
}

std::vector<Bytes> thesis_seeds() {
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
  return {write_thesis(thesis)};
}

std::vector<Bytes> about_seeds() {
  return {to_bytes(R"({"title":"A","licence":"MIT","licenceUrl":"https://a.b/",
    "identifiers":[{"scheme":"doi","value":"1"}],"unit":{"name":"m","metres":1},"upAxis":"y",
    "coordinateReference":{"text":"t","epsg":4326},"source":{"format":"obj","x":[1.5,null]},"extras":-1e9})")};
}

std::vector<Bytes> annotation_seeds() {
  return {to_bytes(R"({"frame":"package","annotations":[{"position":[0,1,2.5],"normal":[0,0,1],
    "texts":[{"language":"en-GB","title":"A","text":"t"}],"camera":{"position":[0,0,5],"target":[0,1,2],"fovDegrees":30},
    "images":[{"url":"https://a.b/c"}]}]})")};
}

std::vector<Bytes> split_seeds() {
  std::vector<Bytes> list;
  for (const std::uint32_t n : {3u, 5u})
    list.push_back(write_split_stream(texmesh::testing::split_fixture(n).source));
  return list;
}

}  // namespace

void add_format_targets(std::vector<Target>& list) {
  list.insert(
      list.end(),
      {{"container", true, unless_format_error<read_container_again>, containers, Shape::kContainer},
       {"package", false, unless_format_error<read_package>, packages, Shape::kContainer},
       {"manifest", true, unless_format_error<read_manifest_twice>, manifests, Shape::kJson},
       {"textures", false, unless_format_error<read_textures_twice>, [] { return entries(kTexturesPath); },
        Shape::kJson},
       {"quality", false, unless_format_error<read_quality_twice>, [] { return entries(kQualityPath); },
        Shape::kJson},
       {"about", false, unless_format_error<read_about_twice>, about_seeds, Shape::kJson},
       {"annotations", false, unless_format_error<read_annotations_twice>, annotation_seeds, Shape::kJson},
       {"index", true, unless_format_error<read_index_twice>, [] { return entries(kIndexPath); },
        Shape::kBytes, [](ByteSpan b) { return with_digests(b, 16, 44, 8); }},
       {"tables", true, unless_format_error<read_tables_twice>, [] { return entries(kTablesPath); },
        Shape::kBytes, [](ByteSpan b) { return with_digests(b, 16, 36, 0); }},
       {"thesis", true, unless_format_error<read_thesis_twice>, thesis_seeds},
       {"stream", true, unless_format_error<read_split_stream>, split_seeds}});
}

}  // namespace texmesh::fuzz
