#include "tools/publish/report/report.h"

#include <nlohmann/json.hpp>

#include "tools/publish/report/html.h"
#include "tools/publish/report/package_words.h"
#include "tools/publish/report/report_page.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

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

Json differences_json(const ViewDifferences& d) {
  return {{"flip", d.worst_mean()}, {"flip_p95", d.worst_p95()}, {"worst_view", d.worst()}};
}

}  // namespace

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

std::string report_json(const Report& report) {
  Json switches = Json::array();
  for (const SwitchSize& s : report.switches) {
    Json j{{"scale", s.scale},
           {"triangles", s.triangles},
           {"up_to_px", s.up_to_px},
           {"rendered_px", s.rendered_px}};
    j.update(differences_json(s.views));
    j["holds"] = s.holds(report.options.limits);
    switches.push_back(std::move(j));
  }
  Json files = Json::array();
  for (const ReportFile& f : report.files) files.push_back(f.path);
  Json j{{"version", 1},
         {"title", report.title},
         {"holds", report.holds},
         {"verdict", report.verdict},
         {"worst_flip", worst_flip(report.switches)},
         {"max_flip", report.options.limits.mean},
         {"max_flip_p95", report.options.limits.p95},
         {"views", report.options.views},
         {"switch_sizes", std::move(switches)}};
  if (report.source) {
    j["source"] = {{"file", report.source->file}, {"displayed_px", report.source->displayed_px}};
    j["source"].update(differences_json(report.source->views));
  }
  j["files"] = std::move(files);
  return j.dump(-1, ' ', false, Json::error_handler_t::replace);
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

void check_report_folder(const std::string& folder) { NewFolder(folder, report_folder_rule()); }

}  // namespace texmesh
