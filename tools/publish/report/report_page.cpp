#include "tools/publish/report/report_page.h"

#include <fmt/format.h>

#include <cmath>

#include "format/base/sha256.h"
#include "format/container/layout.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/report/flip_colours.h"
#include "tools/publish/report/html.h"
#include "tools/publish/report/package_words.h"
#include "tools/publish/report/plot.h"

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
  HtmlTable table;
  table.caption = "FLIP of each scale against S_0 at its switch size; the worst view counts.";
  table.header = {"Scale", "Triangles", "Up to, px", "Mean FLIP", "95th percentile", "Verdict"};
  for (const SwitchSize& s : report.switches)
    table.rows.push_back({fmt::format("S_{}", s.scale), thin_grouped(s.triangles), px(s.up_to_px),
                          fmt::format("{:.3f}", s.views.worst_mean()),
                          fmt::format("{:.3f}", s.views.worst_p95()),
                          answer(s.holds(report.options.limits))});
  return table.html();
}

std::string switch_figure(PackagePictures& pictures, const SwitchSize& s, Report& report) {
  std::string out = fmt::format(
      "<figure>\n<figcaption><h3>S_{}, shown up to {} px</h3>{} triangles. Mean FLIP {:.3f} and 95th "
      "percentile {:.3f} in the worst of {} views: {}.{}</figcaption>\n",
      s.scale, px(s.up_to_px), thin_grouped(s.triangles), s.views.worst_mean(), s.views.worst_p95(),
      s.views.mean.size(), answer(s.holds(report.options.limits)),
      s.rendered_px < s.up_to_px ? fmt::format(" Rendered at {:.0f} px, the largest there is.", s.rendered_px)
                                 : "");
  const std::uint32_t side_px = pictures.side_for(s.rendered_px);
  const auto worst = static_cast<int>(s.views.worst());
  const struct {
    ViewNumber view;
    const char* name;
  } views[] = {{{worst, report.options.views}, "worst view"}, {{0, 1}, "front view"}};
  for (const auto& [view, name] : views)
    out += picture_row({fmt::format("s{:02}-{}", s.scale, view.count == 1 ? "front" : "worst"),
                        fmt::format("S_0, {}", name), fmt::format("S_{}, {}", s.scale, name),
                        fmt::format("S_{} at {:.0f} px, {}", s.scale, s.rendered_px, name)},
                       pictures.picture(0, view, side_px), pictures.picture(s.scale, view, side_px),
                       report.files);
  return out + "</figure>\n";
}

}  // namespace

std::string header_section(PackageReader& package, Report& report) {
  const Manifest& m = package.manifest();
  const Vec3d size = m.bounds_max - m.bounds_min;
  std::uint64_t bytes = 0;
  for (const EntryRef& e : package.index()) bytes = std::max(bytes, e.offset + e.bytes);
  std::string out = "<header>\n<div>\n<h1>" + markup_escaped(report.title) + "</h1>\n";
  out += fmt::format("<p class=\"verdict{}\">{}</p>\n", report.holds ? "" : " bad",
                     markup_escaped(report.verdict));
  out += fmt::format(
      "<p class=\"quiet\">A texmesh package of {}: {} scales, S_0 with {} triangles, {} texture planes; "
      "{:.4g} x {:.4g} x {:.4g} object units.</p>\n",
      format_bytes(bytes), m.scales.size(), thin_grouped(m.scales.front().triangles), m.plane_count, size.x,
      size.y, size.z);
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
      "<p>A viewer shows a coarse scale up to its switch size, the displayed height of the object in px. "
      "Each scale is rendered at that height beside S_0, lit, with the textures at their highest rung. It "
      "holds where no view's mean FLIP is above {:g} and no view's 95th percentile above {:g}.</p>\n",
      report.options.limits.mean, report.options.limits.p95);
  body += switch_table(report) +
          "<p class=\"quiet\">Maps show FLIP by colour. Small pictures are enlarged by whole numbers.</p>\n" +
          heat_legend();
  for (const SwitchSize& s : report.switches) body += switch_figure(pictures, s, report);
  return html_section("switches", "Switch sizes", body);
}

std::string source_section(PackagePictures& pictures, const RenderedModel& source, Vec3d offset,
                           Report& report) {
  const SourceComparison& c = *report.source;
  const std::uint32_t side_px = pictures.side_for(c.displayed_px);
  std::string body = fmt::format(
      "<p>The model file <strong>{}</strong> beside S_0 with its textures at the highest rung, {:.0f} px high: "
      "mean FLIP {:.3f} and 95th percentile {:.3f} in the worst of {} views. That is what coding costs.</p>\n"
      "<figure>\n<figcaption class=\"quiet\">The worst view, and one of the front.</figcaption>\n",
      markup_escaped(c.file), c.displayed_px, c.views.worst_mean(), c.views.worst_p95(), c.views.mean.size());
  for (const ViewNumber view :
       {ViewNumber{static_cast<int>(c.views.worst()), report.options.views}, ViewNumber{0, 1}})
    body += picture_row({view.count == 1 ? "source-front" : "source-worst", "Source", "S_0, highest rung",
                         "S_0 beside the source"},
                        pictures.picture_of(source, offset, view, side_px),
                        pictures.picture(0, view, side_px), report.files);
  return html_section("source", "Against the source", body + "</figure>\n");
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

}  // namespace texmesh
