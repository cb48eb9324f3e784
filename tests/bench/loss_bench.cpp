// Lost packets of a vertex-split stream: each block's part of positions is a packet that is lost with a given
// probability; connectivity and texture coordinates arrive (they are small, or asked for again). Prints how
// far the points are from where they should be, for each way to fill what is missing.
//   loss_bench [--seeds N] PACKAGE...
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "format/split/split_reader.h"
#include "lab/transfer/chapter_4.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
enum class Way { kNeighbours, kTexture, kTextureAgain };

/// Distances in places of the grid.
struct Errors {
  double all_rms = 0, lost_rms = 0, p95 = 0;
  std::size_t lost = 0;
};

SplitMesh decode(const SplitStreamHead& head, const Bytes& stream, const std::vector<bool>& lost, Way way,
                 std::vector<std::uint32_t>* lost_points) {
  SplitStreamReader reader(head, {}, way == Way::kNeighbours ? SplitFill::kNeighbours : SplitFill::kTexture);
  for (std::size_t i = 0; i < head.blocks.size(); ++i) {
    std::vector<std::span<const std::uint8_t>> parts;
    std::size_t at = head.blocks[i].offset;
    for (const std::uint32_t size : head.blocks[i].parts) {
      parts.push_back(std::span(stream).subspan(at, size));
      at += size;
    }
    if (!lost.empty() && lost[i]) parts[1] = {};
    reader.add_parts(parts);
  }
  if (way == Way::kTextureAgain) reader.refill_lost_points();
  if (lost_points) *lost_points = reader.lost_points();
  return reader.mesh();
}

Errors compare(const SplitMesh& whole, const SplitMesh& filled, const std::vector<std::uint32_t>& lost) {
  Errors e;
  e.lost = lost.size();
  std::vector<double> distances;
  const auto squared = [&](std::size_t p) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = static_cast<double>(whole.points()[p][k]) - filled.points()[p][k];
      sum += d * d;
    }
    return sum;
  };
  for (std::size_t p = 0; p < whole.points().size(); ++p) {
    e.all_rms += squared(p);
    distances.push_back(std::sqrt(squared(p)));
  }
  for (const std::uint32_t p : lost) e.lost_rms += squared(p);
  e.all_rms = std::sqrt(e.all_rms / static_cast<double>(whole.points().size()));
  if (!lost.empty()) e.lost_rms = std::sqrt(e.lost_rms / static_cast<double>(lost.size()));
  std::ranges::sort(distances);
  e.p95 = distances[distances.size() * 95 / 100];
  return e;
}

/// Mean length of an edge in places.
double mean_edge(const SplitMesh& mesh) {
  double sum = 0;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const SplitMesh::Point &a = mesh.points()[mesh.point_at(f, k)],
                             &b = mesh.points()[mesh.point_at(f, k + 1)];
      sum += std::sqrt(std::pow(a[0] - b[0], 2) + std::pow(a[1] - b[1], 2) + std::pow(a[2] - b[2], 2));
    }
  return sum / (3.0 * static_cast<double>(mesh.face_count()));
}

void measure(const std::string& path, int seeds) {
  PackageReader package(open_store(path));
  const SplitStreamHead head = package.split_stream_head();
  const Bytes stream = package.entry(kSplitStreamPath);
  const SplitMesh whole = decode(head, stream, {}, Way::kNeighbours, nullptr);
  const double edge = mean_edge(whole);
  std::printf("%s: %zu points, %zu blocks; distances in mean edges\n", path.c_str(), whole.points().size(),
              head.blocks.size());
  std::printf(
      "  loss   lost points |  neighbours: lost rms, all rms, p95 |  texture                    |  texture, "
      "again\n");
  for (const double loss : {0.01, 0.05, 0.1, 0.2, 0.4}) {
    Errors sum[3];
    for (int seed = 1; seed <= seeds; ++seed) {
      TraceRandom random(static_cast<std::uint64_t>(seed));
      std::vector<bool> lost;
      for (const SplitBlock& b : head.blocks) lost.push_back(random.uniform() <= loss && !b.is_patch);
      for (const Way way : {Way::kNeighbours, Way::kTexture, Way::kTextureAgain}) {
        std::vector<std::uint32_t> points;
        const SplitMesh filled = decode(head, stream, lost, way, &points);
        const Errors e = compare(whole, filled, points);
        Errors& s = sum[static_cast<int>(way)];
        s.all_rms += e.all_rms / seeds, s.lost_rms += e.lost_rms / seeds, s.p95 += e.p95 / seeds;
        s.lost += e.lost;
      }
    }
    std::printf("  %4.0f %%  %11zu |", 100 * loss, sum[0].lost / static_cast<std::size_t>(seeds));
    for (const Errors& e : sum)
      std::printf("     %.4f   %.4f   %.4f    |", e.lost_rms / edge, e.all_rms / edge, e.p95 / edge);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Errors of a vertex-split stream of which packets are lost"};
  std::vector<std::string> packages;
  int seeds = 5;
  app.add_option("packages", packages, "Packages with a stream")->required();
  app.add_option("--seeds", seeds, "Runs per rate of loss")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  for (const std::string& p : packages) measure(p, seeds);
}
