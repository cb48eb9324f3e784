#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

namespace texmesh {

enum class Align : std::uint8_t { kLeft, kRight };

/// How people see the numbers of a column. JSON and CSV have them in full, and not multiplied.
struct NumberForm {
  enum class Kind : std::uint8_t { kFixed, kGrouped, kShortest };
  Kind kind = Kind::kFixed;
  int digits = 0;                // behind the point; significant ones with kShortest
  double factor = 1;             // the number is shown times this
  std::string_view before = {};  // text that lives for ever, in front of the number
  // NOLINTNEXTLINE: a number of digits behind the point is a form.
  constexpr NumberForm(int digits_behind_point = 0) : digits(digits_behind_point) {}
  constexpr NumberForm(Kind form, int form_digits, double form_factor = 1, std::string_view in_front = {})
      : kind(form), digits(form_digits), factor(form_factor), before(in_front) {}
};
inline constexpr NumberForm kGrouped{NumberForm::Kind::kGrouped, 0};  // 1 234 567
inline constexpr NumberForm kShortest{NumberForm::Kind::kShortest, 4};
inline constexpr NumberForm kKilobytes{NumberForm::Kind::kFixed, 1, 1e-3};  // of bytes
inline constexpr NumberForm kScaleName{NumberForm::Kind::kFixed, 0, 1, "S_"};
constexpr NumberForm percent_form(int digits = 1) { return {NumberForm::Kind::kFixed, digits, 100}; }
constexpr NumberForm shortest_form(int digits) { return {NumberForm::Kind::kShortest, digits}; }

/// A column of a Table.
struct Column {
  std::string name;       // the heading, plain text
  NumberForm form = {};   // of its numbers
  std::string key = {};   // the member of a row in JSON, and the heading in CSV; "" = in neither
  std::string unit = {};  // stands in the heading: "name [unit]"
  Align align = Align::kRight;
  bool shown = true;  // to people: in text and HTML

  // NOLINTBEGIN: headings make columns.
  Column(std::string heading, NumberForm numbers = {}, std::string json_key = {}, std::string of_unit = {})
      : name(std::move(heading)), form(numbers), key(std::move(json_key)), unit(std::move(of_unit)) {}
  Column(const char* heading) : name(heading) {}
  // NOLINTEND
  /// A column of texts, to the left.
  static Column text(std::string heading, std::string json_key = {});
  /// A column of JSON and CSV alone. JSON leaves out the member of an empty cell.
  static Column data(std::string json_key);
};

/// What stands in a table: nothing, a truth (people see "yes" or nothing), a number, or a text.
struct Cell {
  std::variant<std::monostate, bool, std::int64_t, std::uint64_t, double, std::string> value;
  std::optional<std::string> shown = {};  // what people see in the value's place; plain text
  std::string html = {};                  // what HTML has in the value's place; "" = what people see

  Cell() = default;
  // NOLINTBEGIN: every value is a cell.
  template <class T>
  requires std::is_arithmetic_v<T> Cell(T number) {
    if constexpr (std::is_same_v<T, bool>)
      value = number;
    else if constexpr (std::is_floating_point_v<T>)
      value = static_cast<double>(number);
    else if constexpr (std::is_signed_v<T>)
      value = static_cast<std::int64_t>(number);
    else
      value = static_cast<std::uint64_t>(number);
  }
  Cell(std::string text) : value(std::move(text)) {}
  Cell(std::string_view text) : value(std::string(text)) {}
  Cell(const char* text) : value(std::string(text)) {}
  template <class T>
  Cell(const std::optional<T>& maybe) : Cell(maybe ? Cell(*maybe) : Cell()) {}
  // NOLINTEND
  /// A value that people see as `text`.
  template <class T>
  Cell(T of_value, std::string text) : Cell(std::move(of_value)) {
    shown = std::move(text);
  }
  /// A text that is `code` in HTML.
  static Cell markup(std::string text, std::string code);
};

/// A table: as plain text for a terminal, as HTML for a page, as JSON and CSV for programs. Texts may come
/// from strangers: control characters do not reach a terminal, and HTML has them escaped.
struct Table {
  std::string caption = {};  // plain text; "" = none
  std::vector<Column> columns = {};
  std::vector<std::vector<Cell>> rows = {};  // cells that a row lacks are empty

  Table() = default;
  Table(std::string of_caption, std::vector<Column> of_columns, std::vector<std::vector<Cell>> of_rows = {})
      : caption(std::move(of_caption)), columns(std::move(of_columns)), rows(std::move(of_rows)) {}
  void column(Column c) { columns.push_back(std::move(c)); }
  void row(std::vector<Cell> cells) { rows.push_back(std::move(cells)); }
  template <class T>
  requires std::is_same_v<T, std::vector<std::string>>
  void row(T cells) { rows.emplace_back(cells.begin(), cells.end()); }

  /// Caption, heading, rule, rows: columns as wide as their widest cell, two blanks between them, no blanks
  /// at line ends. Widths count UTF-8 code points.
  std::string text(std::string_view indent = "  ") const;
  /// In a box that scrolls. The first column holds row headers. A table of texts alone breaks them into
  /// lines.
  std::string html() const;
  /// A list of objects with a member for every column that has a key. Empty cells that people see are null.
  nlohmann::ordered_json json() const;
  /// {"caption", "columns", "rows"}: headings, and lists of cells.
  nlohmann::ordered_json json_document() const;
  /// RFC 4180 with line feeds: a heading, then the rows, of the columns with a key.
  std::string csv() const;
};

/// 1234567 -> "1 234 567"; thin groups of three so that columns of bytes can be read.
std::string grouped(std::uint64_t value);
/// The same for HTML, with thin blanks that do not break.
std::string thin_grouped(std::uint64_t value);
/// `digits` significant digits, no exponent between 1e-4 and 1e9, no trailing zeros: 0.01235, 153.2, 1e+09.
std::string shortest(double value, int digits = 4);
/// `digits` digits after the point.
std::string fixed(double value, int digits);
/// 100 times a share, `digits` digits after the point; without the sign.
std::string percent(double share, int digits = 1);
/// Thousands of bytes, one digit after the point.
std::string kilobytes(std::uint64_t bytes);
/// "12 B", "340 kB", "1.23 MB": at most three digits, decimal units.
std::string format_bytes(std::uint64_t bytes);
/// Text of a package for a terminal: control characters and invalid UTF-8 become '?'.
std::string printable(const std::string& text);

}  // namespace texmesh
