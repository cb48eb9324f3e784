#include "tools/cli/options/percent_line.h"

#include <unistd.h>

#include <algorithm>
#include <iostream>

namespace texmesh {

PercentLine::PercentLine(std::string label)
    : PercentLine(std::move(label), std::cerr, ::isatty(STDERR_FILENO) != 0) {}

PercentLine::PercentLine(std::string label, std::ostream& out, bool is_terminal)
    : label_(std::move(label)), out_(out), is_terminal_(is_terminal) {}

void PercentLine::show(double fraction) {
  const int percent = static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0));
  const std::lock_guard lock(mutex_);
  if (!is_terminal_ || percent <= percent_) return;
  percent_ = percent;
  out_ << "\r\033[K" << label_ << ' ' << percent << " %" << std::flush;
}

void PercentLine::end() {
  const std::lock_guard lock(mutex_);
  if (percent_ >= 0) out_ << "\r\033[K" << std::flush;
  percent_ = -1;
  is_terminal_ = false;
}

}  // namespace texmesh
