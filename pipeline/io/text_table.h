#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace texmesh {

enum class Align : std::uint8_t { kLeft, kRight };

/// A table in plain text for people: columns as wide as their widest cell, two blanks between them, numbers
/// to the right, no blanks at line ends. Widths count UTF-8 code points.
class TextTable {
 public:
  explicit TextTable(std::string indent = "  ") : indent_(std::move(indent)) {}
  void column(std::string header, Align align = Align::kRight) {
    columns_.push_back({std::move(header), align});
  }
  void row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  /// Header, rule, rows. Cells that a row lacks are empty.
  std::string text() const;

 private:
  struct Column {
    std::string header;
    Align align;
  };
  std::string indent_;
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// 1234567 -> "1 234 567"; thin groups of three so that columns of bytes can be read.
std::string grouped(std::uint64_t value);
/// `digits` significant digits, no exponent between 1e-4 and 1e9, no trailing zeros: 0.01235, 153.2, 1e+09.
std::string shortest(double value, int digits = 4);
/// `digits` digits after the point.
std::string fixed(double value, int digits);
/// Thousands of bytes, one digit after the point.
std::string kilobytes(std::uint64_t bytes);
/// Text of a package for a terminal: control characters and invalid UTF-8 become '?'.
std::string printable(const std::string& text);

}  // namespace texmesh
