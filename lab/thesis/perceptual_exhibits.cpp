// Tables 2.1, 7.1 to 7.3, Figs. 2.1, 2.2 and 6.2: scales, and the perceptual values between them.
#include <fmt/format.h>

#include "format/base/portable_math.h"
#include "format/rules/jnd_choice.h"
#include "format/rules/viewing.h"
#include "lab/thesis/exhibits.h"
#include "lab/thesis/made_models.h"
#include "stages/perceptual_values/perceptual_values.h"
#include "stages/skeletonization/skeletonization.h"
#include "stages/ssf/ssf.h"

namespace texmesh {
namespace {

// 36 x 52 samples of a full turn have the printed 1,872 vertices and 3,672 faces.
constexpr std::uint32_t kHeadColumns = 36, kHeadRows = 52;
constexpr double kHeadVertices = 1872, kHeadFaces = 3672;

struct PrintedScale {
  int scale;
  double removed, faces;
};
constexpr PrintedScale kTable21[] = {
    {5, 685, 2226}, {7, 744, 2108}, {10, 824, 1948}, {15, 985, 1624}, {20, 1196, 1190}};

/// The coarsest scale up to this one that differs from its neighbours.
const NestedScale& scale_up_to(const NestedScales& scales, int scale) {
  return *std::prev(std::ranges::upper_bound(scales.scales, scale, {}, &NestedScale::scale));
}

Exhibit table_2_1(const RunContext& context) {
  const MadeChain chain =
      thesis_chain(make_scan_model(MadeShape::kHead, kHeadColumns, kHeadRows, 0, context), context);
  const auto vertices = static_cast<double>(chain.mesh.mesh.positions.size());
  Table table{"Head: vertices removed and faces left", {}};
  add_columns(table, 0, {"scale", "removed, printed", "ours"});
  add_columns(table, 1, {"of all %, printed", "ours"});
  add_columns(table, 0, {"faces, printed", "ours"});
  add_columns(table, 2, {"faces per removed vertex, printed", "ours"});
  double furthest = 0, last = -1;
  bool rises = true;
  for (const PrintedScale& p : kTable21) {
    const NestedScale& s = scale_up_to(chain.scales, p.scale);
    const double removed = vertices - s.position_count, faces = static_cast<double>(s.triangles.size());
    const double share = 100 * removed / vertices, printed = 100 * p.removed / kHeadVertices;
    table.rows.push_back(
        {fmt::format("{}", p.scale), p.removed, removed, printed, share, p.faces, faces,
         (kHeadFaces - p.faces) / p.removed,
         removed > 0 ? (static_cast<double>(chain.mesh.mesh.triangles.size()) - faces) / removed : 0});
    furthest = std::max(furthest, std::abs(share - printed));
    rises = rises && removed >= last;
    last = removed;
  }
  Exhibit e{
      "2.1",
      "Table 2.1: faces left at each scale of a head",
      "a head of 1,872 vertices and 3,672 faces; S_20 keeps 676 vertices and 1,190 faces",
      fmt::format(
          "range scan of a made head, {} x {} samples: {:.0f} vertices, {} faces; filtered by r(alpha, y), "
          "removed by the scale map, merged into the closest neighbour. Confirmed: the share rises with the scale "
          "and is within 15 points of the printed one. Not confirmed: it falls, or is more than 25 off",
          kHeadColumns, kHeadRows, vertices, chain.mesh.mesh.triangles.size()),
      {table},
      verdict_of(rises && furthest <= 15, !rises || furthest > 25)};
  e.finding = fmt::format(
      "the share removed {} with the scale and is at most {:.1f} points from the printed one. A grid of "
      "36 x 52 over a full turn has exactly the printed numbers of vertices and faces. The head is "
      "another one, so the shares tell of its relief.",
      rises ? "rises" : "does not always rise", furthest);
  return e;
}

struct Sampled {
  std::string name;
  ScaleMap map;
  double spacing;  // of samples, in the unit of sigma
};

Sampled filtered_ring(const std::string& name, const RangeGrid& ring, const RunContext& context) {
  SsfOptions options;
  options.scales = 40, options.sigma_max = 0.5, options.convergence = 0;
  const auto samples = static_cast<std::uint32_t>(ring.radius.size());
  double mean = 0;
  for (const float r : ring.radius) mean += static_cast<double>(r) / samples;
  return {name, filter_range_scan(ring, samples, options, context),
          mean * static_cast<double>(ring.alpha_step_rad)};
}

/// The first sigma, in samples, at which the range has fallen to this share; 0 for none.
double sigma_at(const Sampled& s, double share) {
  for (std::size_t k = 1; k < s.map.sigma.size(); ++k)
    if (static_cast<double>(s.map.convergence[k]) <= share)
      return static_cast<double>(s.map.sigma[k]) / s.spacing;
  return 0;
}

Exhibit figure_2_2(const RunContext& context) {
  constexpr std::uint32_t kPrinted[] = {18, 8, 6, 4, 2};
  constexpr double kNearTheBottom = 0.05;
  const Sampled ring = filtered_ring("", made_ring(MadeShape::kNutcracker, 256, kNearTheBottom), context);
  const std::vector<std::uint32_t>& crossings = ring.map.crossings_at;
  std::size_t rises = 0, steps = crossings.size() - 1;
  for (std::size_t s = 1; s <= steps; ++s) rises += crossings[s] > crossings[s - 1];
  Table table{"Zero crossings of S_0, then of the first scale with no more than printed",
              {"printed", "ours", "scale", {"sigma, samples", 1}, {"max - min, share of S_0's", 3}}};
  for (std::size_t row = 0, s = 0; row < std::size(kPrinted); s = std::max<std::size_t>(s, 1), ++row) {
    while (row > 0 && s < steps && crossings[s] > kPrinted[row]) ++s;
    table.row({fmt::format("{}", kPrinted[row]), crossings[s], s,
               static_cast<double>(ring.map.sigma[s]) / ring.spacing, ring.map.convergence[s]});
  }
  const std::uint32_t last = crossings.back();
  return {
      "fig-2.2",
      "Figs. 2.1 and 2.2: a signal of 256 samples, smoothed",
      "18 zero crossings of a signal from near the nutcracker's bottom become 8, 6, 4 and 2 as sigma grows",
      "a ring of 256 samples of the made nutcracker, at a twentieth of its height, 40 scales, window 1.4 sigma. "
      "Confirmed: the number rises at no step and comes down to 2. Not confirmed: it ends above 4, or rises at more than "
      "a tenth of the steps",
      {table},
      verdict_of(rises == 0 && last <= 2, last > 4 || 10 * rises > steps),
      fmt::format(
          "{} crossings become {}; {} of {} steps from scale to scale add some. The signal is another one, so the "
          "course can be compared, and not where a number is reached.",
          crossings[0], last, rises, steps)};
}

Exhibit figure_6_2(const RunContext& context) {
  const std::vector<Sampled> sets{
      filtered_ring("(a) head, 360", made_ring(MadeShape::kHead, 360), context),
      filtered_ring("(b) nutcracker, 360", made_ring(MadeShape::kNutcracker, 360), context),
      filtered_ring("(c) head, 36", made_ring(MadeShape::kHead, 36), context),
      filtered_ring("(d) nutcracker, 36", made_ring(MadeShape::kNutcracker, 36), context)};
  Plot plot = empty_plot("Fig. 6.2: range of the smoothed signal over sigma", "sigma, samples",
                         "max - min, share of S_0's", 1, 200, false);
  Table table{"Sigma, in samples, at which max - min has fallen to a share of S_0's",
              {{"samples", 0}, {"to 0.9", 1}, {"to 0.5", 1}, {"to 0.3", 1}, {"to 0.1", 1}}};
  for (std::size_t k = 0; k < sets.size(); ++k) {
    PlotSeries line{sets[k].name, kLineColours[k], {}, false, k > 1, false, false};
    for (std::size_t i = 1; i < sets[k].map.sigma.size(); ++i)
      line.points.emplace_back(static_cast<double>(sets[k].map.sigma[i]) / sets[k].spacing,
                               static_cast<double>(sets[k].map.convergence[i]));
    add_line(std::move(line), plot);
    std::vector<Cell> row{sets[k].name};
    for (const double share : {0.9, 0.5, 0.3, 0.1}) {
      const double sigma = sigma_at(sets[k], share);
      row.push_back(sigma > 0 ? Cell{sigma} : Cell{std::string("not reached")});
    }
    table.rows.push_back(std::move(row));
  }
  const double fine = sigma_at(sets[0], 0.5), coarse = sigma_at(sets[2], 0.5), other = sigma_at(sets[1], 0.5);
  Exhibit e{
      "fig-6.2",
      "Fig. 6.2: convergence of scale-space filtering",
      "360 samples need a larger sigma_max than 36; different models need different ones; the rate is not constant",
      "rings of made scans, 360 samples and every tenth of them, 40 scales, window 1.4 sigma",
      {table},
      verdict_of(fine > coarse && coarse > 0 && fine != other, false),
      "",
      {plot}};
  e.finding = fmt::format(
      "counted in samples, the head's range is halved at sigma {:.1f} with 360 samples and at {:.1f} with "
      "36; the nutcracker's at {:.1f} with 360. As a length on the surface sigma hardly differs "
      "between 360 and 36 samples, so texmesh counts sigma as a length.",
      fine, coarse, other);
  return e;
}

}  // namespace

std::vector<Exhibit> scale_exhibits(const RunContext& context) {
  return {table_2_1(context), figure_2_2(context), figure_6_2(context)};
}

namespace {

// 18 x 36 samples of a full turn have the printed 1,260 faces.
constexpr std::uint32_t kNutcrackerColumns = 18, kNutcrackerRows = 36;
constexpr double kThesisJnd = 0.10;

struct PrintedStep {
  double faces, average, deviation;
};
constexpr PrintedStep kTable71[] = {{1162, .0410, .0308},
                                    {1118, .0412, .0294},
                                    {1074, .0478, .0390},
                                    {1040, .0468, .0288},
                                    {1002, .0678, .0491}};
constexpr double kTable72[] = {.0410, .0616, .0677, .0759, .1080};

struct Nutcracker {
  MadeChain chain;
  Skeleton skeleton;
  PerceptualValues values;
};

Nutcracker measure_nutcracker(const RunContext& context) {
  Nutcracker n;
  n.chain = thesis_chain(
      make_scan_model(MadeShape::kNutcracker, kNutcrackerColumns, kNutcrackerRows, 0, context), context);
  n.skeleton = skeletonize(n.chain.mesh, {}, context);
  PerceptualValuesOptions options;
  options.jnd = kThesisJnd;
  options.statistic = PerceptualStatistic::kAverage;
  n.values = measure_perceptual_values(n.chain.scales, n.skeleton, options, context);
  return n;
}

std::string step_name(const Nutcracker& n, std::size_t k) {
  return fmt::format("{}-{}", n.chain.scales.scales[k - 1].scale, n.chain.scales.scales[k].scale);
}

/// The root of the mean area of a step's quadric errors, which are mean squares of distances to planes, in
/// the place of R: over R_C squared (7.2).
double quadric_value(const Nutcracker& n, std::size_t k) {
  const NestedScales& s = n.chain.scales;
  double sum = 0;
  const std::uint32_t first = s.scales[k - 1].collapse_count, end = s.scales[k].collapse_count;
  for (std::uint32_t c = first; c < end; ++c)
    sum += std::pow(static_cast<double>(s.collapses[c].error / n.skeleton.radius[s.collapses[c].to]), 2);
  return std::sqrt(sum / (end - first));
}

Exhibit table_7_1(const Nutcracker& n) {
  Table table{"Perceptual values between adjacent scales", {}};
  add_columns(table, 0, {"scales, printed", "ours", "faces, printed", "ours"});
  add_columns(table, 4,
              {"average, printed", "ours", "deviation, printed", "ours", "largest, ours", "least, ours",
               "by quadric error, ours"});
  std::size_t rising = 0, small = 0, rising_errors = 0;
  const std::size_t rows = std::min<std::size_t>(std::size(kTable71), n.values.step.size() - 1);
  for (std::size_t k = 1; k <= rows; ++k) {
    const PrintedStep& p = kTable71[k - 1];
    const CollapseStatistics& s = n.values.step[k];
    table.rows.push_back({fmt::format("{}-{}", k - 1, k), step_name(n, k), p.faces,
                          n.chain.scales.scales[k].triangles.size(), p.average, s.mean, p.deviation,
                          s.deviation, s.max, s.min, quadric_value(n, k)});
    rising += k > 1 && s.mean >= n.values.step[k - 1].mean;
    rising_errors += k > 1 && quadric_value(n, k) >= quadric_value(n, k - 1);
    small += static_cast<double>(s.mean) < kThesisJnd;
  }
  return {
      "7.1",
      "Table 7.1: perceptual values between adjacent scales",
      "averages of .041 to .068 on a nutcracker of 1,260 faces, rising but from S_3 to S_4; deviations below them",
      fmt::format(
          "range scan of a made nutcracker, {} x {} samples: {} faces; skeleton, and collapses in the scale "
          "map's order; scales within 3 % of each other's faces count as one. Confirmed: all averages are below "
          "the JND, and three of four steps rise, as printed. Not confirmed: one average is above it, or "
          "fewer than two steps rise",
          kNutcrackerColumns, kNutcrackerRows, n.chain.mesh.mesh.triangles.size()),
      {table},
      verdict_of(small == rows && rising >= 2 && rising + 2 >= rows, small < rows || rising < 2),
      fmt::format(
          "ours rise in {} of {} steps, and {} of {} averages are below the JND of .10. Our first step takes {} of "
          "1,260 faces, the printed one 98: at the first sigma many samples of a coarse grid cross nothing. A grid "
          "of 18 x 36 over a full turn has exactly the printed number of faces. The root of the area of the quadric "
          "error over R_C, the other stimulus that 7.2 names without a figure, rises in {} of {} steps, and ranks steps otherwise.",
          rising, rows - 1, small, rows,
          n.chain.mesh.mesh.triangles.size() - n.chain.scales.scales[1].triangles.size(), rising_errors,
          rows - 1)};
}

Table table_of_rules(const Nutcracker& n) {
  std::vector<float> printed_steps{0}, steps;
  for (const PrintedStep& p : kTable71) printed_steps.push_back(static_cast<float>(p.average));
  for (const CollapseStatistics& s : n.values.step) steps.push_back(s.mean);
  const std::vector<float> printed = chained_values(printed_steps), ours = chained_values(steps);
  Table table{
      "Cumulative values from S_0: printed, by rules from the printed Table 7.1, and of our nutcracker", {}};
  add_columns(table, 0, {"to"});
  add_columns(table, 4, {"printed", "root of squares of 7.1", "sum of 7.1"});
  add_columns(table, 0, {"our scale"});
  add_columns(table, 4,
              {"ours, root of squares", "ours, sum", "ours, against the survivor", "ours, p95 of distances"});
  double sum = 0, our_sum = 0;
  for (std::size_t j = 1; j <= 5; ++j) {
    sum += kTable71[j - 1].average;
    std::vector<Cell> row{fmt::format("S_{}", j), kTable72[j - 1], printed[j], sum};
    if (j < steps.size()) {
      our_sum += static_cast<double>(steps[j]);
      row.insert(row.end(), {fmt::format("S_{}", n.chain.scales.scales[j].scale), ours[j], our_sum,
                             n.values.chain_average[j], n.values.p95[j]});
    }
    row.resize(9);
    table.rows.push_back(std::move(row));
  }
  return table;
}

Plot plot_7_13(const Nutcracker& n, const std::vector<std::uint8_t>& major) {
  const std::vector<NestedScale>& scales = n.chain.scales.scales;
  Plot plot = empty_plot("Fig. 7.13: scale shown over distance, one unit a scale", "distance, units", "scale",
                         0, scales.back().scale, true);
  PlotSeries linear{"a scale a unit", "q", {}, false, true};
  PlotSeries steps{"major scales", "a", {}, true, false, false, true};
  double from = 0;
  for (std::size_t k = 0; k < scales.size(); ++k) {
    linear.points.emplace_back(scales[k].scale, scales[k].scale);
    if (k > 0 && !major[k]) continue;
    steps.points.emplace_back(from, scales[k].scale);
    from = scales[k].scale;
  }
  steps.points.emplace_back(from, scales.back().scale);
  add_line(std::move(linear), plot), add_line(std::move(steps), plot);
  return plot;
}

std::string majors_of(const Nutcracker& n, const std::vector<std::uint8_t>& major) {
  std::vector<int> out;
  for (std::size_t k = 0; k < major.size(); ++k)
    if (major[k]) out.push_back(n.chain.scales.scales[k].scale);
  return fmt::format("{}", fmt::join(out, ", "));
}

Exhibit table_7_2(const Nutcracker& n) {
  const Table table = table_of_rules(n);
  double root = 0, sum = 0;
  for (std::size_t j = 0; j < 5; ++j) {
    root = std::max(root, std::abs(std::get<double>(table.rows[j][2].value) / kTable72[j] - 1));
    sum = std::max(sum, std::abs(std::get<double>(table.rows[j][3].value) / kTable72[j] - 1));
  }
  std::vector<float> printed(36, 0);
  for (std::size_t j = 1; j < 6; ++j) printed[j] = static_cast<float>(kTable72[j - 1]);
  const std::size_t first = coarsest_alike(printed, 6, 0, kThesisJnd);
  const std::size_t rows = n.values.step.size();
  const std::vector<std::uint8_t> survivor = major_rows(n.values.chain_average, rows, kThesisJnd);
  return {
      "7.2",
      "Table 7.2 and Fig. 7.13: cumulative values and major scales",
      "S_1 to S_5 differ from S_0 by .041 to .108; the rule is not printed; S_4 is the first major scale of "
      "4, 9, 11, 17 and 20",
      "the printed Table 7.1, and the nutcracker of Table 7.1, whose chains of collapses are followed to the vertex that "
      "is left (7.2)",
      {table},
      first == 4 && root < sum ? Verdict::kInPart : Verdict::kNotConfirmed,
      fmt::format(
          "with the printed values and JND .10 the first major scale is S_{}, as printed. Of the rules, the root of "
          "the sum of squares of Table 7.1 comes within {:.0f} % of Table 7.2, the plain sum within {:.0f} %; "
          "neither gives the printed digits. Major scales of our nutcracker: {} by the root of squares, {} "
          "against the survivor.",
          first, 100 * root, 100 * sum, majors_of(n, n.values.major), majors_of(n, survivor)),
      {plot_7_13(n, n.values.major)}};
}

// ---- Table 7.3

struct Monitor {
  double width_in, height_in, width_px, height_px;
};
constexpr Monitor kMonitors[] = {
    {16, 12, 1280, 1024}, {11, 8, 1024, 768}, {12, 9, 1024, 768}, {14, 11, 1280, 1024}};
constexpr double kNear_in = 18, kFar_in = 30;

/// Of a screen that an eye looks at from so far.
double px_per_degree(double distance_px) {
  const double half = portable::kPi / 360;
  return 2 * distance_px * portable::sin(half) / portable::cos(half);
}

std::vector<ManifestScale> viewed_scales(const Nutcracker& n) {
  std::vector<ManifestScale> out;
  for (std::size_t k = 0; k < n.chain.scales.scales.size(); ++k) {
    ManifestScale s;
    s.scale = n.chain.scales.scales[k].scale;
    s.display_px_error = k == 0 ? kAnyDisplayPx : static_cast<double>(n.values.display_px_error[k]);
    s.display_px_edge = k == 0 ? kAnyDisplayPx : static_cast<double>(n.values.display_px_edge[k]);
    out.push_back(s);
  }
  return out;
}

Exhibit table_7_3(const Nutcracker& n) {
  const std::vector<ManifestScale> scales = viewed_scales(n);
  const std::vector<ManifestStep> by_pixel = step_function(scales, StepRule::kError),
                                  by_edge = step_function(scales, StepRule::kEdge);
  const std::size_t rows = scales.size();
  const int by_jnd =
      scales[coarsest_alike(value_table(n.values, PerceptualStatistic::kAverage), rows, 0, kThesisJnd)].scale;
  std::vector<float> radius = n.skeleton.radius;
  std::ranges::sort(radius);
  const double middle =
      static_cast<double>(radius[radius.size() / 2]) / static_cast<double>(n.values.object_height);
  Table table{"The monitors, with the nutcracker as high as the screen", {}};
  add_columns(table, 0, {"monitor", "inches", "pixels"});
  add_columns(table, 1, {"pixels per inch", "px per degree at 18 in", "at 30 in", "JND of the middle R, px"});
  add_columns(table, 0, {"scale by JND", "by one pixel", "by O_V / E_S"});
  std::size_t coarser = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const Monitor& m = kMonitors[k];
    const double per_inch = m.height_px / m.height_in;
    const int pixel = scale_at(by_pixel, m.height_px);
    coarser += by_jnd > pixel;
    table.rows.push_back({fmt::format("{}", k + 1), fmt::format("{:.0f} x {:.0f}", m.width_in, m.height_in),
                          fmt::format("{:.0f} x {:.0f}", m.width_px, m.height_px), per_inch,
                          px_per_degree(kNear_in * per_inch), px_per_degree(kFar_in * per_inch),
                          kThesisJnd * middle * m.height_px, by_jnd, pixel, scale_at(by_edge, m.height_px)});
  }
  return {
      "7.3",
      "Table 7.3: monitors, and the scales they ask for",
      "four monitors; refinement may stop at the JND before one pixel limits it (7.6)",
      "the printed sizes; the nutcracker's scales by the average value below .10, by an error of one pixel (95th "
      "percentile) and by O_V / E_S",
      {table},
      coarser == 4 ? Verdict::kInPart : Verdict::kNotConfirmed,
      fmt::format(
          "the JND stops refinement before the pixel on {} of 4 monitors. That nothing is lost by it is not "
          "confirmed: on scans of ours, scales that the JND allows differ visibly from S_0 (FLIP .10 to .18 over "
          "the object).",
          coarser)};
}

}  // namespace

std::vector<Exhibit> perceptual_exhibits(const RunContext& context) {
  const Nutcracker n = measure_nutcracker(context);
  return {table_7_1(n), table_7_2(n), table_7_3(n)};
}

}  // namespace texmesh
