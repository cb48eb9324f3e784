#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace texmesh {

/// What judges compare (thesis 7.3): ellipsoids of other sizes, irregular quadrics of another depth, scales
/// of a package.
enum class StimulusKind : std::uint8_t { kEllipsoids, kQuadrics, kMesh };
inline constexpr std::array<std::string_view, 3> kStimulusKinds{"ellipsoids", "quadrics", "mesh"};
inline std::string_view name_of(StimulusKind kind) { return kStimulusKinds[static_cast<std::size_t>(kind)]; }

/// The change of catch trials, which everybody who looks can see.
inline constexpr double kCatchLevel = 0.45;
inline constexpr double kLeastLevel = 0.001, kMostLevel = 1;
inline constexpr std::size_t kMostLevels = 20, kMostSizes = 6;
/// Where a moved object stands (6.2: 0 to -20): each place shows it 2^(1/5) smaller than the one before.
inline constexpr std::size_t kPlaces = 21, kPlacesAnOctave = 5;
inline constexpr int kMostObjects = 40, kMostRepeats = 60, kMostCatches = 60;
inline constexpr std::uint32_t kMostTrials = 5000;

struct ExperimentOptions {
  StimulusKind kind = StimulusKind::kQuadrics;
  std::string title, consent;  // plain text
  std::string post_url;        // "" = results are not posted
  bool move = false;           // judges move one object until both look alike (6.2); one size, the nearest
  std::vector<double> sizes_px{160};
  std::vector<double> levels;  // rising; empty: those of the kind
  int objects = 6;             // ellipsoids or quadrics
  int repeats = 6;             // trials of each level and size
  int catches = 6;             // catch trials of each size
  int views = 8;               // around the object
  int orders = 8;              // of trials, for different judges
  double time_limit_s = 20, pause_s = 0.4;
  double pixels_per_degree = 40;  // of the picture, at the judge's eye
  std::uint64_t seed = 1;
};

struct ExperimentCondition {
  double displayed_px = 0;     // the object's largest extent
  std::uint32_t frame_px = 0;  // side of the picture
};

/// "Which of the two is the same as the reference?", or where the changed one looks like the reference.
struct ExperimentTrial {
  std::uint32_t condition = 0, object = 0;
  std::uint32_t level_index = 0;  // of the levels; their number for catch trials
  double level = 0;               // 0: catch trials of moves, whose object is unchanged
  bool is_catch = false;
  std::string reference, same, changed;  // files beneath stimuli/
  std::vector<std::string> moved;        // instead of the last two: at every place (condition)
};

/// design.json, which the page reads: lab/schemas/experiment-design.v1.schema.json.
struct ExperimentDesign {
  std::string id;  // 16 hexadecimal digits of the digest of all the rest
  ExperimentOptions options;
  std::string background;  // #rrggbb, around the objects
  std::vector<ExperimentCondition> conditions;
  std::vector<double> levels;
  std::vector<ExperimentTrial> trials;
  /// Each: every trial once, as 2 x trial + (1 where the unchanged one stands on the right, or where the
  /// moved one begins at the farthest place).
  std::vector<std::vector<std::uint32_t>> orders;
};

/// Trials and orders from the options; levels and conditions are those of `design`. In an order every level
/// of every size is asked once before any is asked again, catch trials are spread evenly, and of each level
/// and size half of the right answers stand on either side (of an odd number, one more on one of them). Names
/// of files are drawn: they tell nothing. Pure: the seed decides.
void plan_trials(ExperimentDesign& design);

/// Canonical JSON; sets the id.
std::string write_design(ExperimentDesign& design);

/// What the results of judges are compared with.
struct DesignKey {
  struct Trial {
    double displayed_px = 0, level = 0;
    bool is_catch = false;
  };
  std::string id, kind;
  std::vector<double> places_px;  // of moves; else empty
  std::vector<Trial> trials;
};
/// Reads a design.json. InputError {file, JSON pointer, ...} when it is none, or was changed after it was
/// made.
DesignKey read_design(std::span<const std::uint8_t> json, const std::string& file);

inline constexpr std::uint64_t kMaxResultsBytes = 2u << 20;

/// One choice of a judge.
struct ExperimentAnswer {
  std::uint32_t trial = 0;  // of the design
  double displayed_px = 0, level = 0;
  bool is_catch = false;
  bool same_on_right = false, chose_right = false;  // of moves: began, ended in the farther half
  std::uint32_t place = 0;                          // of moves: where it looks like the reference
  double seconds = 0;
  bool late = false;  // after the time limit
  bool right() const { return same_on_right == chose_right; }
  friend bool operator==(const ExperimentAnswer&, const ExperimentAnswer&) = default;
};

/// What the page has kept of one judge: lab/schemas/experiment-results.v1.schema.json.
struct ExperimentResults {
  std::string file;    // for reports
  std::string design;  // its id
  std::string kind, judge;
  std::uint32_t trials = 0;       // of the whole experiment
  std::vector<double> places_px;  // of moves: displayed sizes, falling; else empty
  std::vector<ExperimentAnswer> answers;
};

/// Strict: a field that is missing or unknown, a wrong type, a number out of range, and a trial answered
/// twice or beyond the experiment are an InputError {file, JSON pointer, ...}.
ExperimentResults read_results(std::span<const std::uint8_t> json, const std::string& file);

}  // namespace texmesh
