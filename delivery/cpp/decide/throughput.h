#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace texmesh {

/// Other transfers that are under way when one ends.
struct OtherTransfers {
  std::size_t count = 0;
  double bytes = 0;  // of all of them, whatever has arrived already
};

/// Throughput of a connection or a group of them. Plain double arithmetic: the same bits everywhere.
class Throughput {
 public:
  static constexpr double kLeastSeconds = 1e-9;
  explicit Throughput(double initial_bytes_s);  // beta_0 > 0, the estimate until there is a sample
  /// `seconds`: since the end of the transfer before, latency taken off; less than kLeastSeconds counts as
  /// that. The link's first seconds serve all transfers under way, and what has arrived of `others` is not
  /// known. So, until more transfers have ended than are under way, the estimate is beta_0, as far as it lies
  /// between what the link has given if nothing of the others has arrived, and if all of it has.
  void add(double bytes, double seconds, const OtherTransfers& others = {});
  /// Bytes over seconds of at most so many samples: a harmonic mean in which large transfers count more,
  /// since small ones mostly measure latency.
  double recent_bytes_s(std::size_t samples) const;
  bool starting() const { return starting_; }  // no more transfers have ended than are under way
  /// The mean of the last `seconds` > 0 of transfers; what lies before the first counts as beta_0.
  double mean_bytes_s(double seconds) const;

 private:
  struct Sample {
    double bytes = 0, seconds = 0;
  };
  double initial_bytes_s_;
  std::vector<Sample> ring_;  // the newest at (count_ - 1) % size
  std::vector<Sample> sums_;  // of all samples up to each
  std::size_t count_ = 0;
  bool starting_ = true;
  double start_bytes_s_ = 0;  // the estimate while starting_
};

}  // namespace texmesh
