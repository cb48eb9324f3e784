#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace texmesh {

/// How the throughput of the next transfer is guessed from those that have ended (bytes per second).
/// kLast: the last one's, the thesis's choice and the right one for meeting a deadline with one request at a
/// time. kHarmonic: bytes over seconds of the last `samples`, a harmonic mean in which large transfers count
/// more, since small ones mostly measure latency. kEwma: exponentially weighted mean with weight `ewma`, less
/// for transfers below `small_bytes`.
enum class Estimator : std::uint8_t { kLast, kHarmonic, kEwma };
struct ThroughputOptions {
  Estimator estimator = Estimator::kHarmonic;
  int samples = 10;              // 1 .. 64
  double ewma = 0.2;             // 0 .. 1
  double small_bytes = 4000;     // > 0
  double initial_bytes_s = 1e5;  // beta_0, until there is a sample; > 0
};

/// Other transfers that are under way when one ends.
struct OtherTransfers {
  std::size_t count = 0;
  double bytes = 0;  // of all of them, whatever has arrived already
};

/// Throughput of a connection or a group of them. Plain double arithmetic: the same bits everywhere.
class Throughput {
 public:
  explicit Throughput(const ThroughputOptions& options);
  /// `seconds`: since the end of the transfer before, latency taken off; less than 1 ns counts as 1 ns.
  /// The link's first seconds serve all transfers under way, and what has arrived of `others` is not known.
  /// So, until more transfers have ended than are under way, the estimate is beta_0, as far as it lies
  /// between what the link has given if nothing of the others has arrived, and if all of it has.
  void add(double bytes, double seconds, const OtherTransfers& others = {});
  double bytes_s() const;                            // by the estimator chosen
  double recent_bytes_s(std::size_t samples) const;  // bytes over seconds of at most so many samples
  /// The mean of the last `seconds` > 0 of transfers; what lies before the first counts as beta_0.
  double mean_bytes_s(double seconds) const;

 private:
  struct Sample {
    double bytes = 0, seconds = 0;
  };
  ThroughputOptions options_;
  std::vector<Sample> ring_;  // the newest at (count_ - 1) % size
  std::vector<Sample> sums_;  // of all samples up to each
  std::size_t count_ = 0;
  double ewma_ = 0;
  bool starting_ = true;
  double start_bytes_s_ = 0;  // the estimate while starting_
};

}  // namespace texmesh
