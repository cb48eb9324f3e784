#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "delivery/cpp/decide/harmonic_time.h"
#include "format/documents/entry_ref.h"

namespace texmesh {

/// A part of an entry of the package.
struct PackagePart {
  EntryRef entry;
  ByteRange range;  // within the entry
};

/// One thing to fetch. The number is the asker's own and comes back with what arrived.
struct TransferRequest {
  std::uint32_t number = 0;
  std::uint64_t bytes = 0;
  std::vector<PackagePart> parts;  // a model of a network needs none
};

/// What carries requests to mirrors of one package: a network, or a model of one.
class Transport {
 public:
  struct Outcome {
    std::uint32_t number = 0;
    double time_s = 0;
    bool good = false;                             // false: this mirror has failed to deliver it
    std::vector<std::vector<std::uint8_t>> parts;  // as asked for
    std::string problem;                           // why it is not good, in a few words
    double wait_s = 0;      // above 0: the mirror is to be left alone, at least for so long (429, 5xx)
    bool for_good = false;  // it will never deliver: replaced by another file, knows no ranges
  };
  virtual ~Transport() = default;
  virtual std::size_t mirrors() const = 0;  // at least one
  virtual double now_s() = 0;               // since the first use; never falls
  /// What an earlier try of the same request brought is not asked for again.
  virtual void start(const TransferRequest& request, std::uint32_t mirror) = 0;
  /// Outcome or not, the request is over.
  virtual void cancel(std::uint32_t number) = 0;
  /// Bytes that have come of a request that is under way, or that are kept of one that broke.
  virtual double received(std::uint32_t) { return 0; }
  /// What ends first, or nothing when the time comes before. Nothing, too, when nothing can ever end: at once
  /// where `until_s` is kForEver_s, else when that time comes.
  virtual std::optional<Outcome> wait(double until_s) = 0;
};
constexpr double kForEver_s = 1e9;

/// What wants things fetched: the plan of a time limit, or the upgrades after it.
class RequestSource {
 public:
  virtual ~RequestSource() = default;
  /// The next request while there is room for one; nothing: wait for those under way.
  virtual std::optional<TransferRequest> next(double now_s) = 0;
  /// What arrived; false when it is not what it should be (a digest that differs): it is then
  /// asked for elsewhere.
  virtual bool arrived(const Transport::Outcome& outcome) = 0;
  virtual void failed(std::uint32_t number, double now_s) = 0;  // given up
  virtual bool finished() const = 0;
};

struct TransferOptions {
  double rtt_s = 0;                 // round trip, told or measured
  double initial_bytes_s = 1e5;     // of each mirror, until it has delivered something
  int tries = 3;                    // of a request, over all mirrors, before it is given up; one that brings
                                    // something anew begins the count again
  double until_s = kForEver_s;      // nothing is asked for or waited for after this
  std::function<bool()> cancelled;  // asked after every event and every tenth of a second
};
struct TransferEnd {
  double last_s = 0;                              // when the last request arrived
  bool cancelled = false;                         // by cancelled(): what was under way is cancelled
  bool out_of_time = false;                       // by until_s: the same
  bool dead = false;                              // nothing that was under way could ever arrive
  std::uint32_t given_up = 0, unfinished = 0;     // requests after their tries; those under way at the end
  std::map<std::string, std::uint32_t> problems;  // why tries failed, and how many
};

/// Runs until the source has finished. A request goes to the mirror that is expected to deliver it first; one
/// that delivers nothing for four times what it should take (at least 8 round trips and half a second) is
/// asked elsewhere and left alone while another answers; when none is left all are tried again. A mirror that
/// is busy is asked again after a pause that grows, or that it names. Every request ends: it arrives, or it
/// is given up after its tries, or when nothing can arrive any more; the source hears of each. With a
/// transport that is deterministic, so is this.
TransferEnd transfer(RequestSource& source, Transport& transport, const TransferOptions& options);

/// A plan as a source of requests, its time counted from `start_s` of the transport's on; `parts` says what a
/// step fetches, `accept` keeps what arrived (false: the bytes are wrong). Either may be empty.
class PlanSource final : public RequestSource {
 public:
  using Parts = std::function<std::vector<PackagePart>(std::uint32_t offer, std::int32_t rung)>;
  using Accept = std::function<bool(std::uint32_t offer, std::int32_t rung, const Transport::Outcome&)>;
  explicit PlanSource(HarmonicTimePlan& plan, double start_s = 0, Parts parts = {}, Accept accept = {});
  std::optional<TransferRequest> next(double now_s) override;
  bool arrived(const Transport::Outcome& outcome) override;
  void failed(std::uint32_t number, double now_s) override { plan_.failed(number, now_s - start_s_); }
  bool finished() const override { return plan_.finished(); }

 private:
  HarmonicTimePlan& plan_;
  double start_s_;
  Parts parts_;
  Accept accept_;
  std::vector<std::int32_t> rung_;  // by offer, of what was asked for
};

}  // namespace texmesh
