#include "pipeline/batch/progress.h"

#include <sys/ioctl.h>

#include <fmt/format.h>

#include <ostream>

#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/compile/options.h"
#include "pipeline/import/import.h"
#include "pipeline/io/table.h"

namespace texmesh {
namespace {

/// Columns of the terminal behind standard output; 80 where nobody knows.
std::size_t terminal_columns() {
  winsize size{};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

/// The end of a UTF-8 text that takes at most so many columns, "..." in front where something is missing.
std::string last_columns(const std::string& text, std::size_t columns) {
  const auto begins = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; };
  if (static_cast<std::size_t>(std::count_if(text.begin(), text.end(), begins)) <= columns) return text;
  if (columns < 4) return "";
  std::size_t at = text.size();
  for (std::size_t left = columns - 3; at > 0 && left > 0; --left) {
    do --at;
    while (at > 0 && !begins(text[at]));
  }
  return "..." + text.substr(at);
}

/// "runs: ladder.rungs [5,8] -> [8]" and the like.
std::string verdict(const StageExplanation& e) {
  if (e.verdict == StageVerdict::kHit) return "from the cache";
  if (e.verdict == StageVerdict::kUnknown) return "depends on what becomes of " + e.waits_for;
  if (!e.has_history) return "runs: no earlier run of it is known";
  if (e.changes.empty()) return "runs: nothing has changed, but its result is no longer in the cache";
  std::string text;
  for (const KeyChange& c : e.changes)
    text += (text.empty() ? "runs: " : "; ") + describe_change(c.label, c.from, c.to);
  return text;
}

/// The error as all other lines name the model: with its folder, and before the name of a file of its own.
std::string error_line(std::string_view named, const std::string& message) {
  const std::string model(named);
  const std::size_t file = model.rfind('/') + 1;
  if (message.starts_with(model + ":")) return "error: " + message;
  const bool names_it = message.starts_with(model.substr(file) + ":");
  return "error: " + (names_it ? model.substr(0, file) : model + ": ") + message;
}

}  // namespace

std::string format_seconds(double seconds) {
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const int s = static_cast<int>(seconds + .5);
  if (s < 3600) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} h {} min", s / 3600, s / 60 % 60);
}

std::string describe_change(const std::string& part, const std::string& from, const std::string& to) {
  const auto shorten = [&](const std::string& value) -> std::string {
    if (value.empty()) return "nothing";
    if (part.starts_with("input ") && value.size() > 65 && value[64] == ' ')
      return value.substr(0, 8) + " (" + value.substr(65) + " bytes)";
    return value.size() > 60 ? value.substr(0, 57) + "..." : value;
  };
  const std::string name = part.starts_with("option ") ? part.substr(7) : part;
  return name + " " + shorten(from) + " -> " + shorten(to);
}

Progress::Progress(std::ostream& out, OutputMode mode, bool verbose, bool explain)
    : out_(out), mode_(mode), verbose_(verbose), explain_(explain) {}

void Progress::begin(std::vector<ProgressModel> models) {
  models_ = std::move(models);
  for (const ProgressModel& m : models_) total_weight_ += m.weight;
}

void Progress::recalled(std::size_t model, const WorkerReport& r, const std::string& output) {
  if (const ModelError& e = r.more->error; !e.message.empty()) {
    if (mode_ == OutputMode::kJson)
      write_event(ErrorTold{name_of(model), e});
    else
      line(error_line(models_[model].name, e.message) +
           " (nothing has changed since; --retry-failed tries again)");
  }
  tell_again(model, r.more->told);
  const bool alone = models_.size() == 1;
  ++finished_count_;
  if (mode_ == OutputMode::kJson || (r.ok() && mode_ != OutputMode::kQuiet && (verbose_ || alone))) {
    --finished_count_;
    finished(model, r, output);
  }
}

/// What the run that made the package has warned of: it still holds.
void Progress::tell_again(std::size_t model, const Notes& notes) {
  constexpr std::size_t kMost = 10;  // models
  if (notes.empty()) return;
  if (mode_ == OutputMode::kJson) {
    for (const Note& n : notes) write_event(NoteTold{name_of(model), n});
    return;
  }
  if (++told_again_ > kMost && !verbose_) return;
  const auto warnings = std::ranges::count(notes, Severity::kWarning, &Note::severity);
  if (mode_ == OutputMode::kQuiet && warnings == 0) return;
  for (std::size_t i = 0; i < (verbose_ ? notes.size() : 1); ++i)
    line(fmt::format("{}: {}, still: {}{}", models_[model].name, warnings > 0 ? "warning" : "note",
                     note_sentence(notes[i]),
                     !verbose_ && notes.size() > 1 ? fmt::format(" (and {} more)", notes.size() - 1) : ""));
}

template <class Event>
void Progress::write_event(const Event& event) {
  out_ << to_json_line(event) << '\n';
}

void Progress::started(std::size_t model, const std::string& output) {
  running_[model].start = std::chrono::steady_clock::now();
  if (mode_ != OutputMode::kJson) return;
  write_event(ModelStarted{name_of(model), output});
  out_ << std::flush;
}

void Progress::event(std::size_t model, WorkerEvent event) {
  if (auto* told = std::get_if<SharesTold>(&event)) {
    running_[model].shares = std::move(told->shares);
    return;
  }
  std::visit(
      [&](auto& e) {
        e.model = name_of(model);
        if (mode_ == OutputMode::kJson)
          write_event(e);
        else
          show(model, e);
      },
      event);
  if (mode_ == OutputMode::kJson)
    out_ << std::flush;
  else
    redraw(false);
}

void Progress::show(std::size_t model, const StageStarted& e) { running_[model].stage = e.stage; }

void Progress::show(std::size_t model, const StageProgress& e) {
  Running& running = running_[model];
  running.partial[e.stage] = running.shares[e.stage] * models_[model].weight * e.fraction;
}

void Progress::show(std::size_t model, const StageFinished& e) {
  const double part = running_[model].shares[e.stage] * models_[model].weight;
  running_[model].partial.erase(e.stage);
  running_[model].fraction += part;
  done_weight_ += part;
  if (verbose_ && e.result == "ran")
    line(fmt::format("{}: {} took {}", e.model, e.stage, format_seconds(e.seconds)));
  else if (verbose_ && !explain_)
    line(fmt::format("{}: {} from the cache", e.model, e.stage));
}

void Progress::show(std::size_t model, const StageExplained& e) {
  if (!explain_) return foresee(model, e);
  line(fmt::format("{}: {:<18} {}", e.model, e.stage, verdict(e.explanation)));
}

/// One line a model: why its first stages would run. What comes after them depends on what becomes of them.
void Progress::foresee(std::size_t model, const StageExplained& e) {
  constexpr std::size_t kMost = 2;
  Forecast& f = forecasts_[model];
  if (e.explanation.verdict == StageVerdict::kHit) ++f.hits;
  if (e.explanation.verdict == StageVerdict::kUnknown) ++f.waiting;
  if (e.explanation.verdict != StageVerdict::kRuns) return;
  if (const std::string why = verdict(e.explanation); f.running++ < kMost && why != f.last_why) {
    f.text += (f.text.empty() ? "" : "; ") + e.stage + " " + why;
    f.last_why = why;
  }
}

void Progress::foreseen(std::size_t model) {
  const auto it = forecasts_.find(model);
  if (it == forecasts_.end()) return;
  const Forecast& f = it->second;
  if (f.running == 0)
    line(fmt::format("{}: every stage from the cache", name_of(model)));
  else
    line(fmt::format("{}: {} ({} of {} stages from the cache, {} depend on what becomes of these)",
                     name_of(model), f.text, f.hits, f.hits + f.running + f.waiting, f.waiting));
  forecasts_.erase(it);
}

void Progress::show(std::size_t, const CacheTold& e) {
  if (++cache_events_[e.text] == 1) line("cache: " + e.text);
}

void Progress::show(std::size_t, const NoteTold& e) {
  const bool warns = e.note.severity == Severity::kWarning;
  constexpr std::array<std::string_view, 4> kToldOnce{kTurnedNote, kChosenAtlasNote, kRebuiltAtlasNote,
                                                      kKeptAtlasNote};
  const bool tells = is_told_always(e.note) || std::ranges::count(kToldOnce, e.note.code) > 0;
  if (warns || verbose_ || (tells && mode_ != OutputMode::kQuiet))
    line(fmt::format("{}: {}: {}", e.model, warns ? "warning" : "note", note_sentence(e.note)));
}

void Progress::show(std::size_t model, const ErrorTold& e) {
  line(error_line(models_[model].name, e.error.message));
}

void Progress::cache_event(const std::string& code, const std::string& text) {
  if (mode_ != OutputMode::kJson) return line("cache: " + text);
  write_event(CacheTold{"", code, text});
  out_ << std::flush;
}

void Progress::finished(std::size_t model, const WorkerReport& r, const std::string& output) {
  const bool cancelled = r.result == ModelResult::kCancelled;
  finished_count_ += !cancelled;
  const auto it = running_.find(model);
  if (!cancelled) done_weight_ += models_[model].weight - (it == running_.end() ? 0 : it->second.fraction);
  running_.erase(model);
  if (mode_ == OutputMode::kJson) {
    write_event(ModelFinished{name_of(model), output, r});
    if (r.ran) out_ << std::flush;
    return;
  }
  if (r.result == ModelResult::kOk && mode_ != OutputMode::kQuiet)
    line(fmt::format("{}: {}, {}, {}, peak memory {}{}", models_[model].name, output, format_bytes(r.bytes),
                     format_seconds(r.seconds), format_bytes(r.peak_memory_bytes),
                     r.stages_hit ? fmt::format(" ({} of {} stages from the cache)", r.stages_hit,
                                                r.stages_hit + r.stages_ran)
                                  : ""));
  else if (r.result == ModelResult::kUnchanged && mode_ != OutputMode::kQuiet)
    line(fmt::format("{}: {} is up to date", models_[model].name, output));
  redraw(true);
}

void Progress::tell_stale(const std::vector<std::string>& stale, const char* what) {
  constexpr std::size_t kMost = 10;
  for (std::size_t k = 0; k < std::min(stale.size(), kMost); ++k) line(fmt::format("{}: {}", stale[k], what));
  if (stale.size() > kMost) line(fmt::format("and {} more packages", stale.size() - kMost));
}

void Progress::summary(const std::vector<WorkerReport>& reports, double seconds,
                       const std::vector<std::string>& stale, bool removed) {
  auto count = [&](ModelResult r) {
    return std::count_if(reports.begin(), reports.end(),
                         [r](const WorkerReport& x) { return x.result == r; });
  };
  const auto ok = count(ModelResult::kOk), same = count(ModelResult::kUnchanged),
             cancelled = count(ModelResult::kCancelled);
  const auto models = static_cast<std::ptrdiff_t>(reports.size()), failed = models - ok - same - cancelled;
  const auto warned =
      std::ranges::count_if(reports, [](const WorkerReport& r) { return !r.more->told.empty(); });
  if (mode_ == OutputMode::kTerminal) out_ << "\r\033[K" << std::flush;
  if (mode_ == OutputMode::kJson) {
    const auto number = [](std::ptrdiff_t n) { return static_cast<std::uint64_t>(n); };
    write_event(RunFinished{number(models), number(ok), number(same), number(failed), number(cancelled),
                            number(warned), seconds, stale});
    out_ << std::flush;
    return;
  }
  if (removed && mode_ != OutputMode::kQuiet)
    tell_stale(stale, "removed, since no model makes this package any more");
  if (!removed) tell_stale(stale, "no model makes this package any more (--remove-stale removes it)");
  for (const auto& [text, times] : cache_events_)
    if (times > 1) line(fmt::format("cache: {} more times: {}", times - 1, text));
  const auto recalled =
      std::count_if(reports.begin(), reports.end(), [](const WorkerReport& r) { return r.ok() && !r.ran; });
  const bool says_all = explain_ && recalled == models;
  if (explain_ && recalled > 0 && mode_ != OutputMode::kQuiet)
    out_ << recalled_text(recalled, reports.size()) << '\n';
  if (!says_all && (models >= 2 || cancelled > 0) && (mode_ != OutputMode::kQuiet || failed + cancelled > 0))
    out_ << fmt::format("{} compiled, {} up to date, {} failed{} in {}{}\n", ok, same, failed,
                        cancelled ? fmt::format(", {} cancelled", cancelled) : "", format_seconds(seconds),
                        warned ? fmt::format("; {} with warnings", warned) : "");
  out_ << std::flush;
}

void Progress::forecast_summary(std::size_t to_look_at, std::size_t models, std::size_t failed,
                                const std::vector<std::string>& stale) {
  if (mode_ == OutputMode::kJson || mode_ == OutputMode::kQuiet) return;
  const std::size_t same = models - to_look_at - failed;
  const std::string counts = to_look_at == 0 && failed == 0
                                 ? recalled_text(static_cast<std::ptrdiff_t>(models), models)
                                 : fmt::format("{} would run, {} up to date", to_look_at, same);
  line(counts + (failed > 0 ? fmt::format(", {} failed before", failed) : "") + ". Nothing was written.");
  tell_stale(stale, "no model makes this package any more");
}

std::string Progress::recalled_text(std::ptrdiff_t recalled, std::size_t models) const {
  return fmt::format("{} of {} models are up to date{}", recalled, models,
                     recalled > 0 ? ": no input, option or tool has changed" : "");
}

void Progress::line(const std::string& text) {
  out_ << (mode_ == OutputMode::kTerminal ? "\r\033[K" : "") << printable(text) << '\n' << std::flush;
}

double Progress::done_fraction() const {
  double done = done_weight_;
  for (const auto& [model, running] : running_)
    for (const auto& [stage, part] : running.partial) done += part;
  return total_weight_ > 0 ? std::clamp(done / total_weight_, 0.0, 1.0) : 1;
}

std::string Progress::eta() const {
  const double done = done_fraction();
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  if (done < .02 || elapsed < 1) return "";
  return ", " + format_seconds(elapsed * (1 - done) / done) + " left";
}

/// The model that has been at it for longest.
std::string Progress::slowest() const {
  const auto it = std::min_element(running_.begin(), running_.end(), [](const auto& a, const auto& b) {
    return a.second.start < b.second.start;
  });
  return it == running_.end() ? "" : printable(std::string(models_[it->first].name)) + " " + it->second.stage;
}

/// Ten times a second is enough for an eye; events come faster.
void Progress::redraw(bool now) {
  if (mode_ != OutputMode::kTerminal) return;
  const auto time = std::chrono::steady_clock::now();
  if (!now && time - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = time;
  constexpr int kWidth = 24;
  const int filled = static_cast<int>(done_fraction() * kWidth);
  const std::string before = fmt::format("[{:=<{}}{:<{}}] {}/{} ", "", filled, "", kWidth - filled,
                                         finished_count_, models_.size()),
                    left = eta(), after = running_.empty() && !left.empty() ? left.substr(2) : left;
  // A line that wraps cannot be drawn over.
  const std::size_t columns = terminal_columns(), taken = before.size() + after.size() + 1;
  out_ << "\r\033[K" << before << last_columns(slowest(), columns > taken ? columns - taken : 0) << after
       << std::flush;
}

}  // namespace texmesh
