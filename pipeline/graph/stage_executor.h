#pragma once
#include <mutex>
#include <string>
#include <vector>

#include "pipeline/graph/artefact_table.h"
#include "pipeline/graph/explanation.h"
#include "pipeline/graph/stage_observer.h"
#include "pipeline/graph/stage_results.h"

namespace texmesh {

/// Brings single stages of a graph up to date and fetches artefacts, from the store or by running stages.
/// Safe from several threads: a stage is never run by two of them at once, however many results it has.
///
/// The order of locks, outermost first: the `running` of a stage, held while that stage is looked up, loaded
/// or run; then one of those inside ArtefactTable, the store or this class. Whoever holds the `running` of a
/// stage takes only those of stages before it in the graph, whose results it reads. The graph has no circle,
/// so no two threads wait for each other.
class StageExecutor {
 public:
  /// All arguments must outlive the executor.
  StageExecutor(const std::vector<Stage>& stages, ArtefactTable& artefacts, Store& store,
                const RunContext& context, StageObserver observer);

  /// See GraphRun::explain.
  void explain(StageKeys earlier, StageExplainer explainer);
  StageExplanation explanation_of(const Stage& stage, const Key& key,
                                  StageExplanation::Verdict verdict) const;

  /// Makes the results of a stage known: finds the results in the store, or runs the stage and stores the
  /// results. Derived data is known by its key alone and computed by fetch(). All inputs must be known.
  void bring_up_to_date(std::size_t stage);

  /// The object of an artefact that is known: at hand, from the store, or by running its stage (again).
  Object fetch(const std::string& artefact);

  /// Of the stages that have been looked at.
  StageKeys keys() const;
  /// Of all stages, in their order.
  Notes notes() const;

 private:
  struct StageState {  // guarded by `running`
    mutable std::mutex running;
    bool has_key = false;
    Sha256 key{};
    std::vector<StoredBlob> blobs;  // of a stored stage that is up to date
    Notes notes;
  };

  bool find_in_store(std::size_t stage, const Key& key);
  StageResult run(std::size_t stage);
  StageResult run_and_store(std::size_t stage);
  void publish(std::size_t stage, const Sha256& key, std::vector<StoredBlob> blobs, const Notes& notes);
  void publish_keys_of_derived_data();
  void explain_verdict(std::size_t stage, const Key& key, StageExplanation::Verdict verdict);
  void notify(const Stage& stage, StageEvent event, double fraction = 0, double seconds = 0);

  const std::vector<Stage>& stages_;
  ArtefactTable& artefacts_;
  Store& store_;
  const RunContext& context_;
  StageObserver observer_;
  StageExplainer explainer_;
  StageKeys earlier_keys_;
  std::vector<StageState> states_;
  std::mutex observer_mutex_;  // one call of observer or explainer at a time
};

}  // namespace texmesh
