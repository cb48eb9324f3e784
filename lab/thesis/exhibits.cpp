// The list of exhibits, and their page, JSON and text.
#include "lab/thesis/exhibits.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/io/markup.h"

namespace texmesh {

std::span<const ExhibitGroup> exhibit_groups() {
  static const std::vector<ExhibitGroup> kGroups{
      {{"2.1", "fig-2.2", "fig-6.2"}, scale_exhibits},
      {{"3.1", "fig-3.5"}, fragment_exhibits},
      {{"fig-3.9"}, quality_exhibits},
      {{"4.1", "4.2", "fig-4.5", "fig-4.6", "fig-4.7"}, transfer_exhibits},
      {{"7.1", "7.2", "7.3"}, perceptual_exhibits},
      {{"fig-8.2", "fig-8.3", "fig-8.4", "fig-8.5"}, predictor_exhibits},
  };
  return kGroups;
}

std::vector<Exhibit> make_exhibits(const std::vector<std::string>& ids, const RunContext& context) {
  const auto wanted = [&](const std::string& id) { return ids.empty() || std::ranges::count(ids, id) > 0; };
  std::vector<Exhibit> out;
  for (const ExhibitGroup& group : exhibit_groups()) {
    if (std::ranges::none_of(group.ids, wanted)) continue;
    for (Exhibit& e : group.make(context))
      if (wanted(e.id)) out.push_back(std::move(e));
  }
  return out;
}

void add_columns(Table& table, int digits, std::initializer_list<const char*> names) {
  for (const char* name : names) table.column({name, digits});
}

Plot empty_plot(std::string title, std::string x_name, std::string y_name, double x_low, double x_high,
                bool linear_x) {
  return {std::move(title), std::move(x_name), std::move(y_name), x_low, x_high, 0, 0, linear_x, {}};
}

void add_line(PlotSeries line, Plot& plot) {
  for (const auto& [at, value] : line.points)
    plot.y_low = std::min(plot.y_low, value), plot.y_high = std::max(plot.y_high, value);
  plot.series.push_back(std::move(line));
}

namespace {

using Json = nlohmann::ordered_json;

/// The first column to the left.
Table shown_table(Table table) {
  table.columns.front().align = Align::kLeft;
  return table;
}

std::string verdict_html(Verdict verdict) {
  const char* style = verdict == Verdict::kConfirmed      ? "good"
                      : verdict == Verdict::kNotConfirmed ? "bad"
                                                          : "quiet";
  return fmt::format("<span class=\"{}\">{}</span>", style, enum_name(verdict));
}

std::string anchor_of(const Exhibit& e) {
  std::string out = "x" + e.id;
  for (char& c : out)
    if (c == '.') c = '-';
  return out;
}

std::string exhibit_html(const Exhibit& e) {
  std::string body = "<p class=\"quiet\">Thesis: " + markup_escaped(e.claim) +
                     "</p>\n<p class=\"quiet\">Here: " + markup_escaped(e.made_by) + "</p>\n";
  const bool open = e.verdict == Verdict::kInPart || e.verdict == Verdict::kNotComparable;
  body += fmt::format(
      "<p class=\"verdict{}\"{}>{}: {}</p>\n", e.verdict == Verdict::kNotConfirmed ? " bad" : "",
      open ? " style=\"border-color:var(--quiet)\"" : "", verdict_html(e.verdict), markup_escaped(e.finding));
  for (const Plot& plot : e.plots)
    body +=
        "<figure>" + plot.svg() + "<figcaption>" + markup_escaped(plot.title) + "</figcaption></figure>\n";
  for (const ExhibitPicture& p : e.pictures)
    body += fmt::format(
        "<figure><img class=\"map\" src=\"{}\" alt=\"{}\" width=\"{}\" height=\"{}\"><figcaption>{}</figcaption>"
        "</figure>\n",
        markup_escaped(p.file), markup_escaped(p.caption), p.width_px, p.height_px,
        markup_escaped(p.caption));
  for (const Table& table : e.tables) body += shown_table(table).html();
  return html_section(anchor_of(e), markup_escaped(e.title), body);
}

Json exhibit_json(const Exhibit& e) {
  Json tables = Json::array();
  for (const Table& table : e.tables) tables.push_back(table.json_document());
  return {{"id", e.id},
          {"title", e.title},
          {"claim", e.claim},
          {"made_by", e.made_by},
          {"verdict", enum_name(e.verdict)},
          {"finding", e.finding},
          {"tables", tables}};
}

}  // namespace

std::string exhibits_html(const std::vector<Exhibit>& exhibits) {
  Table summary("Tables and figures of the thesis, measured again", {"exhibit", "verdict"});
  std::string sections;
  for (const Exhibit& e : exhibits) {
    summary.row(
        {Cell::markup(e.title, fmt::format("<a href=\"#{}\">{}</a>", anchor_of(e), markup_escaped(e.title))),
         Cell::markup("", verdict_html(e.verdict))});
    sections += exhibit_html(e);
  }
  return html_page(
      "The thesis's tables and figures",
      "<h1>The thesis's tables and figures</h1>\n<p>Irene Cheng, <i>Feature Extraction and Adaptive "
      "On-line Visualization of 3D TexMesh</i>. Each printed value stands beside what texmesh "
      "measures. All models, pictures and links of this page are made by code. The thesis's own "
      "models and traces are not available. So shapes of curves and orders of rows can be compared, "
      "and numbers only where the thesis prints what they come from.</p>\n" +
          summary.html() + sections);
}

Json exhibits_json(const std::vector<Exhibit>& exhibits) {
  Json list = Json::array();
  for (const Exhibit& e : exhibits) list.push_back(exhibit_json(e));
  return {{"version", 1}, {"exhibits", list}};
}

std::string exhibit_text(const Exhibit& e) {
  std::string out = fmt::format("{}\nthesis: {}\nhere: {}\n", e.title, e.claim, e.made_by);
  for (const Table& table : e.tables) out += "\n" + shown_table(table).text();
  return out + fmt::format("\n{}: {}\n", enum_name(e.verdict), e.finding);
}

}  // namespace texmesh
