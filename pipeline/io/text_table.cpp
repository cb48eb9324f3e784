#include "pipeline/io/text_table.h"

#include <algorithm>

#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

std::size_t width_of(const std::string& s) {
  return static_cast<std::size_t>(
      std::count_if(s.begin(), s.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

void put_cell(std::string& line, const std::string& cell, std::size_t width, Align align) {
  const std::string blanks(width - std::min(width, width_of(cell)), ' ');
  line += align == Align::kRight ? blanks + cell : cell + blanks;
}

}  // namespace

std::string TextTable::text() const {
  std::vector<std::size_t> widths;
  for (const Column& c : columns_) widths.push_back(width_of(c.header));
  for (const auto& row : rows_)
    for (std::size_t k = 0; k < std::min(row.size(), widths.size()); ++k)
      widths[k] = std::max(widths[k], width_of(row[k]));
  std::string out;
  const auto put_line = [&](const auto& cell_of) {
    std::string line = indent_;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      if (k) line += "  ";
      put_cell(line, cell_of(k), widths[k], columns_[k].align);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  };
  put_line([&](std::size_t k) { return columns_[k].header; });
  put_line([&](std::size_t k) { return std::string(widths[k], '-'); });
  for (const auto& row : rows_)
    put_line([&](std::size_t k) { return k < row.size() ? row[k] : std::string(); });
  return out;
}

std::string printable(std::string_view text) {
  const auto is_control = [](std::string_view character) {
    const auto at = [&](std::size_t i) { return static_cast<unsigned char>(character[i]); };
    return character.size() == 1 ? at(0) < 0x20 || at(0) == 0x7f
                                 : at(0) == 0xc2 && at(1) < 0xa0;  // the C1 controls
  };
  std::string out;
  while (!text.empty()) {
    const std::size_t n = utf8_bytes(text), taken = std::max<std::size_t>(n, 1);
    if (n == 0 || is_control(text.substr(0, n)))
      out.append(taken, '?');
    else
      out += text.substr(0, n);
    text.remove_prefix(taken);
  }
  return out;
}

}  // namespace texmesh
