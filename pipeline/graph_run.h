#pragma once
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "pipeline/stage_table.h"
#include "pipeline/store.h"

namespace texmesh {

enum class StageEvent { kStarted, kProgress, kHit, kRan };

/// Told from any thread, one call at a time. `fraction` is 0..1 for kProgress; `seconds` is wall time of
/// kRan.
using StageObserver =
    std::function<void(const Stage& stage, StageEvent event, double fraction, double seconds)>;

/// Runs a stage graph for one model over a store. Stages whose inputs are known run side by side, at most
/// context.threads at a time; a stage whose key is in the store is not run, and its result is not even loaded
/// unless somebody needs it. Objects are dropped after their last use.
class GraphRun {
 public:
  GraphRun(const std::vector<Stage>& stages, const CompileOptions& options, Store& store,
           const RunContext& context, StageObserver observer = {});
  ~GraphRun();

  /// An artefact from outside the graph, with the digest that stands for it in keys.
  void give(const std::string& artefact, Object object, const Sha256& digest, std::uint64_t bytes);

  /// Brings every stage up to date and returns the object of `wanted`. Rethrows the first error (in table
  /// order where several stages failed) after the running ones have ended.
  Object run(const std::string& wanted);

  /// Notes of all stages, in table order; complete after run().
  Notes notes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace texmesh
