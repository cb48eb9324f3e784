#include "tools/cli/options/units.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "pipeline/io/names/closest_word.h"

namespace texmesh {
namespace {

constexpr double kMostBytes = 1e18, kMost_s = 1e6, kMostRate = 1e12;

/// The number that a text begins with; `end` is where it stops, 0 when there is none.
double leading_number(const std::string& text, std::size_t& end) {
  try {
    return std::stod(text, &end);
  } catch (const std::exception&) {
    end = 0;
    return 0;
  }
}

double parse(const std::string& text, const std::string& flag, const std::map<std::string, double>& units,
             const char* expected, double most) {
  std::size_t end = 0;
  const double v = leading_number(text, end);
  const std::size_t begin = std::min(text.find_first_not_of(' ', end), text.size());
  const auto unit = units.find(text.substr(end == 0 ? 0 : begin));
  if (end == 0 || unit == units.end() || !(v >= 0 && v * unit->second <= most))
    throw UsageError(flag, "", expected, text);
  return v * unit->second;
}

}  // namespace

std::string number_fault(const std::string& text, double least, double most) {
  std::size_t end = 0;
  const double v = leading_number(text, end);
  if (end > 0 && end == text.size() && v >= least && v <= most) return "";
  return fmt::format("expected a number from {:g} to {:g}, found {}", least, most, text);
}

std::string choice_fault(std::string& word, const std::vector<std::string>& words) {
  const auto found = std::ranges::find(words, in_lower_case(word), in_lower_case);
  if (found == words.end())
    return fmt::format("expected one of {}, found {}{}", fmt::join(words, ", "), word,
                       meant_instead(word, words));
  word = *found;
  return "";
}

std::uint64_t parse_bytes(const std::string& text, const std::string& flag) {
  static const std::map<std::string, double> kUnits{{"", 1},
                                                    {"b", 1},
                                                    {"k", 1e3},
                                                    {"kb", 1e3},
                                                    {"m", 1e6},
                                                    {"mb", 1e6},
                                                    {"g", 1e9},
                                                    {"gb", 1e9},
                                                    {"t", 1e12},
                                                    {"tb", 1e12},
                                                    {"kib", 1024},
                                                    {"mib", 1048576.0},
                                                    {"gib", 1073741824.0},
                                                    {"tib", 1099511627776.0}};
  try {  // nobody means bits by the size of a file
    return static_cast<std::uint64_t>(parse(in_lower_case(text), flag, kUnits, "", kMostBytes));
  } catch (const UsageError&) {
    throw UsageError(flag, "", "a size such as 500kB, 500MB or 8GiB", text);
  }
}

std::uint64_t parse_some_bytes(const std::string& text, const std::string& flag) {
  const std::uint64_t bytes = parse_bytes(text, flag);
  if (bytes == 0) throw UsageError(flag, "", "a number above 0", text);
  return bytes;
}

std::int64_t parse_seconds(const std::string& text, const std::string& flag) {
  static const std::map<std::string, double> kUnits{
      {"", 1}, {"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86400}};
  return static_cast<std::int64_t>(parse(text, flag, kUnits, "a time such as 90d, 12h or 30min", kMostBytes));
}

double parse_duration(const std::string& text, const std::string& flag) {
  static const std::map<std::string, double> kUnits{{"", 1}, {"s", 1}, {"sec", 1}, {"ms", 1e-3}, {"min", 60}};
  return parse(text, flag, kUnits, "a time such as 4, 1.5s or 250ms, at most 1e6 s", kMost_s);
}

double parse_bandwidth(const std::string& text, const std::string& flag) {
  static const std::map<std::string, double> kUnits{
      {"B/s", 1},         {"kB/s", 1e3},       {"MB/s", 1e6},       {"GB/s", 1e9},      {"KiB/s", 1024},
      {"kbit", 1e3 / 8},  {"mbit", 1e6 / 8},   {"gbit", 1e9 / 8},   {"kbps", 1e3 / 8},  {"Mbps", 1e6 / 8},
      {"Gbps", 1e9 / 8},  {"kb/s", 1e3 / 8},   {"Mb/s", 1e6 / 8},   {"Gb/s", 1e9 / 8},  {"MiB/s", 1048576},
      {"bit/s", 1 / 8.0}, {"kbit/s", 1e3 / 8}, {"mbit/s", 1e6 / 8}, {"gbit/s", 1e9 / 8}};
  const std::string lower = in_lower_case(text);
  try {
    const bool bits = lower.find("bit") != lower.npos;  // of which nobody means thousandths
    const double v = parse(bits ? lower : text, flag, kUnits, "", kMostRate);
    if (v > 0) return v;
  } catch (const UsageError&) {
    throw UsageError(flag, "", "a rate such as 2Mbit/s or 41.68kB/s, at most 1e12 B/s", text);
  }
  throw UsageError(flag, "", "a rate above 0", text);
}

}  // namespace texmesh
