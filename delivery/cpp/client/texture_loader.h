#pragma once
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "delivery/cpp/decide/fragment_list.h"
#include "delivery/cpp/simulate/simulation.h"
#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {

/// A fragment that has arrived, its digest checked. To be shown at once.
struct LoadedFragment {
  std::uint32_t plane = 0, fragment = 0;
  std::int32_t rung = 0;
  /// The rung's stream; of incremental codecs those of all rungs above the one held before, up to this one.
  std::vector<std::vector<std::uint8_t>> streams;
};

struct LoadOptions {
  ListOptions list;
  HtcOptions htc;
  int tries = 3;  // of a request before its fragment is given up for this load
  /// Seconds after the time limit at which the load ends, whatever is still on its way; -1 = a tenth of the
  /// limit, at least half a second and 8 round trips.
  double grace_s = -1;
  /// Fragments that stand together in their pack are asked for and decided about together, so many bytes at
  /// once; 0 = one by one. See group_bytes().
  double group_bytes = 0;
  std::function<bool()> cancelled;  // ends the load; what has arrived stays
  std::function<void(const LoadedFragment&)> on_fragment;
};

struct LoadReport {
  SimulationResult transfer;  // times from the load's first request on, by request
  bool cancelled = false;
  bool out_of_time = false;                       // ended by the grace, or the limits of refine()
  std::uint32_t fragments = 0;                    // that were wanted
  std::uint32_t skipped = 0;                      // of them, by decision
  std::uint32_t given_up = 0;                     // fragments that no mirror delivered, or not in time
  std::map<std::string, std::uint32_t> problems;  // why requests failed, and how many, tries included
};

/// Bytes that one request should bring, so that waiting for answers does not leave the link idle, and that
/// leave a time limit decisions enough to make good at its end what went wrong at its beginning. The
/// browser client's measure.
double group_bytes(double bytes_s, double rtt_s, double limit_s);

/// What a client has of a package's textures, and how it gets more: fragments within a time limit, better
/// ones after it, others when the display changes. What is held is not fetched again. Not thread-safe.
class TextureLoader {
 public:
  /// `whole_rungs`: for servers without ranges; all fragments of a plane then come at one rung in one
  /// request, which is an offer of the plan.
  TextureLoader(PackageReader& package, Transport& transport, bool whole_rungs = false);

  /// Harmonic Time Compensation over what these planes still lack.
  LoadReport load(const std::vector<PlaneChoice>& planes, const LoadOptions& options);
  /// After the deadline: upgrades in order of loss saved per byte, at most for so long and so many bytes.
  struct RefineLimits {
    double seconds = 1e6;
    std::uint64_t bytes = ~0ull;
  };
  LoadReport refine(const std::vector<PlaneChoice>& planes, const LoadOptions& options,
                    const RefineLimits& limits);
  /// Highest rung held of a fragment, -1 = none.
  std::int32_t held(std::uint32_t plane, std::uint32_t fragment) const { return held_[plane][fragment]; }
  std::uint64_t bytes() const { return bytes_; }  // of streams, over all loads

 private:
  /// An offer and what it stands for: fragments of a plane that stand together in its packs, all at the same
  /// rungs, of which the first offered one is first_rung.
  struct Wanted {
    FragmentOffer offer;
    std::uint32_t plane = 0;
    std::vector<std::uint32_t> fragments;
    std::int32_t first_rung = 0;
  };
  std::vector<Wanted> wanted(const std::vector<PlaneChoice>& planes, const ListOptions& options);
  std::vector<Wanted> join_planes(std::vector<Wanted> fragments) const;
  std::vector<Wanted> join_neighbours(std::vector<Wanted> fragments, double bytes_each, double budget);
  bool follows(const Wanted& w, std::uint32_t fragment);
  std::vector<PackagePart> parts_of(const Wanted& w, std::int32_t rung);
  bool keep_sound_fragments(const Wanted& w, std::int32_t rung, const Transport::Outcome& outcome,
                            const std::function<void(const LoadedFragment&)>& on_fragment);
  void count_fragments(const HarmonicTimePlan& plan, const std::vector<Wanted>& wanted,
                       LoadReport& report) const;

  PackageReader& package_;
  Transport& transport_;
  bool whole_rungs_;
  std::vector<std::vector<std::int32_t>> held_;  // [plane][fragment]
  std::uint64_t bytes_ = 0;
};

}  // namespace texmesh
