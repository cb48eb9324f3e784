#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/io/number_text.h"

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

/// Text of a package for a terminal: control characters and invalid UTF-8 become '?'.
std::string printable(std::string_view text);

}  // namespace texmesh
