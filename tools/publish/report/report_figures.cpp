// The sections of report_page.h that show a package's own numbers.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "format/container/layout.h"
#include "format/rules/proxy_choice.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/inspect/dump/package_figures.h"
#include "tools/publish/report/fragment_maps.h"
#include "tools/publish/report/html.h"
#include "tools/publish/report/plot.h"
#include "tools/publish/report/report_page.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostMaps = 8;  // of textures; more would be a page that nobody reads
constexpr double kLeastHeight = 16;   // px, of the step function's plot

std::string curve_figure(const QualityCurves& curves) {
  Plot plot;
  plot.title = fmt::format("Predicted FLIP against bytes at {:.0f} px", curves.displayed_px);
  plot.x_name = "bytes that a viewer reads";
  plot.y_name = "predicted FLIP";
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
    plot.series.push_back({k == 0 ? "each scale at its rungs" : "", "q", points_of(curves.scales[k])});
  if (!curves.proxies.empty()) plot.series.push_back({"proxies", "b", points_of(curves.proxies), true});
  plot.series.push_back({"the best choice for a budget", "a", points_of(curves.budgets), true});
  plot.x_low = std::max(plot.x_low * 0.9, 1.0), plot.x_high = std::max(plot.x_high * 1.1, plot.x_low * 1.5);
  return fmt::format("<figure>\n<figcaption><h3>Displayed {:.0f} px high</h3></figcaption>\n",
                     curves.displayed_px) +
         plot.svg() + "</figure>\n";
}

HtmlTable budget_table(const std::vector<QualityCurves>& curves) {
  HtmlTable table;
  table.caption = "What a budget buys: bytes in all, the scale or proxy that is chosen, predicted FLIP.";
  table.header = {"Displayed, px", "Bytes", "Mesh", "FLIP"};
  for (const QualityCurves& c : curves)
    for (std::size_t i = 0; i < c.budgets.size(); i += 3)
      table.rows.push_back({fmt::format("{:.0f}", c.displayed_px), thin_grouped(c.budgets[i].bytes),
                            c.budgets[i].proxy ? fmt::format("proxy {}", *c.budgets[i].proxy)
                                               : fmt::format("S_{}", c.budgets[i].scale),
                            fmt::format("{:.3f}", c.budgets[i].flip)});
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

HtmlTable plane_table(PackageReader& package) {
  HtmlTable table;
  table.caption = "Texture planes: full-size ones and their mips.";
  table.header = {"Plane", "Role", "Size, px", "Fragments", "Rungs", "Lowest rung", "Highest rung", "All"};
  for (std::size_t p = 0; p < package.textures().size(); ++p) {
    const TextureInfo& t = package.textures()[p];
    std::uint64_t all = t.tables.bytes;
    for (const EntryRef& rung : t.rungs) all += rung.bytes;
    const auto bytes = [](std::uint64_t n) { return format_bytes(n); };
    table.rows.push_back({t.mip == 0 ? std::to_string(p) : fmt::format("{} (mip {} of {})", p, t.mip, t.base),
                          markup_escaped(t.role), fmt::format("{} x {}", t.width_px, t.height_px),
                          std::to_string(stored_fragments(package.tables().planes[p])),
                          std::to_string(t.rungs.size()), t.rungs.empty() ? "" : bytes(t.rungs.front().bytes),
                          t.rungs.empty() ? "" : bytes(t.rungs.back().bytes), bytes(all)});
  }
  return table;
}

struct Rule {
  StepRule rule;
  const char* name;
  const char* colour;
};
constexpr Rule kRules[] = {{StepRule::kFlip, "lit pictures (FLIP), the default", "a"},
                           {StepRule::kJnd, "just-noticeable difference", "b"},
                           {StepRule::kError, "error of one pixel", "c"},
                           {StepRule::kEdge, "O_V / E_S", "d"}};

std::string step_plot(const Manifest& m) {
  Plot plot;
  plot.title = "Step function: scale shown by displayed height, by each rule";
  plot.x_name = "displayed height, px";
  plot.y_name = "scale number; 0 is S_0";
  plot.x_low = kLeastHeight, plot.x_high = 4096;
  plot.y_high = m.scales.back().scale;
  for (const Rule& rule : kRules) {
    PlotSeries line{rule.name, rule.colour, {}};
    line.steps = true, line.strong = false, line.dashed = rule.rule != StepRule::kFlip;
    double from = plot.x_low;
    for (const ManifestStep& step : step_function(m.scales, rule.rule)) {
      line.points.emplace_back(std::min(from, plot.x_high), step.scale);
      from = std::max(step.up_to_px, plot.x_low);
    }
    line.points.emplace_back(plot.x_high, line.points.back().second);
    plot.series.push_back(std::move(line));
  }
  return "<figure>\n" + plot.svg() + "</figure>\n";
}

}  // namespace

std::string curve_section(PackageReader& package, const Report& report) {
  std::string body = fmt::format(
      "<p>Each grey line is a scale with its textures from previews alone to the highest rung. The coloured "
      "line is what <code>texmesh plan --budget</code> chooses. FLIP is predicted against S_0 with the "
      "source's texels; the predictions miss measured values by {:.1f} % in the mean.</p>\n",
      100 * static_cast<double>(package.quality().error));
  for (const QualityCurves& c : report.curves) body += curve_figure(c);
  return html_section("curves", "Quality and bytes", body + budget_table(report.curves).html());
}

std::string bytes_section(PackageReader& package) {
  const std::vector<KindBytes> kinds =
      bytes_by_kind(package.manifest(), package.store().read_manifest().size(), package.index());
  double sum = 0;
  for (const KindBytes& k : kinds) sum += static_cast<double>(k.bytes);
  HtmlTable table;
  table.caption = "Bytes of the package's entries.";
  table.header = {"Kind", "Entries", "Bytes", "Share"};
  for (std::size_t i = 0; i < kinds.size(); ++i)
    table.rows.push_back(
        {"<svg class=\"swatch\" aria-hidden=\"true\" width=\"12\" height=\"12\"><rect class=\"" +
             kind_class(i) + "\" width=\"12\" height=\"12\"/></svg>" + markup_escaped(kinds[i].kind),
         std::to_string(kinds[i].entries), thin_grouped(kinds[i].bytes),
         fmt::format("{:.1f} %", 100 * static_cast<double>(kinds[i].bytes) / sum)});
  std::string body = kinds_bar(kinds, sum) + table.html();
  if (!package.textures().empty()) body += plane_table(package).html();
  return html_section("bytes", "Bytes by kind", body);
}

std::string fragment_section(PackageReader& package, Report& report) {
  const std::size_t planes = full_size_planes(package.textures());
  if (planes == 0) return html_section("fragments", "Fragments", "<p>The package has no textures.</p>\n");
  std::string body =
      "<p>Textures are cut into fragments that a viewer fetches one by one. Bright fragments take more, or "
      "have more features. Outlines alone are fragments that nobody sees; they are not stored.</p>\n";
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
  HtmlTable table;
  table.caption =
      "Displayed height in px up to which a scale is enough, by each rule; 0 = at no height. Scales that are "
      "no step of the package's own function serve under limits of time or bytes.";
  table.header = {"Scale", "Triangles", "Bytes", "FLIP", "JND", "Error of 1 px", "O_V / E_S", "Step"};
  std::set<int> steps;
  for (const ManifestStep& s : m.steps) steps.insert(s.scale);
  const auto px = [](double height) {
    return height >= kAnyDisplayPx ? std::string("any") : fmt::format("{:.0f}", height);
  };
  for (const ManifestScale& s : m.scales)
    table.rows.push_back({fmt::format("S_{}", s.scale), thin_grouped(s.triangles), thin_grouped(s.glb.bytes),
                          px(s.display_px_flip), px(s.display_px_jnd), px(s.display_px_error),
                          px(s.display_px_edge), steps.contains(s.scale) ? "yes" : ""});
  return html_section("steps", "Step function", step_plot(m) + table.html());
}

namespace {

/// A proxy beside S_0 at the largest measured height, from the front and from another side.
std::string proxy_figure(PackageReader& package, PackagePictures& pictures, std::uint32_t proxy,
                         Report& report) {
  const Manifest& m = package.manifest();
  const double height = m.proxy_sizes_px.back();
  const RenderedModel model = package_proxy(package, proxy, pictures.context());
  std::string out = fmt::format(
      "<figure>\n<figcaption><h3>Proxy {}, {}</h3>{} triangles. Mean FLIP {:.3f} at {:.0f} px, over all measured "
      "views.</figcaption>\n",
      proxy, format_bytes(m.proxies[proxy].glb.bytes), thin_grouped(m.proxies[proxy].triangles),
      m.proxies[proxy].flip.back(), height);
  const std::uint32_t side_px = pictures.side_for(height);
  for (const auto& [view, name] : {std::pair{ViewNumber{0, 1}, "front"}, {ViewNumber{2, 6}, "side"}})
    out += picture_row({fmt::format("proxy{:02}-{}", proxy, name), fmt::format("S_0, {}", name),
                        fmt::format("proxy {}, {}", proxy, name),
                        fmt::format("Proxy {} at {:.0f} px, {}", proxy, height, name)},
                       pictures.picture(0, view, side_px), pictures.picture_of(model, {}, view, side_px),
                       report.files);
  return out + "</figure>\n";
}

}  // namespace

std::string proxy_section(PackageReader& package, PackagePictures& pictures, Report& report) {
  const Manifest& m = package.manifest();
  if (m.proxies.empty()) return "";
  HtmlTable table;
  table.caption = "Proxies: the whole object in one file each, with an atlas of its own.";
  table.header = {"Proxy", "Bytes", "Triangles", "Vertices", "Texture, px"};
  for (const double px : m.proxy_sizes_px) table.header.push_back(fmt::format("FLIP at {:.0f} px", px));
  for (std::size_t k = 0; k < m.proxies.size(); ++k) {
    const ManifestProxy& p = m.proxies[k];
    table.rows.push_back({std::to_string(k), thin_grouped(p.glb.bytes), thin_grouped(p.triangles),
                          thin_grouped(p.vertices), std::to_string(p.texture_px)});
    for (std::size_t i = 0; i < m.proxy_sizes_px.size(); ++i)
      table.rows.back().push_back(fmt::format("{:.3f}, P95 {:.3f}", p.flip[i], p.flip_p95[i]));
  }
  std::string body = fmt::format(
      "<p>A viewer shows the smallest proxy first: after {} of the package. Where a proxy's mean FLIP is at most "
      "{:g} and its 95th percentile at most {:g}, nothing else is read.</p>\n",
      format_bytes(start_bytes(m)), kSameFlip, kSameFlipP95);
  body += table.html();
  for (std::uint32_t k = 0; k < m.proxies.size(); ++k) body += proxy_figure(package, pictures, k, report);
  return html_section("proxies", "Proxies", body);
}

}  // namespace texmesh
