#pragma once

#include "delivery/cpp/client/delivery_plan.h"
#include "pipeline/io/new_folder.h"
#include "tools/publish/report/report_pictures.h"

namespace texmesh {

inline constexpr Range kFlipRange{0, 1}, kHeightRange{0, 1e9};

/// What so many bytes look like: predicted FLIP against S_0 with the source's texels.
struct QualityPoint {
  int scale = 0;
  std::optional<std::uint32_t> proxy = {};  // instead of the scale
  std::uint64_t bytes = 0;                  // all that a client reads, from the first request on
  double flip = 0;
};

/// What bytes buy at one displayed height.
struct QualityCurves {
  double displayed_px = 0;
  /// Per scale of the manifest: previews alone, then every rung, all planes alike.
  std::vector<std::vector<QualityPoint>> scales;
  std::vector<QualityPoint> proxies;  // each alone, by rising bytes
  std::vector<QualityPoint> budgets;  // plan_budget() at bytes that rise by equal factors
};

/// At every height of the package's quality table. `budgets` >= 2.
std::vector<QualityCurves> quality_curves(PackageReader& package, int budgets);

struct ReportOptions {
  int views = 12;
  FlipLimits limits;
  std::string against;  // the model file behind the package; "" = none
  int budgets = 16;     // points of the budget's path
};

/// What a list of views says of its worst.
void differences_fields(const ViewDifferences& d, auto&& v) {
  v("flip", d.worst_mean(), kFlipRange, "mean FLIP of the worst view");
  v("flip_p95", d.worst_p95(), kFlipRange, "largest 95th percentile of a view's pixels");
  v("worst_view", d.worst(), Range{0, 63}, "");
}

/// S_0 at the highest rung beside the model file.
struct SourceComparison {
  std::string file;  // name without folders
  double displayed_px = 0;
  ViewDifferences views;
  static void fields(auto& s, auto&& v) {
    v("file", s.file, "");
    v("displayed_px", s.displayed_px, Range{1, 1e9}, "");
    differences_fields(s.views, v);
  }
};

/// A switch size and whether it is within the limits.
struct ReportedSwitch {
  SwitchSize size;
  bool holds = false;
  static void fields(auto& s, auto&& v) {
    v("scale", s.size.scale, Range{1, 99}, "");
    v("triangles", s.size.triangles, "");
    v("up_to_px", s.size.up_to_px, kHeightRange, "");
    v("rendered_px", s.size.rendered_px, kHeightRange,
      "less than up_to_px where pictures would be too large");
    differences_fields(s.size.views, v);
    v("holds", s.holds, "");
  }
};

/// What a report is about, and the report.
struct Report {
  std::string title;  // plain text: the package's, or the name of its file
  std::string verdict;
  bool holds = true;  // every switch size
  ReportOptions options;
  std::vector<SwitchSize> switches;
  std::vector<QualityCurves> curves;
  std::optional<SourceComparison> source;
  std::vector<ReportFile> files;  // index.html first
  std::vector<ReportedSwitch> reported() const {
    std::vector<ReportedSwitch> out;
    for (const SwitchSize& s : switches) out.push_back({s, s.holds(options.limits)});
    return out;
  }
  std::vector<std::string> paths() const {
    std::vector<std::string> out;
    for (const ReportFile& f : files) out.push_back(f.path);
    return out;
  }
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("title", s.title, "");
    v("holds", s.holds, "every switch size is within both limits; the exit code is 0 then, else 4");
    v("verdict", s.verdict, "one sentence");
    v("worst_flip", worst_flip(s.switches), kFlipRange, "");
    v("max_flip", s.options.limits.mean, kFlipRange, "");
    v("max_flip_p95", s.options.limits.p95, kFlipRange, "");
    v("views", s.options.views, Range{1, 64}, "");
    v("switch_sizes", s.reported(), "");
    v("source", s.source, "with --against: S_0 at the highest rung beside the model file");
    v("files", s.paths(), FieldRule{.count = Range{1, 1e6}}, "beneath the folder, index.html first");
  }
};

/// Renders the switch sizes of a package, reads what its tables say, and writes one static page about it:
/// verdict, pictures at each switch size beside S_0 with maps of FLIP, curves of quality against bytes, bytes
/// by kind, maps of fragments, the step function. The page needs no script and asks for nothing but its own
/// files. Text of the package stands in it as text only. Same bytes for any thread count and machine.
/// FormatError when the package is damaged, InputError for a model file that cannot be read.
Report make_report(PackageReader& package, const ReportOptions& options, const RunContext& context);

/// The page of a folder that html_page() fills.
inline constexpr const char* kReportPage = "index.html";
/// A folder is new or empty, or it holds such a page and is replaced.
FolderRule report_folder_rule();

/// Writes the files; the folder appears whole or not at all. An earlier report is replaced. InputError when
/// the folder holds anything else, or cannot be made.
void write_report(const Report& report, const std::string& folder);

}  // namespace texmesh
