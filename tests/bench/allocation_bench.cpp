// What sharing the bytes among fragments is worth, and how exact the size table is.
//   allocation_bench [--log-width DG] NAME.texmesh ...
//     bytes of thesis, log and rd over those of the same quality everywhere ("uniform", empty fragments not
//     stored), at equal surface-weighted 1 - SSIM
//   allocation_bench MODEL ...
//     sizes: table against streams; error of sizes between the rungs, against a second ladder of just those
//     qualities; the model S = A (100 p)^(B Q)
// Every figure is a ratio or an error within one run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "delivery/cpp/package/package_reader.h"
#include "format/rules/size_curve.h"
#include "stages/fill/fill.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/bench/bench_model.h"
#include "tests/support/all_rungs.h"
#include "tests/support/allocation_curves.h"

namespace texmesh {
namespace {

using testing::bytes_at;
using testing::Curve;
using testing::over_uniform;
using testing::Planes;
using testing::rate_distortion;
using testing::Ratios;
using testing::swept;
using testing::uniform;

void print_package(const std::string& path, double log_width) {
  PackageReader package(open_store(path));
  Planes planes;
  for (std::size_t p = 0; p < package.textures().size(); ++p)
    if (package.textures()[p].role == "base-colour" && package.textures()[p].mip == 0)
      planes.tables.push_back(package.tables().planes[p]);
  if (planes.tables.empty()) return;
  Curve reference, all;
  const std::size_t rungs = planes.tables[0].rung_count();
  for (std::size_t r = 0; r < rungs; ++r) all.push_back(uniform(planes, r));
  reference.assign(all.begin() + 1, all.end() - 1);  // where the others can be on both sides
  const auto text = [&](const Curve& curve) {
    const Ratios r = over_uniform(curve, reference);
    return fmt::format("{:6.3f} {:6.3f}", r.mean, r.worst);
  };
  std::size_t fragments = 0;
  for (const PlaneTables& t : planes.tables) fragments += t.order.size();
  const std::size_t middle = planes.tables[0].scale_count() / 2;
  const Curve rd = rate_distortion(planes, all.front().bytes * 0.5, all.back().bytes);
  std::string at;
  for (const std::size_t r : {std::size_t{3}, std::size_t{5}, std::size_t{7}})
    if (r < rungs) at += fmt::format(" {:.3f}", bytes_at(rd, all[r].loss) / all[r].bytes);
  std::cout << fmt::format("{:<26} {:>5}  {}  {}  {}  {} ({} )\n", model_name(path), fragments,
                           text(swept(planes, 0, 0, -1)), text(swept(planes, 1, 0, log_width)),
                           text(swept(planes, 1, middle, log_width)), text(rd), at);
}

struct Errors {
  double sum = 0, worst = 0;
  std::vector<double> all;
  void add(double e) { sum += e, worst = std::max(worst, e), all.push_back(e); }
  std::string text() {
    if (all.empty()) return "     -      -      -";
    std::sort(all.begin(), all.end());
    const auto n = static_cast<double>(all.size());
    return fmt::format("{:6.2f} {:6.2f} {:6.2f}", 100 * sum / n, 100 * all[all.size() * 95 / 100],
                       100 * worst);
  }
};

void print_sizes(const std::string& path) {
  RunContext context;
  context.threads = 2;
  BenchModel model = load_bench_model(path, context);
  const std::vector<std::size_t> shown = colour_planes(model.fragments);
  const std::vector<Pixels> pixels = fill_planes(model.fragments, model.images, Fill::kPushPull, context);
  LadderOptions between = testing::all_rungs();
  between.rungs = {6, 9, 12, 15, 22, 27, 32, 38, 43, 48, 57, 63, 69, 80, 90, 94};  // none of the ladder's
  const Previews previews = make_previews(model.fragments, pixels, {}, context);
  const Ladder ladder = encode_ladder(model.fragments, pixels, previews, {}, testing::all_rungs(), context);
  const Ladder other = encode_ladder(model.fragments, pixels, previews, {}, between, context);
  const Predictors predictors = predict_quality(model.fragments, pixels, {}, context);
  const auto [tables, thesis] =
      build_tables(model.fragments, pixels, predictors, ladder, previews, {}, context);
  Errors at_rungs, inside, whole, without_knots;
  Errors modelled;
  double correlation = 1;
  for (const std::size_t p : shown) {
    const PlaneTables& t = tables.planes[p];
    for (std::size_t r = 0; r < t.rung_count(); ++r)
      for (const std::uint16_t f : t.order)
        at_rungs.add(std::fabs(interpolated_bytes(t, f, t.rung_quality[r]) -
                               static_cast<double>(fragment_stream(ladder.planes[p].rungs[r], f).size())));
    PlaneTables plain = t;
    plain.knot_quality.clear();
    plain.knot_position.clear();
    for (const LadderRung& rung : other.planes[p].rungs) {
      double guess = 0, real = 0, plain_guess = 0;
      for (const std::uint16_t f : t.order) {
        const auto bytes = static_cast<double>(fragment_stream(rung, f).size());
        const double value = interpolated_bytes(t, f, rung.quality);
        inside.add(std::fabs(value - bytes) / bytes);
        guess += value;
        plain_guess += interpolated_bytes(plain, f, rung.quality);
        real += bytes;
      }
      whole.add(std::fabs(guess - real) / real);
      without_knots.add(std::fabs(plain_guess - real) / real);
    }
    for (const std::uint16_t f : t.order) {
      const SizeModel& fitted = thesis.planes[p].models[f];
      if (fitted == SizeModel{}) continue;
      correlation = std::min(correlation, static_cast<double>(fitted.correlation));
      for (std::size_t r = 0; r < t.rung_count(); ++r) {
        const double bytes = t.size_bytes[r * t.fragment_count() + f];
        const double vqp = static_cast<double>(thesis.planes[p].vqp[f]);
        modelled.add(std::fabs(modelled_bytes(fitted, vqp, t.rung_quality[r] / 100.0) - bytes) / bytes);
      }
    }
  }
  std::cout << fmt::format("{:<26} {:6.2f}   {}   {}   {}   {:7.4f}   {}\n", model_name(path),
                           100 * at_rungs.worst, inside.text(), whole.text(), without_knots.text(),
                           correlation, modelled.text());
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  std::vector<std::string> packages, models;
  double log_width = -1;  // as in the package
  for (int k = 1; k < argc; ++k) {
    const std::string path = argv[k];
    if (path == "--log-width" && k + 1 < argc) {
      log_width = std::stod(argv[++k]);
      continue;
    }
    (path.ends_with(".texmesh") ? packages : models).push_back(path);
  }
  try {
    if (!packages.empty())
      std::cout
          << "bytes over uniform quality at equal surface-weighted 1 - SSIM: geometric mean over the inner "
             "rungs, worst\n"
             "                           frag.  thesis         log            log, S_mid     rd             "
             "(at "
             "rungs 3 5 7)\n";
    for (const std::string& path : packages) print_package(path, log_width);
    if (!models.empty())
      std::cout
          << "size errors in %, of fragments and of whole textures: at rungs | between: mean, p95, worst | "
             "whole: mean, p95, worst | the same without knots | model: least correlation; mean, p95, worst\n";
    for (const std::string& path : models) print_sizes(path);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
  return packages.empty() && models.empty() ? 2 : 0;
}
