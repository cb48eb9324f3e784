#pragma once
#include <functional>
#include <vector>

#include "delivery/cpp/fragment_list.h"
#include "delivery/cpp/simulation.h"
#include "delivery/cpp/transfer.h"

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
  int tries = 3;                    // of a request before its fragment is given up for this load
  std::function<bool()> cancelled;  // ends the load; what has arrived stays
  std::function<void(const LoadedFragment&)> on_fragment;
};

struct LoadReport {
  SimulationResult transfer;  // times from the load's first request on
  bool cancelled = false;
  std::uint32_t given_up = 0;  // fragments that no mirror delivered
};

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
  /// An offer and what it stands for: fragments of a plane, all at the same rungs, of which the first offered
  /// one is first_rung.
  struct Wanted {
    FragmentOffer offer;
    std::uint32_t plane = 0;
    std::vector<std::uint32_t> fragments;
    std::int32_t first_rung = 0;
  };
  std::vector<Wanted> wanted(const std::vector<PlaneChoice>& planes, const ListOptions& options);
  std::vector<Wanted> join_planes(std::vector<Wanted> fragments) const;
  std::vector<PackagePart> parts_of(const Wanted& w, std::int32_t rung);
  bool take(const Wanted& w, std::int32_t rung, const Transport::Outcome& outcome,
            const std::function<void(const LoadedFragment&)>& on_fragment);

  PackageReader& package_;
  Transport& transport_;
  bool whole_rungs_;
  std::vector<std::vector<std::int32_t>> held_;  // [plane][fragment]
  std::uint64_t bytes_ = 0;
};

}  // namespace texmesh
