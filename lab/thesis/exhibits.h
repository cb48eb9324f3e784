#pragma once

#include "pipeline/io/table.h"
#include "stages/base/run_context.h"
#include "tools/publish/pages/page.h"

namespace texmesh {

// A table or figure of the thesis, measured again: the printed values beside ours, and a verdict.

/// kNotComparable: the thesis's data are not printed, so that only its form can be shown.
enum class Verdict : std::uint8_t { kConfirmed, kInPart, kNotConfirmed, kNotComparable };
template <>
struct EnumNames<Verdict> {
  static constexpr std::array<std::string_view, 4> names{"confirmed", "in part", "not confirmed",
                                                         "not comparable"};
};

/// Neither: in part.
inline Verdict verdict_of(bool confirmed, bool not_confirmed) {
  return confirmed ? Verdict::kConfirmed : not_confirmed ? Verdict::kNotConfirmed : Verdict::kInPart;
}

/// A picture that stands in a file beside the page.
struct ExhibitPicture {
  std::string file, caption;
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint8_t> png;
};

struct Exhibit {
  std::string id;             // "4.2", "fig-3.9"
  std::string title;          // plain text, as all texts here
  std::string claim;          // what the thesis prints or says
  std::string made_by;        // what was run on which data
  std::vector<Table> tables;  // the first column names the row
  Verdict verdict = Verdict::kNotComparable;
  std::string finding = {};  // what came out, with figures
  std::vector<Plot> plots = {};
  std::vector<ExhibitPicture> pictures = {};
};

/// Columns of numbers that show so many digits behind the point.
void add_columns(Table& table, int digits, std::initializer_list<const char*> names);
inline constexpr const char* kLineColours[] = {"a", "b", "c", "d", "e"};
/// A plot without lines.
Plot empty_plot(std::string title, std::string x_name, std::string y_name, double x_low, double x_high,
                bool linear_x);
/// The vertical axis reaches what the line shows.
void add_line(PlotSeries line, Plot& plot);

/// The page: summary of verdicts, then an exhibit a section.
std::string exhibits_html(const std::vector<Exhibit>& exhibits);
/// {"version":1,"exhibits":[..]}: numbers in full, no plots and pictures.
nlohmann::ordered_json exhibits_json(const std::vector<Exhibit>& exhibits);
/// For a terminal.
std::string exhibit_text(const Exhibit& exhibit);

// Every exhibit is made from models, pictures and links that are made by code, by the stages and the delivery
// themselves. Same result for any thread count and on any machine.

std::vector<Exhibit> scale_exhibits(const RunContext& context);       // Table 2.1, Figs. 2.2, 6.2
std::vector<Exhibit> fragment_exhibits(const RunContext& context);    // Table 3.1, Figs. 3.5 to 3.8
std::vector<Exhibit> quality_exhibits(const RunContext& context);     // Fig. 3.9
std::vector<Exhibit> transfer_exhibits(const RunContext& context);    // Tables 4.1, 4.2, Figs. 4.3 to 4.7
std::vector<Exhibit> perceptual_exhibits(const RunContext& context);  // Tables 7.1, 7.2, 7.3
std::vector<Exhibit> predictor_exhibits(const RunContext& context);   // Figs. 8.2 to 8.5

/// Exhibits that are made together.
struct ExhibitGroup {
  std::vector<std::string> ids;
  std::vector<Exhibit> (*make)(const RunContext& context);
};
/// All of them, in the thesis's order of chapters.
std::span<const ExhibitGroup> exhibit_groups();
/// Those with one of these ids, or all for none.
std::vector<Exhibit> make_exhibits(const std::vector<std::string>& ids, const RunContext& context);

}  // namespace texmesh
