// The page in the order of its sections: what holds (switch sizes), the source beside S_0, what bytes buy,
// where the bytes are, fragments, the step function, proxies, method.
#include "tools/publish/report/report.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "tools/inspect/dump/dump.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

std::string answer(bool holds) {
  return holds ? "<span class=\"good\">holds</span>" : "<span class=\"bad\">does not hold</span>";
}

/// A pixel height as people read it.
std::string px(double height) { return height >= kAnyDisplayPx ? "any" : fmt::format("{:.0f}", height); }

/// The colours of maps with their values.
std::string heat_legend() {
  std::string out =
      "<svg role=\"img\" aria-label=\"Colours of FLIP maps, from 0 to 0.4 and more\" width=\"340\" "
      "height=\"38\" viewBox=\"-6 0 346 38\">\n";
  constexpr int kCells = 40;
  for (int i = 0; i < kCells; ++i)
    out += fmt::format("<rect x=\"{}\" y=\"2\" width=\"8.5\" height=\"14\" fill=\"{}\"/>\n", 8 * i + 10,
                       heat_hex((i + 0.5) / kCells));
  for (int i = 0; i <= 4; ++i)
    out += fmt::format("<text class=\"quiet mid\" x=\"{}\" y=\"32\">{:.1f}</text>\n", 80 * i + 10,
                       kFullHeat * i / 4);
  return out + "</svg>\n";
}

std::string switch_table(const Report& report) {
  Table table(
      "How far each scale looks from S_0, the finest, at the largest size at which it is shown. FLIP 0: no "
      "difference; 1: black beside white. The worst view counts.",
      {{"Scale", kScaleName},
       {"Triangles", kGrouped},
       "Shown up to, px",
       {"Mean FLIP", 3},
       {"95th percentile", 3},
       "Verdict"});
  for (const SwitchSize& s : report.switches)
    table.row({s.scale, s.triangles, px(s.up_to_px), s.views.worst_mean(), s.views.worst_p95(),
               Cell::markup("", answer(s.holds(report.options.limits)))});
  return table.html();
}

/// A view that stands on the page, what its files are called, and its name for people.
struct ShownView {
  ViewNumber view;
  const char *file, *name;
};
/// The worst of `views` and the front one, which of a single view are the same.
std::vector<ShownView> shown_views(std::size_t worst, int views) {
  const ShownView front{{0, 1}, "front", "front view"};
  if (views == 1) return {front};
  return {{{static_cast<int>(worst), views}, "worst", "worst view"}, front};
}

std::string switch_figure(PackagePictures& pictures, const SwitchSize& s, Report& report) {
  std::string out = fmt::format(
      "<figure>\n<figcaption><h3>S_{}, shown up to {} px</h3>{} triangles. In the worst of {} views, "
      "all pixels differ by {:.3f} in the mean, 95 % of them by at most {:.3f}: {}.{}</figcaption>\n",
      s.scale, px(s.up_to_px), thin_grouped(s.triangles), s.views.mean.size(), s.views.worst_mean(),
      s.views.worst_p95(), answer(s.holds(report.options.limits)),
      s.rendered_px < s.up_to_px ? fmt::format(" Rendered at {:.0f} px, the largest there is.", s.rendered_px)
                                 : "");
  const std::uint32_t side_px = pictures.side_for(s.rendered_px);
  for (const auto& [view, file, name] : shown_views(s.views.worst(), report.options.views))
    out += picture_row({fmt::format("s{:02}-{}", s.scale, file), fmt::format("S_0, {}", name),
                        fmt::format("S_{}, {}", s.scale, name),
                        fmt::format("S_{} at {:.0f} px, {}", s.scale, s.rendered_px, name)},
                       pictures.picture(0, view, side_px), pictures.picture(s.scale, view, side_px),
                       report.files);
  return out + "</figure>\n";
}

std::string header_section(PackageReader& package, Report& report) {
  const Manifest& m = package.manifest();
  const Vec3d size = m.bounds_max - m.bounds_min;
  const double unit_m = package.about().metres_per_unit;
  std::uint64_t bytes = 0;
  for (const EntryRef& e : package.entries()) bytes = std::max(bytes, e.offset + e.bytes);
  std::string out = "<header>\n<div>\n<h1>" + markup_escaped(report.title) + "</h1>\n";
  out += fmt::format("<p class=\"verdict{}\">{}</p>\n", report.holds ? "" : " bad",
                     markup_escaped(report.verdict));
  out += fmt::format(
      "<p class=\"quiet\">A texmesh package of {}: {} scales, S_0 with {} triangles, {} texture planes; "
      "{}.</p>\n",
      format_bytes(bytes), m.scales.size(), thin_grouped(m.scales.front().triangles), m.plane_count,
      unit_m > 0 ? sides_in_words(size * unit_m)
                 : fmt::format("{:.4g} x {:.4g} x {:.4g} object units", size.x, size.y, size.z));
  out += rights_line(package.about());
  out += "<nav aria-label=\"Sections\"><ul>";
  for (const auto& [id, name] : {std::pair{"switches", "Switch sizes"},
                                 {"source", "Against the source"},
                                 {"curves", "Quality and bytes"},
                                 {"bytes", "Bytes by kind"},
                                 {"fragments", "Fragments"},
                                 {"steps", "Step function"},
                                 {"proxies", "Proxies"},
                                 {"method", "Method"}})
    if ((report.source || std::string_view(id) != "source") &&
        (!m.proxies.empty() || std::string_view(id) != "proxies"))
      out += fmt::format("<li><a href=\"#{}\">{}</a></li>", id, name);
  out += "</ul></nav>\n</div>\n";
  if (m.poster) {
    report.files.push_back({kPosterPath, package.entry(*m.poster)});
    out += fmt::format("<img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\">\n", kPosterPath,
                       m.poster->width_px, m.poster->height_px, markup_escaped(report.title));
  }
  return out + "</header>\n";
}

std::string switch_section(PackagePictures& pictures, Report& report) {
  if (report.switches.empty())
    return html_section("switches", "Switch sizes",
                        "<p>The package shows S_0 at every size: no coarser scale has a step.</p>\n");
  std::string body = fmt::format(
      "<p>While the object is small on the screen, a viewer shows a coarse scale of it: up to the scale's "
      "switch size, the height of the object in px. Here each scale stands at that height beside S_0, lit, "
      "with its best textures. It holds, which means that nobody should see the switch, where in each view "
      "the mean FLIP is at most {:g}, and 95 % of the pixels have at most {:g}.</p>\n",
      report.options.limits.mean, report.options.limits.p95);
  body +=
      switch_table(report) +
      "<p class=\"quiet\">The third picture of each row shows where the first two differ: the brighter, the more "
      "(colours below). Small pictures are enlarged; each square is a pixel.</p>\n" +
      heat_legend();
  for (const SwitchSize& s : report.switches) body += switch_figure(pictures, s, report);
  return html_section("switches", "Switch sizes", body);
}

std::string source_section(PackagePictures& pictures, const RenderedModel& source, Vec3d offset,
                           Report& report) {
  const SourceComparison& c = *report.source;
  const std::uint32_t side_px = pictures.side_for(c.displayed_px);
  std::string body = fmt::format(
      "<p>The model file <strong>{}</strong> beside S_0 with its best textures, {:.0f} px high. In the worst of {} "
      "views, all pixels differ by {:.3f} in the mean, 95 % of them by at most {:.3f}. That is what the package's "
      "compression changes.</p>\n"
      "<figure>\n<figcaption class=\"quiet\">{}</figcaption>\n",
      markup_escaped(c.file), c.displayed_px, c.views.mean.size(), c.views.worst_mean(), c.views.worst_p95(),
      report.options.views == 1 ? "The front view." : "The worst view, and one of the front.");
  for (const auto& [view, file, name] : shown_views(c.views.worst(), report.options.views))
    body += picture_row(
        {fmt::format("source-{}", file), "Source", "S_0, best textures", "S_0 beside the source"},
        pictures.picture_of(source, offset, view, side_px), pictures.picture(0, view, side_px), report.files);
  return html_section("source", "Against the source", body + "</figure>\n");
}

constexpr std::size_t kMostMaps = 8;  // of textures; more would be a page that nobody reads
constexpr double kLeastHeight = 16;   // px, of the step function's plot

std::string curve_figure(const QualityCurves& curves) {
  Plot plot;
  plot.title =
      fmt::format("How far a {:.0f} px high picture is from the best one, by the bytes that were read",
                  curves.displayed_px);
  plot.x_name = "bytes that a viewer has read";
  plot.y_name = "difference from the best picture (predicted FLIP)";
  plot.x_low = 1e30, plot.x_high = 0, plot.y_high = 0;
  const auto widen = [&](const QualityPoint& p) {
    plot.x_low = std::min(plot.x_low, static_cast<double>(p.bytes));
    plot.x_high = std::max(plot.x_high, static_cast<double>(p.bytes));
    plot.y_high = std::max(plot.y_high, p.flip);
  };
  const auto points_of = [&](const std::vector<QualityPoint>& from) {
    std::vector<std::pair<double, double>> points;
    for (const QualityPoint& p : from) {
      points.emplace_back(static_cast<double>(p.bytes), p.flip);
      widen(p);
    }
    return points;
  };
  for (std::size_t k = 0; k < curves.scales.size(); ++k)
    plot.series.push_back(
        {k == 0 ? "a scale, with ever better textures" : "", "q", points_of(curves.scales[k])});
  if (!curves.proxies.empty())
    plot.series.push_back(
        {"proxies, small files of the whole object", "b", points_of(curves.proxies), true, false, true});
  plot.series.push_back({"the best for so many bytes", "a", points_of(curves.budgets), true});
  plot.x_low = std::max(plot.x_low * 0.9, 1.0), plot.x_high = std::max(plot.x_high * 1.1, plot.x_low * 1.5);
  return fmt::format("<figure>\n<figcaption><h3>Displayed {:.0f} px high</h3></figcaption>\n",
                     curves.displayed_px) +
         plot.svg() + "</figure>\n";
}

Table budget_table(const std::vector<QualityCurves>& curves) {
  Table table(
      "What so many bytes show at best: a scale or a proxy, and how far it looks from the best picture.",
      {"Displayed, px", {"Bytes", kGrouped}, "Mesh", {"FLIP", 3}});
  for (const QualityCurves& c : curves)
    for (std::size_t i = 0; i < c.budgets.size(); i += 3) {
      const QualityPoint& b = c.budgets[i];
      table.row({c.displayed_px, b.bytes,
                 b.proxy ? fmt::format("proxy {}", *b.proxy) : fmt::format("S_{}", b.scale), b.flip});
    }
  return table;
}

/// Fill of the kind with that number.
std::string kind_class(std::size_t kind) {
  constexpr const char* kColours[] = {"fa", "fb", "fc", "fd", "fe"};
  return std::string(kColours[kind % 5]) + (kind % 10 >= 5 ? " half" : "");
}

/// One bar of all bytes, in the order of the table.
std::string kinds_bar(const std::vector<KindBytes>& kinds, double sum) {
  constexpr double kWidth = 760, kHeight = 28;
  std::string out = fmt::format(
      "<svg role=\"img\" aria-label=\"Bytes by kind, as the table lists them\" width=\"{0}\" height=\"{1}\" "
      "viewBox=\"0 0 {0} {1}\">\n",
      kWidth, kHeight);
  double x = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const double width = kWidth * static_cast<double>(kinds[k].bytes) / sum;
    out += fmt::format(
        "<rect class=\"{}\" x=\"{:.1f}\" width=\"{:.1f}\" height=\"{}\"><title>{}: {}</title></rect>\n",
        kind_class(k), x, width, kHeight, markup_escaped(kinds[k].kind), format_bytes(kinds[k].bytes));
    x += width;
  }
  return out + "</svg>\n";
}

Table plane_table(PackageReader& package) {
  Table table(
      "Textures in full size, then their mips: the same texture with half the sides, and so on. Each is "
      "stored in several qualities, its rungs.",
      {"Plane", "Role", "Size, px", "Fragments", "Rungs", "Lowest rung", "Highest rung", "All"});
  for (std::size_t p = 0; p < package.textures().size(); ++p) {
    const TextureInfo& t = package.textures()[p];
    std::uint64_t all = t.tables.bytes;
    for (const EntryRef& rung : t.rungs) all += rung.bytes;
    table.row({t.mip == 0 ? std::to_string(p) : fmt::format("{} (mip {} of {})", p, t.mip, t.base), t.role,
               fmt::format("{} x {}", t.width_px, t.height_px), package.tables().planes[p].order.size(),
               t.rungs.size(), t.rungs.empty() ? "" : format_bytes(t.rungs.front().bytes),
               t.rungs.empty() ? "" : format_bytes(t.rungs.back().bytes), format_bytes(all)});
  }
  return table;
}

struct Rule {
  StepRule rule;
  const char* name;
  const char* colour;
};
constexpr Rule kRules[] = {{StepRule::kFlip, "lit pictures look alike (FLIP), the default", "a"},
                           {StepRule::kJnd, "changes are just not noticed (JND)", "b"},
                           {StepRule::kError, "points are off by a pixel at most", "c"},
                           {StepRule::kEdge, "the edges are a pixel long (O_V / E_S)", "d"}};

std::string step_plot(const Manifest& m) {
  Plot plot;
  plot.title = "Which scale is shown at which height on the screen, by each rule";
  plot.x_name = "height of the object on the screen, px";
  plot.y_name = "number of the scale; 0 is S_0, the finest";
  plot.x_low = kLeastHeight, plot.x_high = 4096;
  plot.y_high = m.scales.back().scale;
  for (const Rule& rule : kRules) {
    PlotSeries line{rule.name, rule.colour, {}};
    line.steps = true, line.strong = false, line.dashed = rule.rule != StepRule::kFlip;
    double from = plot.x_low;
    for (const ManifestStep& step : step_function(m.scales, rule.rule)) {
      if (from >= plot.x_high) break;  // beyond the border
      line.points.emplace_back(std::min(from, plot.x_high), step.scale);
      from = std::max(step.up_to_px, plot.x_low);
    }
    line.points.emplace_back(plot.x_high, line.points.back().second);
    plot.series.push_back(std::move(line));
  }
  return "<figure>\n" + plot.svg() + "</figure>\n";
}

std::string curve_section(PackageReader& package, const Report& report) {
  std::string body = fmt::format(
      "<p>The more bytes a viewer has read, the more its picture looks like the best one, S_0 with the source's "
      "texels. Each grey line is a scale whose textures get better from left to right. The coloured line is "
      "what a viewer does with so many bytes (<code>texmesh plan --budget</code>). The values are predictions, "
      "which miss measured ones by {:.1f} % in the mean.</p>\n",
      100 * static_cast<double>(package.quality().error));
  for (const QualityCurves& c : report.curves) body += curve_figure(c);
  return html_section("curves", "Quality and bytes", body + budget_table(report.curves).html());
}

std::string bytes_section(PackageReader& package) {
  const std::vector<KindBytes> kinds =
      bytes_by_kind(package.manifest(), package.store().read_manifest().size(), package.entries());
  double sum = 0;
  for (const KindBytes& k : kinds) sum += static_cast<double>(k.bytes);
  Table table("What the package's bytes are for. An entry is a file within the package.",
              {"Kind", "Entries", {"Bytes", kGrouped}, {"Share, %", percent_form()}});
  for (std::size_t i = 0; i < kinds.size(); ++i)
    table.row(
        {Cell::markup(kinds[i].kind,
                      "<svg class=\"swatch\" aria-hidden=\"true\" width=\"12\" height=\"12\"><rect class=\"" +
                          kind_class(i) + "\" width=\"12\" height=\"12\"/></svg>" +
                          markup_escaped(kinds[i].kind)),
         kinds[i].entries, kinds[i].bytes, static_cast<double>(kinds[i].bytes) / sum});
  std::string body = kinds_bar(kinds, sum) + table.html();
  if (!package.textures().empty()) body += plane_table(package).html();
  return html_section("bytes", "Bytes by kind", body);
}

std::string fragment_section(PackageReader& package, Report& report) {
  const std::size_t planes = full_size_planes(package.textures());
  if (planes == 0) return html_section("fragments", "Fragments", "<p>The package has no textures.</p>\n");
  std::string body =
      "<p>Textures are cut into fragments. A viewer fetches them one by one, and begins with those that are seen "
      "most. The brighter a fragment, the more it has of what stands above the map. A fragment with an "
      "outline alone is seen by nobody; it is not stored.</p>\n";
  for (std::uint32_t p = 0; p < std::min(planes, kMostMaps); ++p) {
    const TextureInfo& t = package.textures()[p];
    report.files.push_back({fmt::format("preview-{:03}.jpg", p), package.preview(p)});
    const std::string preview = report.files.back().path;
    body += fmt::format(
        "<figure>\n<figcaption><h3>Texture {}: {}</h3>{} x {} px in {} x {} fragments</figcaption>\n"
        "<div class=\"row\">\n",
        p, markup_escaped(t.role), t.width_px, t.height_px, t.columns, t.rows);
    std::vector<FragmentHeat> heats = fragment_heats(package, p);
    heats.insert(heats.begin(), FragmentHeat{"the preview and its grid", {}});
    for (const FragmentHeat& heat : heats)
      body += "<div><p class=\"quiet\">" + markup_escaped(heat.name) + "</p>" +
              fragment_map(package, p, heat, preview) + "</div>\n";
    body += "</div>\n</figure>\n";
  }
  if (planes > kMostMaps)
    body += fmt::format("<p class=\"quiet\">{} more textures have no map here.</p>\n", planes - kMostMaps);
  return html_section("fragments", "Fragments", body);
}

std::string step_section(PackageReader& package) {
  const Manifest& m = package.manifest();
  Table table(
      "The height on the screen, px, up to which a scale is enough, by each rule of the plot; 0: at no height. "
      "Scales that are no step are shown where time or bytes do not allow more.",
      {{"Scale", kScaleName},
       {"Triangles", kGrouped},
       {"Bytes", kGrouped},
       "FLIP",
       "JND",
       "Error of 1 px",
       "O_V / E_S",
       "Step"});
  std::set<int> steps;
  for (const ManifestStep& s : m.steps) steps.insert(s.scale);
  for (const ManifestScale& s : m.scales)
    table.row({s.scale, s.triangles, s.glb.bytes, px(s.display_px_flip), px(s.display_px_jnd),
               px(s.display_px_error), px(s.display_px_edge), steps.contains(s.scale)});
  return html_section("steps", "Step function", step_plot(m) + table.html());
}

/// A proxy beside S_0 at the largest measured height, from the front and from another side.
std::string proxy_figure(PackageReader& package, PackagePictures& pictures, std::uint32_t proxy,
                         Report& report) {
  const Manifest& m = package.manifest();
  const double height = m.proxy_sizes_px.back();
  const RenderedModel model = package_proxy(package, proxy, pictures.context());
  std::string out = fmt::format(
      "<figure>\n<figcaption><h3>Proxy {}, {}</h3>{} triangles. At a height of {:.0f} px, the pixels of all measured views "
      "differ from S_0's by {:.3f} in the mean.</figcaption>\n",
      proxy, format_bytes(m.proxies[proxy].glb.bytes), thin_grouped(m.proxies[proxy].triangles), height,
      m.proxies[proxy].flip.back());
  const std::uint32_t side_px = pictures.side_for(height);
  for (const auto& [view, name] : {std::pair{ViewNumber{0, 1}, "front"}, {ViewNumber{2, 6}, "side"}})
    out += picture_row({fmt::format("proxy{:02}-{}", proxy, name), fmt::format("S_0, {}", name),
                        fmt::format("proxy {}, {}", proxy, name),
                        fmt::format("Proxy {} at {:.0f} px, {}", proxy, height, name)},
                       pictures.picture(0, view, side_px), pictures.picture_of(model, {}, view, side_px),
                       report.files);
  return out + "</figure>\n";
}

std::string proxy_section(PackageReader& package, PackagePictures& pictures, Report& report) {
  const Manifest& m = package.manifest();
  if (m.proxies.empty()) return "";
  Table table(
      "Proxies: small files of the whole object, each with a texture of its own. FLIP says how far one "
      "looks from S_0; 95 % of its pixels are at most P95 away.",
      {"Proxy", {"Bytes", kGrouped}, {"Triangles", kGrouped}, {"Vertices", kGrouped}, "Texture, px"});
  for (const double px : m.proxy_sizes_px) table.column(fmt::format("FLIP at {:.0f} px", px));
  for (std::size_t k = 0; k < m.proxies.size(); ++k) {
    const ManifestProxy& p = m.proxies[k];
    table.row({k, p.glb.bytes, p.triangles, p.vertices, p.texture_px});
    for (std::size_t i = 0; i < m.proxy_sizes_px.size(); ++i)
      table.rows.back().emplace_back(fmt::format("{:.3f}, P95 {:.3f}", p.flip[i], p.flip_p95[i]));
  }
  std::string body = fmt::format(
      "<p>A viewer shows the smallest proxy first: after {} of the package. Where a proxy's mean FLIP is at most "
      "{:g}, and 95 % of its pixels have at most {:g}, it looks like S_0, and nothing else is read.</p>\n",
      format_bytes(start_bytes(m)), kSameFlip, kSameFlipP95);
  body += table.html();
  for (std::uint32_t k = 0; k < m.proxies.size(); ++k) body += proxy_figure(package, pictures, k, report);
  return html_section("proxies", "Proxies", body);
}

std::string method_section(PackageReader& package, const Report& report) {
  std::string body = fmt::format(
      "<p>All pictures come from texmesh's reference renderer: glTF's metallic-roughness materials with their "
      "maps, read with mips, one studio light made by code, perspective, 16 samples a pixel. FLIP (Andersson et al. 2020) "
      "says how different two pictures look when they are flipped, from 0 to 1, at 67 pixels per degree, "
      "over the pixels that either picture covers. The {} views are spread evenly over the sphere. The limits "
      "are texmesh's own.</p>\n"
      "<p>Curves of quality are predictions from the package's own table, which a compile measures.</p>\n"
      "<p class=\"quiet\">Package {}. The same package gives the same report on every machine.</p>\n",
      report.options.views, to_hex(package.id()));
  return html_section("method", "Method", body);
}

// What bytes buy at each displayed height: every scale at its rungs, proxies, and the best choice for a
// budget.

/// The bytes of a choice that gives every plane the same way: 0 = previews, else the rung before it.
std::uint64_t texture_bytes(PackageReader& package, const std::vector<PlaneChoice>& planes, std::size_t way) {
  std::uint64_t bytes = 0;
  if (way == 0) return bytes;
  for (const PlaneChoice& choice : planes) {
    const PlaneTables& t = package.tables().planes[choice.plane];
    bytes += bytes_of_rung(t, std::min(way, t.rung_count()) - 1);
  }
  return bytes;
}

PerGroup texture_losses(TextureLoss& loss, const std::vector<PlaneChoice>& planes, std::size_t way) {
  PerGroup losses{};
  const PerGroup weights = loss.weights(planes);
  for (const PlaneChoice& choice : planes) {
    const auto group = static_cast<std::size_t>(loss.group_of(choice.plane));
    const TextureLoss::Plane& plane = loss.plane(choice.plane);
    const std::size_t fragments = plane.weights.size();
    if (fragments == 0 || !(weights[group] > 0)) continue;
    const std::size_t at = std::min(way, plane.shown.size() / fragments - 1);
    for (std::size_t f = 0; f < fragments; ++f)
      losses[group] +=
          static_cast<double>(plane.weights[f]) * plane.shown[at * fragments + f] / weights[group];
  }
  return losses;
}

std::size_t most_rungs(PackageReader& package) {
  std::size_t most = 0;
  for (const PlaneTables& t : package.tables().planes) most = std::max(most, t.rung_count());
  return most;
}

/// Of each scale, what is read besides textures.
std::vector<std::uint64_t> fixed_bytes(PackageReader& package) {
  std::vector<std::uint64_t> out;
  for (const ManifestScale& s : package.manifest().scales) {
    DeliveryRequest request;
    request.scale = s.scale;
    const DeliveryPlan plan = plan_budget(package, request, 0);
    out.push_back(plan.bytes() - plan.texture_bytes);
  }
  return out;
}

std::vector<QualityPoint> proxy_points(const Manifest& m, double displayed_px) {
  std::vector<QualityPoint> out;
  const std::uint64_t first = std::min(kStartBytes, m.provenance.offset + m.provenance.bytes);
  for (std::uint32_t k = 0; k < m.proxies.size(); ++k)
    out.push_back({m.scales.back().scale, k, first + proxy_bytes_beyond_start(m, k),
                   proxy_loss(m, k, displayed_px).flip});
  return out;
}

constexpr double kSourceHeight = 512;  // px at which the source stands beside S_0

SourceComparison compare_source(PackageReader& package, const PackagePictures& pictures,
                                const RenderedModel& source, const Report& report) {
  SourceComparison out{last_name(report.options.against), kSourceHeight, {}};
  const Vec3d offset = package.manifest().origin - source.mesh.origin;
  const std::uint32_t side_px = pictures.side_for(kSourceHeight);
  for (int v = 0; v < report.options.views; ++v) {
    const ViewNumber view{v, report.options.views};
    const FlipSum flip =
        compare_flip(prepare_flip(pictures.picture_of(source, offset, view, side_px)),
                     prepare_flip(pictures.picture_of(pictures.finest(), {}, view, side_px)));
    out.views.mean.push_back(static_cast<float>(flip.mean()));
    out.views.p95.push_back(static_cast<float>(flip.percentile(0.95)));
  }
  return out;
}

}  // namespace

std::vector<QualityCurves> quality_curves(PackageReader& package, int budgets) {
  const Manifest& m = package.manifest();
  const std::vector<std::uint64_t> fixed = fixed_bytes(package);
  std::vector<QualityCurves> out;
  for (const std::uint32_t displayed_px : package.quality().sizes_px) {
    QualityCurves& curves = out.emplace_back();
    curves.displayed_px = displayed_px;
    TextureLoss loss(package, displayed_px);
    const std::vector<PlaneChoice> planes = planes_for_display(package, displayed_px);
    std::uint64_t least = ~0ull, most = 0;
    for (std::size_t k = 0; k < m.scales.size(); ++k) {
      std::vector<QualityPoint>& points = curves.scales.emplace_back();
      for (std::size_t way = 0; way <= most_rungs(package); ++way) {
        const PerGroup losses = texture_losses(loss, planes, way);
        points.push_back({m.scales[k].scale,
                          {},
                          fixed[k] + texture_bytes(package, planes, way),
                          picture_flip(package.quality(), displayed_px, m.scales[k].scale, losses)});
        least = std::min(least, points.back().bytes);
        most = std::max(most, points.back().bytes);
      }
    }
    curves.proxies = proxy_points(m, displayed_px);
    if (!curves.proxies.empty()) least = std::min(least, curves.proxies.front().bytes);
    DeliveryRequest request;
    request.displayed_px = displayed_px;
    for (int i = 0; i < budgets; ++i) {
      const double ratio = static_cast<double>(most) / static_cast<double>(std::max<std::uint64_t>(least, 1));
      const double bytes =
          static_cast<double>(least) * portable::pow(ratio, static_cast<double>(i) / (budgets - 1));
      const DeliveryPlan plan = plan_budget(package, request, static_cast<std::uint64_t>(std::ceil(bytes)));
      if (curves.budgets.empty() || plan.bytes() > curves.budgets.back().bytes)
        curves.budgets.push_back({plan.scale, plan.proxy, plan.bytes(), plan.flip});
    }
  }
  return out;
}

Report make_report(PackageReader& package, const ReportOptions& options, const RunContext& context) {
  Report report;
  report.options = options;
  report.title = package_title(package);
  std::optional<RenderedModel> source;
  if (!options.against.empty()) source = load_rendered_model(options.against, {}, context);
  PackagePictures pictures(package, {}, context);
  report.switches = measure_switch_sizes(package, pictures, options.views, context);
  report.verdict = switch_verdict(report.switches, options.limits, options.views);
  for (const SwitchSize& s : report.switches) report.holds = report.holds && s.holds(options.limits);
  report.curves = quality_curves(package, options.budgets);
  report.files.push_back({kReportPage, {}});
  if (source) report.source = compare_source(package, pictures, *source, report);
  std::string body = header_section(package, report) + "<main>\n" + switch_section(pictures, report);
  if (source)
    body += source_section(pictures, *source, package.manifest().origin - source->mesh.origin, report);
  body += curve_section(package, report) + bytes_section(package) + fragment_section(package, report);
  body += step_section(package) + proxy_section(package, pictures, report);
  body += method_section(package, report) + "</main>\n";
  const std::string page = html_page(report.title, body);
  report.files.front().bytes.assign(page.begin(), page.end());
  return report;
}

FolderRule report_folder_rule() {
  return marked_folder_rule(kReportPage, kReportFirstLine,
                            "an empty folder, an earlier report, or nothing yet");
}

void write_report(const Report& report, const std::string& folder) {
  NewFolder out(folder, report_folder_rule());
  for (const ReportFile& f : report.files) out.add(f.path, f.bytes);
  out.publish();
}

}  // namespace texmesh
