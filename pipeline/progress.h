#pragma once
#include <chrono>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "pipeline/worker.h"

namespace texmesh {

enum class OutputMode : std::uint8_t { kTerminal, kPlain, kJson, kQuiet };

/// What a user sees of a compile run: one line that redraws itself on a terminal, plain lines in a pipe, or
/// one JSON event a line (schemas/event.v1.schema.json). Errors and warnings are shown in every mode.
class Progress {
 public:
  Progress(std::ostream& out, OutputMode mode, std::vector<std::string> models, bool verbose);

  void started(std::size_t job, const std::string& output);
  void event(std::size_t job, const std::string& json_line);
  void finished(std::size_t job, const WorkerReport& report, const std::string& output);
  void summary(const std::vector<WorkerReport>& reports, double seconds);

 private:
  void line(const std::string& text);  // a lasting line
  void redraw();
  double done_fraction() const;
  std::string eta() const;

  std::ostream& out_;
  OutputMode mode_;
  std::vector<std::string> models_;
  bool verbose_;
  std::vector<double> fraction_;                // of each model
  std::map<std::size_t, std::string> running_;  // job -> stage
  std::size_t finished_count_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

std::string format_bytes(std::uint64_t bytes);  // "1.23 MB", decimal units
std::string format_seconds(double seconds);     // "3.4 s", "2 min 10 s"

}  // namespace texmesh
