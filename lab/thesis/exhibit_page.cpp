#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "lab/thesis/exhibit.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

Cell cell_of(const ExhibitCell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return *number;
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return {};
}

/// The first column names the rows.
Table table_of(const ExhibitTable& table) {
  Table out(table.caption, {});
  for (const ExhibitColumn& c : table.columns) out.column({c.name, c.digits});
  if (!out.columns.empty()) out.columns.front().align = Align::kLeft;
  for (const std::vector<ExhibitCell>& row : table.rows) {
    out.row({});
    for (const ExhibitCell& cell : row) out.rows.back().push_back(cell_of(cell));
  }
  return out;
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
  for (const ExhibitTable& table : e.tables) body += table_of(table).html();
  return html_section(anchor_of(e), markup_escaped(e.title), body);
}

Json exhibit_json(const Exhibit& e) {
  Json tables = Json::array();
  for (const ExhibitTable& table : e.tables) tables.push_back(table_of(table).json_document());
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
  for (const ExhibitTable& table : e.tables) out += "\n" + table_of(table).text();
  return out + fmt::format("\n{}: {}\n", enum_name(e.verdict), e.finding);
}

}  // namespace texmesh
