#pragma once
#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "format/base/fields.h"
#include "tools/publish/pages/plot.h"

namespace texmesh {

// A table or figure of the thesis, measured again: the printed values beside ours, and a verdict.

/// kNotComparable: the thesis's data are not printed, so that only its form can be shown.
enum class Verdict : std::uint8_t { kConfirmed, kInPart, kNotConfirmed, kNotComparable };
template <>
struct EnumNames<Verdict> {
  static constexpr std::array<std::string_view, 4> names{"confirmed", "in part", "not confirmed",
                                                         "not comparable"};
};

/// Nothing, a number, or plain text.
using ExhibitCell = std::variant<std::monostate, double, std::string>;
struct ExhibitColumn {
  std::string name;
  int digits = 2;  // of numbers, after the point
};
struct ExhibitTable {
  std::string caption;
  std::vector<ExhibitColumn> columns;          // the first names the row
  std::vector<std::vector<ExhibitCell>> rows;  // as many cells as columns
};
/// A picture that stands in a file beside the page.
struct ExhibitPicture {
  std::string file, caption;
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint8_t> png;
};

struct Exhibit {
  std::string id;       // "4.2", "fig-3.9"
  std::string title;    // plain text, as all texts here
  std::string claim;    // what the thesis prints or says
  std::string made_by;  // what was run on which data
  std::vector<ExhibitTable> tables;
  std::vector<Plot> plots;
  std::vector<ExhibitPicture> pictures;
  Verdict verdict = Verdict::kNotComparable;
  std::string finding;  // what came out, with figures
};

/// The page: summary of verdicts, then an exhibit a section.
std::string exhibits_html(const std::vector<Exhibit>& exhibits);
/// {"version":1,"exhibits":[..]}: numbers in full, no plots and pictures.
nlohmann::ordered_json exhibits_json(const std::vector<Exhibit>& exhibits);
/// For a terminal.
std::string exhibit_text(const Exhibit& exhibit);

}  // namespace texmesh
