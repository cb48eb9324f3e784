// How good the files of `texmesh extract --bytes` look beside those that other tools make of the same bytes.
//
//   extract_bench SOURCE PACKAGE --bytes 100,250,500,1000 [--peers DIR] [--views 6] [--size 512] [--keep DIR]
//                 [--neighbours] [--unlit] [--reencoded]
//   extract_bench SOURCE --score A.glb,B.glb [--sheet FILE.png]
//
// Renders SOURCE and each file lit (texmesh render, the studio's light; --unlit: base colours alone) from the
// same views and prints mean LDR-FLIP over the pixels of the object (0 = equal). --neighbours also makes the
// best file of the next finer and the next coarser scale. --reencoded beside each file has the source's
// images encoded anew at the one JPEG quality that the bytes allow, or as they are where they fit, on the
// package's S_0 (--uncoded: on the source's own mesh, which counts as S_0's bytes all the same). DIR holds
// files that tests/bench/extract_peers has made of SOURCE; the best one within the bytes counts. The views
// are others than those that extract itself compares. --sheet draws them: a row of the source, and one of
// each file.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>

#include "format/base/bytes.h"
#include "format/base/portable_math.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"
#include "tools/extract/extract.h"
#include "tools/extract/glb/texture_source.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
Bytes read_bytes(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

double mean_level(const Picture& picture) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < picture.covered.size(); ++i) {
    if (!picture.covered[i]) continue;
    for (int k = 0; k < 3; ++k) sum += 255 * srgb_of_light(static_cast<double>(picture.linear[i][k]));
    count += 3;
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

/// How near a file's pictures come to the source's.
struct Score {
  double flip = 1e9;
  double level = 0;  // mean sRGB code of the object's pixels, 0 .. 255
};

class Scorer {
 public:
  Scorer(const fs::path& source, int views, std::uint32_t side_px, bool unlit, const RunContext& context)
      : context_(context), side_px_(side_px), unlit_(unlit) {
    RenderedModel model = load_rendered_model(source.string(), {}, context);
    if (unlit_) make_unlit(model);
    origin_ = model.mesh.origin;
    for (int v = 0; v < views; ++v)
      cameras_.push_back(perspective_camera(camera_of(v, views, model.bounds.centre, model.bounds.radius)));
    environment_ = environment_of(RenderLight::kStudio, context);
    for (const RenderCamera& camera : cameras_) {
      const Picture picture = picture_of(model, camera);
      level_ += mean_level(picture) / views;
      reference_.push_back(prepare_flip(picture));
      drawn_.push_back(encode_srgb(picture));
    }
  }
  double level() const { return level_; }
  /// The source's views.
  const std::vector<Pixels>& drawn() const { return drawn_; }
  /// `drawn`: gets the views, too.
  Score score(const Bytes& glb, const std::string& name, std::vector<Pixels>* drawn = nullptr) const {
    NoFiles none;
    return score(import_model(name, glb, none, {}, context_), drawn);
  }
  Score score(ImportedModel imported, std::vector<Pixels>* drawn = nullptr) const {
    RenderedModel model = rendered_model(std::move(imported), context_);
    if (unlit_) make_unlit(model);
    for (Vec3f& p : model.mesh.positions) p = to_float(to_double(p) + model.mesh.origin - origin_);
    Score out{0, 0};
    for (std::size_t v = 0; v < cameras_.size(); ++v) {
      const Picture picture = picture_of(model, cameras_[v]);
      out.flip += flip_of(reference_[v], prepare_flip(picture)) / static_cast<double>(cameras_.size());
      out.level += mean_level(picture) / static_cast<double>(cameras_.size());
      if (drawn) drawn->push_back(encode_srgb(picture));
    }
    return out;
  }

 private:
  Picture picture_of(const RenderedModel& model, const RenderCamera& camera) const {
    return shade(model.scene(), look(model.scene(), camera, side_px_, context_), model.textures, environment_,
                 context_);
  }
  RunContext context_;
  std::uint32_t side_px_;
  bool unlit_;
  Vec3d origin_;
  double level_ = 0;
  std::vector<RenderCamera> cameras_;
  RenderEnvironment environment_;
  std::vector<FlipPicture> reference_;
  std::vector<Pixels> drawn_;
};

/// Rows of as many square pictures each, as a PNG.
void write_sheet(const std::string& file, const std::vector<std::vector<Pixels>>& rows) {
  const std::uint32_t side_px = rows.front().front().width_px;
  const auto columns = static_cast<std::uint32_t>(rows.front().size());
  Pixels sheet{columns * side_px, static_cast<std::uint32_t>(rows.size()) * side_px, 3, {}};
  sheet.data.resize(std::size_t{sheet.width_px} * sheet.height_px * 3);
  for (std::uint32_t r = 0; r < rows.size(); ++r)
    for (std::uint32_t c = 0; c < columns; ++c) paste(rows[r][c], c * side_px, r * side_px, sheet);
  const Bytes png = write_png(sheet);
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
}

struct Scored {
  std::string name;
  std::uint64_t bytes = 0;
  double flip = 1e9;
};

std::vector<Scored> files_of(const fs::path& folder) {
  std::vector<Scored> out;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".glb")
      out.push_back({entry.path().filename().string(), entry.file_size(), 1e9});
  std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) { return a.name < b.name; });
  return out;
}

void score(const Scorer& scorer, const fs::path& folder, Scored& s) {
  try {
    s.flip = scorer.score(read_bytes(folder / s.name), s.name).flip;
  } catch (const Error& e) {
    std::cerr << s.name << ": " << e.what() << '\n';
  }
}

/// The best file of at most `limit` bytes. Small pictures find the ten that are looked at closely.
Scored best_of(const std::vector<Scored>& roughly, const Scorer& scorer, const fs::path& folder,
               std::uint64_t limit) {
  std::vector<Scored> fitting;
  for (const Scored& s : roughly)
    if (s.bytes <= limit) fitting.push_back(s);
  std::stable_sort(fitting.begin(), fitting.end(),
                   [](const Scored& a, const Scored& b) { return a.flip < b.flip; });
  if (fitting.size() > 10) fitting.resize(10);
  Scored best;
  for (Scored& s : fitting) {
    score(scorer, folder, s);
    if (s.flip < best.flip) best = s;
  }
  return best;
}

/// S_0 of the package, whose images take the place of the source's of the same numbers.
ImportedModel on_coded_mesh(PackageReader& package, const ImportedModel& source, const RunContext& context) {
  ExtractScale scale;
  scale.scale = 0;
  NoFiles none;
  ImportedModel out = import_model("S_0", extract_model(package, {scale}, context).glb, none, {}, context);
  for (Image& image : out.model.images) {
    const auto number = static_cast<std::size_t>(std::stoul(image.name.substr(image.name.rfind('/') + 1)));
    const std::string name = image.name;
    image = source.model.images.at(number);
    image.name = name;
  }
  return out;
}

/// The source with its images encoded anew, the best of at most `limit` bytes.
Scored reencoded(const ImportedModel& source, std::uint64_t mesh_bytes, std::uint64_t limit,
                 const Scorer& scorer) {
  const auto encoded = [&](int quality) {
    ImportedModel out = source;
    for (Image& image : out.model.images) {
      const Pixels pixels = decode_image(image);
      if (pixels.channels != 1 && pixels.channels != 3) continue;  // a JPEG has no alpha
      image =
          probe_image(image.name, encode_image(pixels, {FileImage::kJpeg, static_cast<double>(quality)}), {});
    }
    return out;
  };
  const auto bytes_of = [&](const ImportedModel& m) {
    std::uint64_t bytes = mesh_bytes;
    for (const Image& image : m.model.images) bytes += image.bytes.size();
    return bytes;
  };
  if (bytes_of(source) <= limit) return {"the source's images", bytes_of(source), scorer.score(source).flip};
  int low = 0, high = 101;  // fits; does not
  Scored best;
  ImportedModel chosen;
  while (high - low > 1) {
    const int quality = (low + high) / 2;
    ImportedModel made = encoded(quality);
    if (bytes_of(made) > limit) {
      high = quality;
      continue;
    }
    low = quality;
    best.name = fmt::format("images of quality {}", quality);
    best.bytes = bytes_of(made);
    chosen = std::move(made);
  }
  if (low > 0) best.flip = scorer.score(std::move(chosen)).flip;
  return best;
}

struct Arguments {
  std::string source, package, peers, keep, sheet;
  std::vector<double> bytes{100, 250, 500, 1000};
  std::vector<std::string> score;
  int views = 6, size = 512;
  bool neighbours = false, unlit = false, reencoded = false, uncoded = false;
};

/// What the search chose, and what it would have made of the scales beside that, in its own views.
void print_neighbours(const Arguments& a, std::uint64_t limit, const Extracted& chosen,
                      const RunContext& context) {
  PackageReader package(open_store(a.package));
  const std::vector<ManifestScale>& scales = package.manifest().scales;
  for (std::size_t k = 0; k < scales.size(); ++k) {
    const bool finer = k + 1 < scales.size() && scales[k + 1].scale == chosen.scale;
    if (!finer && !(k > 0 && scales[k - 1].scale == chosen.scale)) continue;
    ExtractBudget budget;
    budget.bytes = {limit};
    budget.scale = scales[k].scale;
    const Extracted e = extract_model(package, {budget}, context);
    std::cout << fmt::format("           {} S_{}: {} ({:.3f} of the chosen file's difference)\n",
                             finer ? "finer" : "coarser", e.scale,
                             e.within ? fmt::format("{:.4f}", e.difference) : "does not fit",
                             e.difference / chosen.difference);
  }
}

void print_table(const Arguments& a, const Scorer& scorer, const RunContext& context) {
  std::vector<Scored> peers = a.peers.empty() ? std::vector<Scored>{} : files_of(a.peers);
  const Scorer rough(a.source, 3, 256, a.unlit, context);
  ImportedModel source = a.reencoded ? import_file(a.source, {}, context) : ImportedModel();
  if (a.reencoded && !a.uncoded) {
    PackageReader package(open_store(a.package));
    source = on_coded_mesh(package, source, context);
  }
  for (Scored& s : peers) score(rough, a.peers, s);
  std::cout << "     kB   extract     bytes  scale  FLIP    s   best other    bytes  FLIP    ratio\n";
  double logs = 0;
  int rows = 0;
  for (const double kilobytes : a.bytes) {
    const auto limit = static_cast<std::uint64_t>(kilobytes * 1000);
    PackageReader package(open_store(a.package));
    ExtractBudget budget;
    budget.bytes = {limit};
    const auto start = std::chrono::steady_clock::now();
    const Extracted e = extract_model(package, {budget}, context);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!a.keep.empty()) {
      std::ofstream out(fs::path(a.keep) / fmt::format("{}kB.glb", kilobytes), std::ios::binary);
      out.write(reinterpret_cast<const char*>(e.glb.data()), static_cast<std::streamsize>(e.glb.size()));
    }
    const double ours = scorer.score(e.glb, "extract.glb").flip;
    Scored best = best_of(peers, scorer, a.peers, limit);
    if (a.reencoded) {
      const Scored plain = reencoded(source, package.manifest().scales.front().glb.bytes, limit, scorer);
      if (plain.flip < best.flip) best = plain;
    }
    std::cout << fmt::format("{:7}  {:>9}{:>10}  S_{:<4}{:.4f}{:5.1f}", kilobytes, e.within ? "" : "outside",
                             e.glb.size(), e.scale, ours, seconds);
    if (best.flip < 1) {
      std::cout << fmt::format("   {:28}{:>9}  {:.4f}", best.name, best.bytes, best.flip);
      if (best.flip > 0) std::cout << fmt::format("  {:.3f}", ours / best.flip);
      if (e.within && best.flip > 0) logs += std::log(ours / best.flip), ++rows;
    } else if (!peers.empty() || a.reencoded) {
      std::cout << "   none fits";
    }
    std::cout << fmt::format("  [own views {:.4f}, mesh {:.4f}]", e.difference, e.mesh_difference);
    for (const ExtractedImage& i : e.images)
      std::cout << fmt::format("  [{} {}x{} q{:.0f} {}]", i.role.substr(0, 4), i.width_px, i.height_px,
                               i.quality, i.bytes);
    std::cout << std::endl;
    if (a.neighbours) print_neighbours(a, limit, e, context);
  }
  if (rows) std::cout << fmt::format("geometric mean of {} ratios: {:.3f}\n", rows, std::exp(logs / rows));
}

void print_scores(const Arguments& a, const Scorer& scorer) {
  std::vector<std::vector<Pixels>> rows{scorer.drawn()};
  std::cout << fmt::format("{}: mean level {:.1f}\n", a.source, scorer.level());
  for (const std::string& file : a.score) {
    const Bytes bytes = read_bytes(file);
    const Score found = scorer.score(bytes, file, &rows.emplace_back());
    std::cout << fmt::format("{}: {} bytes, FLIP {:.4f}, mean level {:.1f}\n", file, bytes.size(), found.flip,
                             found.level);
  }
  if (!a.sheet.empty()) write_sheet(a.sheet, rows);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  CLI::App app{"Compares extract --bytes with files of other tools by rendered FLIP"};
  Arguments a;
  app.add_option("source", a.source, "The model that the package was made of")->required();
  app.add_option("package", a.package, "Its package");
  app.add_option("--bytes", a.bytes, "Budgets, kB")->delimiter(',')->capture_default_str();
  app.add_option("--peers", a.peers, "Folder of files to compare with");
  app.add_option("--keep", a.keep, "Folder for the extracted files");
  app.add_option("--score", a.score, "Only rate these files")->delimiter(',');
  app.add_option("--sheet", a.sheet, "Draw the source and the files of --score here (PNG)");
  app.add_option("--views", a.views)->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--size", a.size)->check(CLI::Range(32, 4096))->capture_default_str();
  app.add_flag("--unlit", a.unlit, "Compare base colours alone");
  app.add_flag("--reencoded", a.reencoded, "Compare with the source, its images encoded anew");
  app.add_flag("--uncoded", a.uncoded, "--reencoded with the source's own mesh");
  app.add_flag("--neighbours", a.neighbours, "Also the best files of the scales beside the chosen one");
  CLI11_PARSE(app, argc, argv);
  RunContext context;
  context.threads = 2;
  try {
    const Scorer scorer(a.source, a.views, static_cast<std::uint32_t>(a.size), a.unlit, context);
    if (!a.score.empty()) print_scores(a, scorer);
    if (!a.package.empty()) print_table(a, scorer, context);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
