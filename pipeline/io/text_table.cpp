#include "pipeline/io/text_table.h"

#include <fmt/format.h>

#include <algorithm>

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

/// Bytes of the valid UTF-8 sequence that starts at `at`, 0 when there is none.
std::size_t sequence_bytes(const std::string& s, std::size_t at) {
  const auto byte = [&](std::size_t i) { return i < s.size() ? static_cast<unsigned char>(s[i]) : 0u; };
  const unsigned lead = byte(at);
  const std::size_t n = lead < 0x80                   ? 1
                        : lead >= 0xc2 && lead < 0xe0 ? 2
                        : (lead & 0xf0) == 0xe0       ? 3
                        : lead >= 0xf0 && lead < 0xf5 ? 4
                                                      : 0;
  for (std::size_t i = 1; i < n; ++i)
    if ((byte(at + i) & 0xc0) != 0x80) return 0;
  // Overlong forms, surrogates and values above U+10FFFF show in the second byte; C1 controls are control
  // characters.
  const unsigned second = byte(at + 1);
  if ((lead == 0xc2 && second < 0xa0) || (lead == 0xe0 && second < 0xa0) ||
      (lead == 0xed && second >= 0xa0) || (lead == 0xf0 && second < 0x90) || (lead == 0xf4 && second >= 0x90))
    return 0;
  return n;
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

std::string grouped(std::uint64_t value) {
  std::string s = std::to_string(value);
  for (std::size_t i = s.size(); i > 3;) {
    i -= 3;
    s.insert(i, 1, ' ');
  }
  return s;
}

std::string shortest(double value, int digits) {
  const double size = value < 0 ? -value : value;
  if (size >= 1000 && size < 1e9) return fmt::format("{:.0f}", value);
  return fmt::format("{:.{}g}", value, digits);
}

std::string fixed(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string kilobytes(std::uint64_t bytes) { return fixed(static_cast<double>(bytes) / 1e3, 1); }

std::string printable(const std::string& text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t n = sequence_bytes(text, at);
    const bool control = n == 1 && (static_cast<unsigned char>(text[at]) < 0x20 || text[at] == 0x7f);
    out += n == 0 || control ? std::string("?") : text.substr(at, n);
    at += n == 0 ? 1 : n;
  }
  return out;
}

}  // namespace texmesh
