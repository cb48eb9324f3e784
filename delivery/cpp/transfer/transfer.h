#pragma once

#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/http/http_client.h"
#include "delivery/cpp/package/package_reader.h"
#include "format/documents/index.h"

namespace texmesh {

/// A part of an entry of the package.
struct PackagePart {
  EntryRef entry;
  ByteRange range;  // within the entry
  friend bool operator==(const PackagePart&, const PackagePart&) = default;
};

/// One request. The asker chooses the number, which comes back with the outcome.
struct TransferRequest {
  std::uint32_t number = 0;
  std::uint64_t bytes = 0;
  std::vector<PackagePart> parts;  // a model of a network needs none
};

/// Carries requests to the mirrors of one package: a network, or a model of a network.
class Transport {
 public:
  struct Outcome {
    std::uint32_t number = 0;
    double time_s = 0;
    bool good = false;         // false: the mirror has failed to deliver
    std::vector<Bytes> parts;  // as asked for
    std::string problem;       // why not good, in a few words
    double wait_s = 0;         // above 0: the mirror is to be left alone, at least for so long (429, 5xx)
    bool for_good = false;     // the mirror will never deliver: has another file by now, knows no ranges
    bool absent = false;       // the mirror does not have this entry; it may have others
    bool lied = false;         // of models: the bytes are wrong
  };
  virtual ~Transport() = default;
  virtual std::size_t mirrors() const = 0;  // at least one
  virtual double now_s() = 0;               // since the first use; never falls
  /// Asks the mirror. Bytes that an earlier try of the same request brought are not asked for again.
  virtual void start(const TransferRequest& request, std::uint32_t mirror) = 0;
  /// Ends a request, whether its outcome is there or not.
  virtual void cancel(std::uint32_t number) = 0;
  /// The same, and drops what the request has brought so far.
  virtual void forget(std::uint32_t number) { cancel(number); }
  /// Bytes of a request that have come so far: the request is under way, or broke and keeps them.
  virtual double received(std::uint32_t) { return 0; }
  /// The outcome that comes first; nothing when `until_s` comes before. When no request can ever end:
  /// nothing, at once where `until_s` is kForEver_s, else at `until_s`.
  virtual std::optional<Outcome> wait(double until_s) = 0;
};
constexpr double kForEver_s = 1e9;

/// Makes the requests: the plan of a time limit, or the upgrades after the limit.
class RequestSource {
 public:
  virtual ~RequestSource() = default;
  /// The next request, while there is room for one; nothing: wait for the requests under way.
  virtual std::optional<TransferRequest> next(double now_s) = 0;
  /// Takes an outcome. False when the bytes are wrong (another digest): the request goes to another mirror
  /// then.
  virtual bool arrived(const Transport::Outcome& outcome) = 0;
  /// The request was given up.
  virtual void failed(std::uint32_t number, double now_s) = 0;
  virtual bool finished() const = 0;
};

struct TransferOptions {
  double rtt_s = 0;              // round trip, told or measured
  double initial_bytes_s = 1e5;  // of each mirror, until it has delivered something
  /// Of a request, over all mirrors, before the request is given up. A try that brings new bytes begins the
  /// count again.
  int tries = 3;
  double until_s = kForEver_s;      // nothing is asked for or waited for after this
  std::function<bool()> cancelled;  // asked after every event and every tenth of a second
};
/// What a mirror has brought of a transfer.
struct MirrorShare {
  std::uint32_t requests = 0;
  std::uint64_t bytes = 0;
  double bytes_s = 0;   // as it is expected to go on; the guess where it has brought nothing
  std::string dropped;  // why it is asked no more; "" = it is
};
struct TransferEnd {
  double last_s = 0;                              // when the last request arrived
  bool cancelled = false;                         // by cancelled(): what was under way is cancelled
  bool out_of_time = false;                       // by until_s: the same
  bool dead = false;                              // nothing that was under way could ever arrive
  std::uint32_t given_up = 0, unfinished = 0;     // requests after their tries; those under way at the end
  std::map<std::string, std::uint32_t> problems;  // why tries failed, and how many
  std::vector<MirrorShare> mirrors;
};

/// Runs until the source has finished.
/// - A request goes to the mirror that is expected to deliver first, by what each has delivered and has to
///   deliver yet. So the requests of one texture are spread over the mirrors by their speed.
/// - A mirror that lacks an entry is not asked for that entry again; a package may be spread over mirrors of
///   which none has all of it.
/// - A mirror that lies (bytes of another digest) is dropped, and all that it still owes goes to others. It
///   is asked again only where there is no other.
/// - A request is late when it is not there after four times the expected time (at least 8 round trips and
///   half a second) while another mirror delivers. It goes to another mirror. A mirror that has brought
///   nothing of it is left alone as long as another answers; one that has brought a part is slower than was
///   thought, and gets less from then on. When no mirror is left, all are tried again.
/// - A mirror that is busy is asked again after a pause that grows, or after the pause that the mirror names.
/// - Every request ends: it arrives, or is given up after its tries or when nothing can arrive any more. The
///   source hears of every end.
/// Deterministic where the transport is.
TransferEnd transfer(RequestSource& source, Transport& transport, const TransferOptions& options);

/// A plan as a source of requests. The plan's time 0 is `start_s` of the transport. `parts` says what a step
/// fetches. `accept` keeps the bytes that arrived, and gives false when they are wrong. Either may be empty.
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
  std::vector<std::int32_t> rung_;  // by offer: the rung that was asked for
};

struct TransportOptions {
  HttpOptions http;
  int connections = 6;                       // per mirror, as browsers have; a request beyond them waits
  std::map<std::string, std::string> etags;  // by URL, what is known of containers already
};

/// Over HTTP, from one or more mirrors that serve the same package: URLs of containers (ranges) or, ending in
/// a slash, of trees (ranges of an entry, the whole entry where that is asked for). InputError for anything
/// that is no URL. Requests are tried once: transfer() asks elsewhere or again; what a cut answer has brought
/// is kept until then. A container whose length changes (or its ETag, where an answer has no length), or that
/// is not answered in ranges, has failed for good. Digests of parts are the caller's matter (Accept).
std::unique_ptr<Transport> open_transport(const std::vector<std::string>& mirrors,
                                          const TransportOptions& options = {});
/// From a store that is here, without a network: every request is answered at once.
std::unique_ptr<Transport> open_transport(PackageStore& store);

}  // namespace texmesh
