#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "lab/thesis/exhibit.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/text_table.h"
#include "tools/publish/report/html.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::string cell_text(const ExhibitCell& cell, int digits) {
  if (const auto* number = std::get_if<double>(&cell)) return fixed(*number, digits);
  const auto* text = std::get_if<std::string>(&cell);
  return text ? *text : "";
}

std::string table_html(const ExhibitTable& table) {
  HtmlTable out{markup_escaped(table.caption), {}, {}};
  for (const ExhibitColumn& column : table.columns) out.header.push_back(markup_escaped(column.name));
  for (const std::vector<ExhibitCell>& row : table.rows) {
    std::vector<std::string> cells;
    for (std::size_t k = 0; k < row.size(); ++k)
      cells.push_back(markup_escaped(cell_text(row[k], table.columns[k].digits)));
    out.rows.push_back(std::move(cells));
  }
  return out.html();
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
  for (const ExhibitTable& table : e.tables) body += table_html(table);
  return html_section(anchor_of(e), markup_escaped(e.title), body);
}

Json cell_json(const ExhibitCell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return *number;
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  return nullptr;
}

Json exhibit_json(const Exhibit& e) {
  Json tables = Json::array();
  for (const ExhibitTable& table : e.tables) {
    Json columns = Json::array(), rows = Json::array();
    for (const ExhibitColumn& column : table.columns) columns.push_back(column.name);
    for (const std::vector<ExhibitCell>& row : table.rows) {
      rows.push_back(Json::array());
      for (const ExhibitCell& cell : row) rows.back().push_back(cell_json(cell));
    }
    tables.push_back({{"caption", table.caption}, {"columns", columns}, {"rows", rows}});
  }
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
  HtmlTable summary{"Tables and figures of the thesis, measured again", {"exhibit", "verdict"}, {}};
  std::string sections;
  for (const Exhibit& e : exhibits) {
    summary.rows.push_back({fmt::format("<a href=\"#{}\">{}</a>", anchor_of(e), markup_escaped(e.title)),
                            verdict_html(e.verdict)});
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
  for (const ExhibitTable& table : e.tables) {
    TextTable text;
    for (std::size_t k = 0; k < table.columns.size(); ++k)
      text.column(table.columns[k].name, k == 0 ? Align::kLeft : Align::kRight);
    for (const std::vector<ExhibitCell>& row : table.rows) {
      std::vector<std::string> cells;
      for (std::size_t k = 0; k < row.size(); ++k)
        cells.push_back(cell_text(row[k], table.columns[k].digits));
      text.row(std::move(cells));
    }
    out += "\n" + table.caption + "\n" + text.text();
  }
  return out + fmt::format("\n{}: {}\n", enum_name(e.verdict), e.finding);
}

}  // namespace texmesh
