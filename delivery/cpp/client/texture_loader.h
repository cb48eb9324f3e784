#pragma once

#include "delivery/cpp/decide/fragment_list.h"
#include "delivery/cpp/simulate/simulation.h"

namespace texmesh {

/// A fragment that has arrived and has the digest of the tables. The caller can show it at once.
struct LoadedFragment {
  std::uint32_t plane = 0, fragment = 0;
  std::int32_t rung = 0;
  /// The rung's stream. Of incremental codecs: the streams of all rungs above the rung held before, up to
  /// `rung`.
  std::vector<Bytes> streams;
};

struct LoadOptions {
  ListOptions list;
  HtcOptions htc;
  int tries = 3;  // of a request before its fragment is given up for this load
  /// Seconds after the time limit at which the load ends, whatever is still on its way; -1 = a tenth of the
  /// limit, at least half a second and 8 round trips.
  double grace_s = -1;
  /// One request, and one decision, for so many bytes of fragments that stand together in their pack; 0 = for
  /// every fragment its own. See group_bytes().
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
  std::vector<MirrorShare> mirrors;               // in the transport's order
};

/// The textures of a package that a client holds. Loads fragments within a time limit, upgrades fragments
/// after the limit, and loads other fragments when the display changes. A fragment that is held is not
/// fetched again. Not thread-safe.
class TextureLoader {
 public:
  /// `whole_rungs` is for servers without ranges: one request, and one offer of the plan, is for all
  /// fragments of a plane at one rung.
  TextureLoader(PackageReader& package, Transport& transport, bool whole_rungs = false);

  /// Loads the fragments that these planes still lack, by Harmonic Time Compensation.
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
  /// An offer and its fragments, which stand together in the packs of one plane. first_rung
  /// is the rung that the offer lists first.
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
