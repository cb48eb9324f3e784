#include "pipeline/io/table.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/markup.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::string shown_number(double value, const NumberForm& form) {
  const double shown = value * form.factor;
  const std::string text =
      form.kind == NumberForm::Kind::kShortest ? shortest(shown, form.digits) : fixed(shown, form.digits);
  return std::string(form.before) + text;
}

/// Numbers without a part behind the point are shown in full, whatever their size.
template <class Integer>
std::string integer_text(Integer value, const NumberForm& form) {
  if (form.kind == NumberForm::Kind::kGrouped && value >= 0)
    return grouped(static_cast<std::uint64_t>(value));
  if (form.digits == 0 && form.factor == 1) return std::string(form.before) + std::to_string(value);
  return shown_number(static_cast<double>(value), form);
}

std::string shown_text(const Cell& cell, const NumberForm& form) {
  if (cell.shown) return *cell.shown;
  return std::visit(
      [&](const auto& value) -> std::string {
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, std::monostate>)
          return "";
        else if constexpr (std::is_same_v<T, bool>)
          return value ? "yes" : "";
        else if constexpr (std::is_same_v<T, std::string>)
          return value;
        else if constexpr (std::is_same_v<T, double>)
          return shown_number(value, form);
        else
          return integer_text(value, form);
      },
      cell.value);
}

Json cell_json(const Cell& cell) {
  return std::visit(
      [](const auto& value) -> Json {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::monostate>)
          return nullptr;
        else
          return value;
      },
      cell.value);
}

const Cell& cell_of(const std::vector<Cell>& row, std::size_t column) {
  static const Cell kEmpty;
  return column < row.size() ? row[column] : kEmpty;
}

std::string heading(const Column& c) { return c.unit.empty() ? c.name : c.name + " [" + c.unit + "]"; }

std::size_t characters(const std::string& s) {
  return static_cast<std::size_t>(
      std::count_if(s.begin(), s.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string in_width(const std::string& cell, std::size_t width, Align align) {
  const std::string blanks(width - std::min(width, characters(cell)), ' ');
  return align == Align::kRight ? blanks + cell : cell + blanks;
}

std::string html_of(const Cell& cell, const NumberForm& form) {
  if (!cell.html.empty()) return cell.html;
  const auto* whole = std::get_if<std::uint64_t>(&cell.value);
  if (whole && !cell.shown && form.kind == NumberForm::Kind::kGrouped) return thin_grouped(*whole);
  return markup_escaped(shown_text(cell, form));
}

std::string csv_field(const Cell& cell) {
  const auto* text = std::get_if<std::string>(&cell.value);
  if (!text) return std::holds_alternative<std::monostate>(cell.value) ? "" : cell_json(cell).dump();
  if (text->find_first_of(",\"\r\n") == std::string::npos) return *text;
  std::string out = "\"";
  for (const char c : *text) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

std::string in_groups(std::uint64_t value, std::string_view blank) {
  std::string s = std::to_string(value);
  for (std::size_t i = s.size(); i > 3;) {
    i -= 3;
    s.insert(i, blank);
  }
  return s;
}

}  // namespace

Column Column::text(std::string heading, std::string json_key) {
  Column out(std::move(heading), {}, std::move(json_key));
  out.align = Align::kLeft;
  return out;
}

Column Column::data(std::string json_key) {
  Column out("", {}, std::move(json_key));
  out.shown = false;
  return out;
}

Cell Cell::markup(std::string text, std::string code) {
  Cell out(std::move(text));
  out.html = std::move(code);
  return out;
}

std::string Table::text(std::string_view indent) const {
  std::vector<std::vector<std::string>> lines(rows.size() + 1);  // headings first
  std::vector<std::size_t> widths;
  std::vector<Align> aligns;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (!columns[k].shown) continue;
    lines[0].push_back(heading(columns[k]));
    for (std::size_t r = 0; r < rows.size(); ++r)
      lines[r + 1].push_back(printable(shown_text(cell_of(rows[r], k), columns[k].form)));
    std::size_t width = 0;
    for (const auto& line : lines) width = std::max(width, characters(line.back()));
    widths.push_back(width);
    aligns.push_back(columns[k].align);
  }
  std::vector<std::string> rule;
  for (const std::size_t width : widths) rule.emplace_back(width, '-');
  lines.insert(lines.begin() + 1, std::move(rule));
  std::string out = caption.empty() ? "" : caption + "\n";
  for (const auto& line : lines) {
    std::string joined(indent);
    for (std::size_t k = 0; k < line.size(); ++k)
      joined += (k ? "  " : "") + in_width(line[k], widths[k], aligns[k]);
    joined.erase(joined.find_last_not_of(' ') + 1);
    out += joined + "\n";
  }
  return out;
}

std::string Table::html() const {
  const bool sentences =
      std::ranges::all_of(columns, [](const Column& c) { return !c.shown || c.align == Align::kLeft; });
  std::string out = fmt::format("<div class=\"scroll\"><table{}>\n<caption>{}</caption>\n<thead><tr>",
                                sentences ? " class=\"sentences\"" : "", markup_escaped(caption));
  for (const Column& c : columns)
    if (c.shown) out += "<th scope=\"col\">" + markup_escaped(heading(c)) + "</th>";
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : rows) {
    out += "<tr>";
    bool first = true;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (!columns[k].shown) continue;
      out += fmt::format("{}{}{}", first ? "<th scope=\"row\">" : "<td>",
                         html_of(cell_of(row, k), columns[k].form), first ? "</th>" : "</td>");
      first = false;
    }
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

Json Table::json() const {
  Json list = Json::array();
  for (const auto& row : rows) {
    Json object = Json::object();
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const Cell& cell = cell_of(row, k);
      const bool left_out = !columns[k].shown && std::holds_alternative<std::monostate>(cell.value);
      if (!columns[k].key.empty() && !left_out) object[columns[k].key] = cell_json(cell);
    }
    list.push_back(std::move(object));
  }
  return list;
}

Json Table::json_document() const {
  Json headings = Json::array(), lists = Json::array();
  for (const Column& c : columns) headings.push_back(heading(c));
  for (const auto& row : rows) {
    lists.push_back(Json::array());
    for (std::size_t k = 0; k < columns.size(); ++k) lists.back().push_back(cell_json(cell_of(row, k)));
  }
  return {{"caption", caption}, {"columns", headings}, {"rows", lists}};
}

std::string Table::csv() const {
  std::string out;
  const auto put_line = [&](const auto& field) {
    std::size_t fields = 0;
    for (std::size_t k = 0; k < columns.size(); ++k)
      if (!columns[k].key.empty()) out += (fields++ ? "," : "") + field(k);
    out += "\n";
  };
  put_line([&](std::size_t k) { return csv_field(columns[k].key); });
  for (const auto& row : rows) put_line([&](std::size_t k) { return csv_field(cell_of(row, k)); });
  return out;
}

std::string grouped(std::uint64_t value) { return in_groups(value, " "); }

std::string thin_grouped(std::uint64_t value) {
  return in_groups(value, "\xe2\x80\xaf");  // narrow no-break space
}

std::string shortest(double value, int digits) {
  const double size = value < 0 ? -value : value;
  if (size >= 1000 && size < 1e9) return fmt::format("{:.0f}", value);
  return fmt::format("{:.{}g}", value, digits);
}

std::string fixed(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string percent(double share, int digits) { return fixed(100 * share, digits); }

std::string kilobytes(std::uint64_t bytes) { return fixed(static_cast<double>(bytes) / 1e3, 1); }

std::string format_bytes(std::uint64_t bytes) {
  constexpr const char* kUnits[] = {"B", "kB", "MB", "GB"};
  auto size = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (size >= 999.5 && unit < 3) size /= 1000, ++unit;
  return fmt::format("{:.3g} {}", size, kUnits[unit]);
}

std::string printable(const std::string& text) {
  std::string out;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t n = utf8_character_bytes(rest);
    const auto first = static_cast<unsigned char>(rest[0]);
    const bool control = n == 1 ? first < 0x20 || first == 0x7f
                                : n == 2 && first == 0xc2 && static_cast<unsigned char>(rest[1]) < 0xa0;
    if (n == 0 || control)
      out += n == 2 ? "??" : "?";
    else
      out += rest.substr(0, n);
    rest.remove_prefix(n == 0 ? 1 : n);
  }
  return out;
}

}  // namespace texmesh
