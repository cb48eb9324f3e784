// What sharing the bytes among fragments is worth, and how exact the size table is.
//   allocation_bench [--log-width DG] NAME.texmesh ...
//                                       bytes of thesis, log and rd over the same quality everywhere
//   ("uniform",
//                                       empty fragments not stored), at equal surface-weighted 1 - SSIM
//   allocation_bench MODEL ...          sizes: table against streams; error of sizes between the rungs,
//   against
//                                       a second ladder of just those qualities; the model S = A R^Q + c
// Every figure is a ratio or an error within one run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "delivery/cpp/package_reader.h"
#include "stages/ladder.h"
#include "stages/lut.h"
#include "stages/zim.h"
#include "tests/bench/bench_model.h"

namespace texmesh {
namespace {

struct Point {
  double bytes = 0, loss = 0;
};
using Curve = std::vector<Point>;  // by rising bytes

/// All base-colour planes of a package together.
struct Planes {
  std::vector<PlaneTables> tables;

  Point total(const std::vector<std::vector<std::int16_t>>& rungs) const {
    Point sum;
    double weight = 0;
    for (std::size_t p = 0; p < tables.size(); ++p) {
      double w = 0;
      for (const float v : surface_weights(tables[p])) w += static_cast<double>(v);
      sum.bytes += static_cast<double>(sum_of(bytes_of(tables[p], rungs[p])));
      sum.loss += w * surface_dssim(tables[p], rungs[p]);
      weight += w;
    }
    sum.loss /= weight;
    return sum;
  }
};

Point uniform(const Planes& planes, std::size_t rung) {
  std::vector<std::vector<std::int16_t>> rungs;
  for (const PlaneTables& t : planes.tables) {
    rungs.emplace_back(t.fragment_count(), kSkipped);
    for (const std::uint16_t f : t.order) rungs.back()[f] = static_cast<std::int16_t>(rung);
  }
  return planes.total(rungs);
}

/// Thesis or log at one scale, Q_i swept, Gamma = mean eta.
Curve swept(Planes planes, std::uint8_t allocation, std::uint32_t scale, double log_width) {
  Curve curve;
  for (double q = 1; q <= 100; q += 0.25) {
    std::vector<std::vector<std::int16_t>> rungs;
    for (PlaneTables& t : planes.tables) {
      t.allocation = allocation;
      if (log_width >= 0) t.log_width = static_cast<float>(log_width);
      t.quality[scale] = static_cast<float>(q);
      rungs.push_back(rungs_of(t, scale, mean_eta(t, scale)));
    }
    const Point p = planes.total(rungs);
    if (curve.empty() || p.bytes > curve.back().bytes) curve.push_back(p);
  }
  return curve;
}

Curve rate_distortion(const Planes& planes, double least, double most) {
  Curve curve;
  std::vector<RdCurve> all;
  std::vector<std::size_t> begin;
  double largest = 0;
  std::vector<double> peak;
  for (const PlaneTables& t : planes.tables) {
    peak.push_back(0);
    for (const float v : surface_weights(t)) peak.back() = std::max(peak.back(), static_cast<double>(v));
    largest = std::max(largest, peak.back());
  }
  for (std::size_t p = 0; p < planes.tables.size(); ++p) {
    begin.push_back(all.size());
    const auto curves = rd_curves(planes.tables[p], surface_weights(planes.tables[p]), peak[p] / largest);
    all.insert(all.end(), curves.begin(), curves.end());
  }
  for (double budget = least; budget <= most * 1.2; budget *= 1.01) {
    const auto ways = spend_bytes(all, static_cast<std::uint64_t>(budget));
    std::vector<std::vector<std::int16_t>> rungs;
    for (std::size_t p = 0; p < planes.tables.size(); ++p) {
      const PlaneTables& t = planes.tables[p];
      std::vector<std::uint16_t> stored = t.order;
      std::sort(stored.begin(), stored.end());
      rungs.emplace_back(t.fragment_count(), kSkipped);
      for (std::size_t k = 0; k < stored.size(); ++k)
        rungs.back()[stored[k]] = static_cast<std::int16_t>(static_cast<int>(ways[begin[p] + k]) - 1);
    }
    const Point point = planes.total(rungs);
    if (curve.empty() || point.bytes > curve.back().bytes) curve.push_back(point);
  }
  return curve;
}

/// Bytes of a curve at a loss: log-linear between its points; 0 where it does not reach.
double bytes_at(const Curve& curve, double loss) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const Point &a = curve[k - 1], &b = curve[k];
    if (!(a.loss >= loss && b.loss <= loss)) continue;
    const double t = a.loss > b.loss ? (a.loss - loss) / (a.loss - b.loss) : 0;
    return std::exp(std::log(a.bytes) + t * (std::log(b.bytes) - std::log(a.bytes)));
  }
  return 0;
}

struct Ratios {
  double mean = 0, worst = 0;
};
/// What the figures are summed up from: not the lowest and the highest rung, beside which nothing can be.
Ratios over_uniform(const Curve& curve, const Curve& reference) {
  Ratios out;
  double sum = 0;
  int count = 0;
  for (const Point& p : reference) {
    const double bytes = bytes_at(curve, p.loss);
    if (bytes <= 0) continue;
    sum += std::log(bytes / p.bytes);
    out.worst = std::max(out.worst, bytes / p.bytes);
    ++count;
  }
  out.mean = count > 0 ? std::exp(sum / count) : 0;
  return out;
}

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
  const std::uint32_t middle = planes.tables[0].scales / 2;
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
  LadderOptions between;
  between.rungs = {6, 9, 14, 23, 40, 64, 80, 89, 95};
  const Ladder ladder = encode_ladder(model.fragments, pixels, {}, context);
  const Ladder other = encode_ladder(model.fragments, pixels, between, context);
  const Predictors predictors = predict_quality(model.fragments, pixels, {}, context);
  const PackageTables tables = build_tables(model.fragments, pixels, predictors, ladder, {}, context);
  Errors at_rungs, inside, whole;
  double correlation = 1, model_error = 0;
  for (const std::size_t p : shown) {
    const PlaneTables& t = tables.planes[p];
    for (std::size_t r = 0; r < t.rung_count(); ++r)
      for (const std::uint16_t f : t.order)
        at_rungs.add(std::fabs(interpolated_bytes(t, f, t.rung_quality[r]) -
                               static_cast<double>(fragment_stream(ladder.planes[p].rungs[r], f).size())));
    for (const LadderRung& rung : other.planes[p].rungs) {
      double guess = 0, real = 0;
      for (const std::uint16_t f : t.order) {
        const auto bytes = static_cast<double>(fragment_stream(rung, f).size());
        const double value = interpolated_bytes(t, f, rung.quality);
        inside.add(std::fabs(value - bytes) / bytes);
        guess += value;
        real += bytes;
      }
      whole.add(std::fabs(guess - real) / real);
    }
    correlation = std::min(correlation, static_cast<double>(t.model_correlation));
    model_error = std::max(model_error, static_cast<double>(t.model_error));
  }
  std::cout << fmt::format("{:<26} {:6.2f}   {}   {}   {:7.4f} {:7.1f}\n", model_name(path),
                           100 * at_rungs.worst, inside.text(), whole.text(), correlation, 100 * model_error);
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
             "whole: mean, p95, worst | model: correlation, error\n";
    for (const std::string& path : models) print_sizes(path);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
  return packages.empty() && models.empty() ? 2 : 0;
}
