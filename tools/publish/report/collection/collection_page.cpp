#include "tools/publish/report/collection/collection_page.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/batch/progress.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostRows = 10'000;

std::string cut_note(std::size_t all) {
  return all > kMostRows ? fmt::format("<p class=\"quiet\">The first {} of {}.</p>\n", kMostRows, all) : "";
}

std::string failures_section(const RunSummary& s) {
  Table table("What went wrong, model by model",
              {Column::text("model"), Column::text("result"), Column::text("what was found")});
  std::size_t failures = 0;
  for (const ModelSummary& m : s.models) {
    if (m.ok()) continue;
    if (++failures <= kMostRows)
      table.row({m.model, enum_name(m.result),
                 m.result == ModelResult::kCancelled ? "not reached" : m.error.message});
  }
  if (failures == 0) return "";
  return html_section("failures", fmt::format("{} without a new package", failures),
                      table.html() + cut_note(failures));
}

std::string warnings_section(const RunSummary& s) {
  Table table("What packages lack, or what was mended", {Column::text("model"), Column::text("warning")});
  std::size_t warned = 0;
  for (const ModelSummary& m : s.models) {
    if (!m.ok() || m.warnings.empty()) continue;
    if (++warned > kMostRows) continue;
    for (const Note& n : m.warnings) table.row({m.model, note_sentence(n)});
  }
  if (warned == 0) return "";
  return html_section("warnings", fmt::format("{} with warnings", warned), table.html() + cut_note(warned));
}

std::string problems_section(const RunSummary& s) {
  if (s.problems.empty()) return "";
  Table table("Reports of shards that are not as they should be",
              {Column::text("file"), Column::text("kind"), Column::text("what was found")});
  for (const SummaryProblem& p : s.problems) table.row({p.file, p.kind, p.text});
  return html_section("problems", "Reports of shards", table.html());
}

/// The value that `part` of the models do not exceed.
template <class T>
T quantile(std::vector<T> values, double part) {
  if (values.empty()) return T{};
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

std::string figures_section(const RunSummary& s) {
  std::vector<double> seconds;
  std::vector<std::uint64_t> memory, bytes;
  double all_s = 0;
  std::uint64_t all_bytes = 0;
  for (const ModelSummary& m : s.models) {
    if (!m.ok()) continue;
    bytes.push_back(m.bytes);
    all_bytes += m.bytes;
    if (m.cost_s() <= 0) continue;
    seconds.push_back(m.cost_s());
    memory.push_back(m.made ? m.made->peak_memory_bytes : m.peak_memory_bytes);
    all_s += m.cost_s();
  }
  Table table("What a model took when its package was made", {"", "median", "9 of 10", "most", "all"});
  table.row({"time", format_seconds(quantile(seconds, .5)), format_seconds(quantile(seconds, .9)),
             format_seconds(quantile(seconds, 1)), format_seconds(all_s)});
  table.row({"peak memory", format_bytes(quantile(memory, .5)), format_bytes(quantile(memory, .9)),
             format_bytes(quantile(memory, 1))});
  table.row({"package", format_bytes(quantile(bytes, .5)), format_bytes(quantile(bytes, .9)),
             format_bytes(quantile(bytes, 1)), format_bytes(all_bytes)});
  return html_section("figures", "Figures", table.html());
}

using FaceOf = std::function<std::optional<PackageFace>(const ModelSummary&)>;

/// A picture with a title; the file is appended.
std::string picture_of(const ModelSummary& m, const FaceOf& face_of, const std::string& folder,
                       std::vector<PageFile>& files) {
  std::optional<PackageFace> face = face_of(m);
  if (!face) return "<div><p class=\"bad\">" + markup_escaped(m.package) + ": cannot be read</p></div>\n";
  std::string out = "<div>";
  if (!face->poster.empty()) {
    files.push_back({fmt::format("{}/{:05}.jpg", folder, files.size()), std::move(face->poster)});
    out +=
        "<img loading=\"lazy\" alt=\"\" src=\"" + markup_escaped(percent_encoded(files.back().name)) + "\">";
  }
  const std::string name = face->title.empty() ? m.package : face->title;
  return out + "<p>" + markup_escaped(name) + "<br><span class=\"quiet\">" + format_bytes(m.bytes) +
         "</span></p></div>\n";
}

std::string models_section(const RunSummary& s, const std::string& folder, std::size_t most_posters,
                           const FaceOf& face_of, std::vector<PageFile>& files) {
  Table table("Every package", {"model", "result", "time", "peak memory", "package"});
  std::string posters;
  std::size_t models = 0;
  for (const ModelSummary& m : s.models) {
    if (!m.ok()) continue;
    if (models++ < most_posters) posters += picture_of(m, face_of, folder, files);
    if (models > kMostRows) continue;
    const std::uint64_t memory = m.made ? m.made->peak_memory_bytes : m.peak_memory_bytes;
    table.row({m.model, enum_name(m.result), m.cost_s() > 0 ? format_seconds(m.cost_s()) : "",
               format_bytes(memory), format_bytes(m.bytes)});
  }
  if (models == 0) return "";
  if (!posters.empty()) posters = "<div class=\"row\">\n" + posters + "</div>\n";
  return html_section("models", fmt::format("{} packages", models),
                      posters + table.html() + cut_note(models));
}

}  // namespace

CollectionPage collection_page(const RunSummary& s, const std::string& poster_folder, std::size_t posters,
                               const std::function<std::optional<PackageFace>(const ModelSummary&)>& face) {
  CollectionPage page;
  const SummaryCounts c = count_results(s.models);
  const auto warned =
      std::ranges::count_if(s.models, [](const ModelSummary& m) { return !m.warnings.empty(); });
  const bool good = c.failed + c.cancelled == 0 && s.problems.empty();
  std::string body = "<h1>Collection</h1>\n";
  body += fmt::format(
      "<p class=\"verdict{}\">{} compiled, {} up to date, {} failed, {} not reached, {} with warnings; {} of "
      "processes' time in {} {}.</p>\n",
      good ? "" : " bad", c.compiled, c.unchanged, c.failed, c.cancelled, warned, format_seconds(s.seconds),
      std::max<std::size_t>(s.parts.size(), 1), s.parts.size() > 1 ? "runs" : "run");
  body += failures_section(s) + warnings_section(s) + problems_section(s) + figures_section(s);
  body += models_section(s, poster_folder, posters, face, page.files);
  page.html = html_page("Collection", body);
  return page;
}

std::optional<PackageFace> package_face(const std::string& package) {
  try {
    PackageReader reader(open_store(package));
    PackageFace face{package_title(reader), {}};
    if (const auto& poster = reader.manifest().poster)
      face.poster = reader.store().read(*poster, 0, poster->bytes);
    return face;
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace texmesh
