// What the vertex-split stream of a model costs against one Draco mesh of S_0 at the same quantisation
// (level 7, positions and texture coordinates; normals and colours of the stream are counted apart), how the
// bytes divide, and how fast it is made and decoded. Checks on the way that every scale decodes to its mesh.
//   stream_bench [--all-scales] [--bits N] [--uv-bits N] MODEL...
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>

#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/condition/condition.h"
#include "stages/gltf/scale_codecs.h"
#include "stages/scales/vertex_split.h"
#include "stages/simplification/simplification.h"
#include "stages/ssf/ssf.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

NestedScales read_scales(const std::filesystem::path& path, const RunContext& context, double& simplify_s) {
  FileResolver resolver(path.parent_path());
  const ImportedModel imported =
      import_model(path.filename().string(), read_input_file(path, 1ull << 33), resolver, {}, context);
  const ConditionedMesh mesh =
      condition_mesh(imported.model.mesh, imported.normals_by_specification, {}, context);
  const ScaleMap map = filter_scale_space(mesh, {}, context);
  const auto start = Clock::now();
  NestedScales scales = simplify(mesh, map, {}, context);
  simplify_s = seconds_since(start);
  return scales;
}

/// Scales at steps of 2x or more in triangles, and the coarsest; or all.
std::vector<std::size_t> kept_scales(const NestedScales& scales, bool all) {
  std::vector<std::size_t> kept{0};
  for (std::size_t k = 1; k < scales.scales.size(); ++k)
    if (all || 2 * scales.scales[k].triangles.size() <= scales.scales[kept.back()].triangles.size())
      kept.push_back(k);
  if (kept.back() + 1 != scales.scales.size()) kept.push_back(scales.scales.size() - 1);
  return kept;
}

std::string exact(float x) {
  char text[64];
  std::snprintf(text, sizeof text, "%.9g", static_cast<double>(x));
  return text;
}

template <std::size_t N, class Value>
int add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, std::size_t count,
                  const Value& value) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, N, draco::DT_FLOAT32, false, sizeof(float) * N, 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(count));
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::array<float, N> v = value(i);
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), v.data());
  }
  return id;
}

std::size_t draco_bytes(const Mesh& mesh, const VertexSplitCoding& coding) {
  draco::Mesh d;
  d.set_num_points(static_cast<std::uint32_t>(mesh.wedge_count()));
  d.SetNumFaces(mesh.triangles.size());
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    draco::Mesh::Face face;
    for (std::size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(mesh.triangles[f][k]);
    d.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(f)), face);
  }
  const int position =
      add_attribute<3>(d, draco::GeometryAttribute::POSITION, mesh.wedge_count(), [&](std::uint32_t w) {
        const Vec3f p = mesh.positions[mesh.wedge_position[w]];
        return std::array{p.x, p.y, p.z};
      });
  int uv = -1;
  if (coding.uv[0].bits > 0)
    uv = add_attribute<2>(d, draco::GeometryAttribute::TEX_COORD, mesh.wedge_count(), [&](std::uint32_t w) {
      return std::array{mesh.uv0[w].x, mesh.uv0[w].y};
    });
  d.DeduplicateAttributeValues();
  d.DeduplicatePointIds();
  draco::ExpertEncoder encoder(d);
  encoder.SetSpeedOptions(3, 3);
  auto quantise = [&](int id, const QuantisationGrid& grid, int axes) {
    std::string origin;
    for (int k = 0; k < axes; ++k) origin += exact(grid.origin[k]) + " ";
    draco::Options options;
    options.SetInt("quantization_bits", grid.bits);
    options.SetString("quantization_origin", origin);
    options.SetString("quantization_range", exact(grid.range));
    encoder.options().SetAttributeOptions(id, options);
  };
  quantise(position, coding.position, 3);
  if (uv >= 0) quantise(uv, coding.uv[0], 2);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) throw StageError("bench", "draco", "a stream", status.error_msg_string());
  return buffer.size();
}

/// Triangles of a scale as rounded places of their corners, sorted: what decoding must give.
std::vector<std::array<SplitMesh::Point, 3>> triangles_of(std::vector<std::array<SplitMesh::Point, 3>> t) {
  std::erase_if(t, [](const auto& x) { return x[0] == x[1] || x[1] == x[2] || x[2] == x[0]; });
  for (auto& x : t) std::rotate(x.begin(), std::min_element(x.begin(), x.end()), x.end());
  std::sort(t.begin(), t.end());
  return t;
}

bool same_mesh(const NestedScales& scales, const NestedScale& scale, const QuantisationGrid& grid,
               const SplitMesh& mesh) {
  std::vector<std::array<SplitMesh::Point, 3>> expected, found;
  for (const Triangle& t : scale.triangles) {
    auto& x = expected.emplace_back();
    for (std::size_t k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i)
        x[k][static_cast<std::size_t>(i)] = static_cast<std::int32_t>(
            grid.index(scales.mesh.positions[scales.mesh.wedge_position[t[k]]][i], i));
  }
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f) {
    auto& x = found.emplace_back();
    for (std::uint32_t k = 0; k < 3; ++k) x[k] = mesh.points()[mesh.point_at(f, k)];
  }
  return triangles_of(std::move(expected)) == triangles_of(std::move(found));
}

void bench(const std::filesystem::path& path, bool all, int bits, int uv_bits) {
  const RunContext context{};
  double simplify_s = 0;
  const NestedScales scales = read_scales(path, context, simplify_s);
  VertexSplitCoding coding;
  ScalesOptions options;
  options.position_bits = bits, options.uv_bits = uv_bits;
  coding.position = position_grid(scales.mesh, options, 24);
  if (!scales.mesh.uv0.empty()) coding.uv[0] = uv_grid(scales.mesh.uv0, 4096, options, 24);
  if (!scales.mesh.colours.empty()) coding.colour_bits = 8;
  const std::vector<std::size_t> kept = kept_scales(scales, all);
  auto start = Clock::now();
  const SplitSource source = make_vertex_splits(scales, kept, coding, context);
  const double source_s = seconds_since(start);
  start = Clock::now();
  const std::vector<std::uint8_t> stream = write_split_stream(source);
  const double write_s = seconds_since(start);
  start = Clock::now();
  SplitStreamReader reader(read_split_head(stream));
  reader.read_to_scale(reader.head().scales.size() - 1, stream);
  const double read_s = seconds_since(start);
  SplitStreamReader checker(read_split_head(stream));
  bool same = true;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    checker.read_to_scale(i, stream);
    same =
        same && same_mesh(scales, scales.scales[kept[kept.size() - 1 - i]], coding.position, checker.mesh());
  }
  std::vector<double> kinds(6, 0);  // connectivity, position, uv, normal, colour, base
  std::size_t splits = 0;
  for (const SplitBlock& b : reader.head().blocks) {
    if (!b.is_patch) splits += b.count;
    kinds[0] += b.parts[0], kinds[1] += b.parts[1];
    for (std::size_t k = 0; k < source.attributes.size(); ++k)
      kinds[source.attributes[k].kind == SplitKind::kNormal   ? 3
            : source.attributes[k].kind == SplitKind::kColour ? 4
                                                              : 2] += b.parts[k + 2];
  }
  const SplitBlock& base = reader.head().blocks[0];
  const double points = static_cast<double>(reader.mesh().points().size());
  const double shape = static_cast<double>(stream.size()) - kinds[3] - kinds[4];
  const auto draco = static_cast<double>(draco_bytes(scales.mesh, coding));
  std::printf(
      "%-14s %7zu tri %2zu scales %2d/%2d bit  base %6.0f B (%u tri)  head %5.0f  bits/point: conn %5.2f pos "
      "%5.2f uv %5.2f "
      "normal %5.2f colour %5.2f  stream %8.0f B  Draco %8.0f B  ratio %.3f  %s\n",
      path.stem().string().substr(0, 14).c_str(), scales.mesh.triangles.size(), kept.size(),
      coding.position.bits, coding.uv[0].bits, static_cast<double>(base.bytes()), base.count,
      static_cast<double>(reader.head().bytes), 8 * kinds[0] / points, 8 * kinds[1] / points,
      8 * kinds[2] / points, 8 * kinds[3] / points, 8 * kinds[4] / points, shape, draco, shape / draco,
      same ? "same" : "NOT THE SAME");
  std::printf("%-14s build %.2f s, write %.2f s (%.0f %% of simplify), decode %.2f s = %.2f Mvertices/s\n",
              "", source_s, write_s, 100 * (source_s + write_s) / simplify_s, read_s, points / read_s / 1e6);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Vertex-split stream against one Draco mesh of S_0"};
  bool all = false;
  int bits = 0, uv_bits = 0;
  std::vector<std::string> models;
  app.add_flag("--all-scales", all, "every nested scale, not only steps of 2x");
  app.add_option("--bits", bits, "per position coordinate; 0 = as compile chooses");
  app.add_option("--uv-bits", uv_bits, "per texture coordinate; 0 = 1/8 texel of 4096");
  app.add_option("model", models)->required();
  CLI11_PARSE(app, argc, argv);
  try {
    for (const std::string& model : models) bench(model, all, bits, uv_bits);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
