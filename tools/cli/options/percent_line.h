#pragma once
#include <mutex>
#include <ostream>
#include <string>

namespace texmesh {

/// "extract 40 %" on a line of a terminal that is drawn over, until the end takes it away. Safe from several
/// threads.
class PercentLine {
 public:
  /// On standard error, where that is a terminal.
  explicit PercentLine(std::string label);
  PercentLine(std::string label, std::ostream& out, bool is_terminal);
  ~PercentLine() { end(); }
  PercentLine(const PercentLine&) = delete;
  PercentLine& operator=(const PercentLine&) = delete;
  /// 0..1; never goes back.
  void show(double fraction);
  void end();

 private:
  std::string label_;
  std::ostream& out_;
  bool is_terminal_;
  std::mutex mutex_;
  int percent_ = -1;
};

}  // namespace texmesh
