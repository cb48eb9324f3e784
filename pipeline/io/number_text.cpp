#include "pipeline/io/number_text.h"

#include <fmt/format.h>

namespace texmesh {
namespace {

std::string grouped_by(std::uint64_t value, const char* blank) {
  std::string s = std::to_string(value);
  for (std::size_t i = s.size(); i > 3;) s.insert(i -= 3, blank);
  return s;
}

}  // namespace

std::string format_bytes(std::uint64_t bytes) {
  constexpr const char* kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; value >= 999.5 && unit < 4; ++unit) value /= 1000;
  return fmt::format("{:.3g} {}", value, kUnits[unit]);
}

std::string format_seconds(double seconds) {
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const int s = static_cast<int>(seconds + .5);
  if (s < 3600) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} h {} min", s / 3600, s / 60 % 60);
}

std::string kilobytes(std::uint64_t bytes) { return fixed(static_cast<double>(bytes) / 1e3, 1); }

std::string grouped(std::uint64_t value) { return grouped_by(value, " "); }

std::string thin_grouped(std::uint64_t value) { return grouped_by(value, "\xe2\x80\xaf"); }

std::string shortest(double value, int digits) {
  const double size = value < 0 ? -value : value;
  if (size >= 1000 && size < 1e9) return fmt::format("{:.0f}", value);
  return fmt::format("{:.{}g}", value, digits);
}

std::string fixed(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

}  // namespace texmesh
