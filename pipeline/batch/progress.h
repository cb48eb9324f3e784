#pragma once
#include <chrono>
#include <iosfwd>
#include <map>

#include "pipeline/compile/workers/worker.h"

namespace texmesh {

enum class OutputMode : std::uint8_t { kTerminal, kPlain, kJson, kQuiet };

struct ProgressModel {
  std::string_view name;  // of a text that lives longer than the progress
  double weight = 1;      // expected seconds; 0 for what need not run
};

/// What a user sees of a compile run: one bar for the whole run that redraws itself on a terminal, plain
/// lines in a pipe, or one JSON event a line (schemas/event.v1.schema.json). Errors and warnings are shown
/// in every mode.
class Progress {
 public:
  /// `explain`: say of every stage why it runs. Otherwise what stages tell of that becomes a line a model,
  /// by foreseen().
  Progress(std::ostream& out, OutputMode mode, bool verbose, bool explain);

  void begin(std::vector<ProgressModel> models);
  /// The model need not run.
  void recalled(std::size_t model, const WorkerReport& report, const std::string& output);
  void started(std::size_t model, const std::string& output);
  void event(std::size_t model, WorkerEvent event);
  /// Something about the cache that no single model has met.
  void cache_event(const std::string& code, const std::string& text);
  void finished(std::size_t model, const WorkerReport& report, const std::string& output);
  /// `stale`: packages that no model makes any more, paths within the output folder.
  void summary(const std::vector<WorkerReport>& reports, double seconds,
               const std::vector<std::string>& stale, bool removed);
  /// `failed`: of the models that would not run.
  void forecast_summary(std::size_t to_look_at, std::size_t models, std::size_t failed,
                        const std::vector<std::string>& stale);
  /// A forecast has told all of the model's stages.
  void foreseen(std::size_t model);

 private:
  struct Running {
    std::string stage;
    std::chrono::steady_clock::time_point start;
    double fraction = 0;                    // of its weight: stages that are done
    std::map<std::string, double> partial;  // and of stages that are not: how far they are
    std::map<std::string, double> shares;   // of its weight, by stage
  };
  struct Forecast {
    std::size_t hits = 0, running = 0, waiting = 0;  // stages
    std::string text, last_why;
  };
  void foresee(std::size_t model, const StageExplained& e);
  void tell_again(std::size_t model, const Notes& notes);
  // Of one event, for people.
  void show(std::size_t model, const StageStarted& e);
  void show(std::size_t model, const StageProgress& e);
  void show(std::size_t model, const StageFinished& e);
  void show(std::size_t model, const StageExplained& e);
  void tell_stale(const std::vector<std::string>& stale, const char* what);
  void show(std::size_t model, const CacheTold& e);
  void show(std::size_t model, const NoteTold& e);
  void show(std::size_t model, const ErrorTold& e);
  template <class Other>
  void show(std::size_t, const Other&) {}
  template <class Event>
  void write_event(const Event& event);
  std::string name_of(std::size_t model) const { return std::string(models_[model].name); }
  void line(const std::string& text);  // a lasting line
  void redraw(bool now);
  double done_fraction() const;
  std::string recalled_text(std::ptrdiff_t recalled, std::size_t models) const;
  std::string eta() const;
  std::string slowest() const;

  std::ostream& out_;
  OutputMode mode_;
  bool verbose_, explain_;
  std::vector<ProgressModel> models_;
  std::map<std::size_t, Running> running_;
  std::size_t finished_count_ = 0, told_again_ = 0;
  std::map<std::size_t, Forecast> forecasts_;
  std::map<std::string, std::size_t> cache_events_;  // by text: the same one from many models is told once
  double done_weight_ = 0, total_weight_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), drawn_;
};

std::string format_seconds(double seconds);  // "3.4 s", "2 min 10 s"

/// "ladder.rungs: [5,8] -> [8]"; digests shortened.
std::string describe_change(const std::string& part, const std::string& from, const std::string& to);

}  // namespace texmesh
