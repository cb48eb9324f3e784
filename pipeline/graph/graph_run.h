#pragma once
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "pipeline/compile/stage_table.h"
#include "pipeline/graph/key.h"
#include "pipeline/graph/store.h"

namespace texmesh {

enum class StageEvent { kStarted, kProgress, kHit, kRan };

/// Told from any thread, one call at a time. `fraction` is 0..1 for kProgress; `seconds` is wall time of
/// kRan.
using StageObserver =
    std::function<void(const Stage& stage, StageEvent event, double fraction, double seconds)>;

/// One labelled part of a key that is not what it was; "" = was not there, is not there.
struct KeyChange {
  std::string label, from, to;
};

/// Why a stage is run or not.
struct StageExplanation {
  enum class Verdict : std::uint8_t {
    kHit,      // the result is in the store
    kRuns,     // it is not
    kUnknown,  // forecasts only: depends on what an earlier stage will give
  };
  Verdict verdict = Verdict::kHit;
  bool has_history = false;  // a key of an earlier run of this stage for this model is known
  std::vector<KeyChange>
      changes;            // against that key, in the order of the key's parts; empty where nothing changed
  std::string waits_for;  // kUnknown: the artefact
};
using StageExplainer = std::function<void(const Stage& stage, const StageExplanation& explanation)>;

/// Runs a stage graph for one model over a store. Stages whose inputs are known run side by side, at most
/// context.threads at a time; a stage whose key is in the store is not run, and its result is not even loaded
/// unless somebody needs it. Objects are dropped after their last use.
class GraphRun {
 public:
  GraphRun(const std::vector<Stage>& stages, const CompileOptions& options, Store& store,
           const RunContext& context, StageObserver observer = {});
  ~GraphRun();

  /// An artefact from outside the graph, with the digest that stands for it in keys. `parts` stand there
  /// instead where there are any: what the digest is made of, so that explain() can say which of them has
  /// changed.
  void give(const std::string& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
            std::vector<std::pair<std::string, std::string>> parts = {});

  /// What a stage's key is compared with, and who is told, for every stage, before it runs. Called from any
  /// thread, one call at a time.
  void explain(StageKeys earlier, StageExplainer explainer);

  /// What run() would do, in table order, without running anything or changing the store.
  std::vector<std::pair<const Stage*, StageExplanation>> forecast();

  /// The keys of this run; complete after run() for every stage that has been looked at.
  StageKeys keys() const;

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
