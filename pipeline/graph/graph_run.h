#pragma once

#include <memory>

#include "pipeline/graph/stage.h"
#include "pipeline/graph/store.h"

namespace texmesh {

/// One labelled part of a key that has changed; "" where the key had, or has, no such part.
struct KeyChange {
  std::string label, from, to;
  static void fields(auto& s, auto&& v) {
    v("part", s.label, kNotEmpty, "");
    v("from", s.from, "empty = was not there");
    v("to", s.to, "empty = is not there");
  }
};

enum class StageVerdict : std::uint8_t {
  kHit,      // the result is in the store
  kRuns,     // the result is not in the store
  kUnknown,  // forecasts only: depends on the result of an earlier stage that runs
};
template <>
struct EnumNames<StageVerdict> {
  static constexpr std::array<std::string_view, 3> names{"hit", "runs", "unknown"};
};

/// Why a stage is run or not.
struct StageExplanation {
  using Verdict = StageVerdict;
  Verdict verdict = Verdict::kHit;
  bool has_history = false;        // a key of an earlier run of this stage for this model is known
  std::vector<KeyChange> changes;  // against that key, in the order of its parts; empty where nothing changed
  std::string waits_for;           // kUnknown: the artefact
  static void fields(auto& s, auto&& v) {
    v("verdict", s.verdict,
      "hit = from the cache; unknown = in a dry run, depends on what an earlier stage gives");
    v("history", s.has_history, "an earlier run of this stage for this model is known");
    v("changes", s.changes, "against that run, in the order of the key's parts");
    v("waits_for", s.waits_for, FieldRule{.range = kNotEmpty.range, .may_miss = true},
      "the artefact that is not known yet");
  }
};
using StageExplainer = std::function<void(const Stage& stage, const StageExplanation& explanation)>;

/// Runs a graph of stages for one model over a store, once. Stages whose inputs are known run side by side,
/// at most context.threads at a time. A stage whose key is in the store is not run, and its result is loaded
/// only when another stage needs it. Objects are dropped after their last use. Of options the graph knows
/// only the texts that the stages declare for their keys.
class GraphRun {
 public:
  /// `stages`, `store` and `context` must outlive the run. Throws std::logic_error where the stages'
  /// artefacts do not fit together.
  GraphRun(const std::vector<Stage>& stages, Store& store, const RunContext& context,
           StageObserver observer = {});
  ~GraphRun();

  /// Hands over an artefact from outside the graph. In keys its digest stands for the artefact, or, where
  /// there are any, `parts` do: the parts that the digest is made of, so that explain() can say which has
  /// changed.
  template <class T>
  void give(Artefact<T> artefact, T value, const Sha256& digest, std::uint64_t bytes,
            std::vector<std::pair<std::string, std::string>> parts = {}) {
    give_object(ArtefactName(artefact), make_object(std::move(value)), digest, bytes, std::move(parts));
  }

  /// The keys that the stages' keys are compared with, and the listener that hears of every stage before the
  /// stage runs. The listener is called from any thread, one call at a time.
  void explain(StageKeys earlier, StageExplainer explainer);

  /// What run() would do, in table order, without running anything or changing the store.
  std::vector<std::pair<const Stage*, StageExplanation>> forecast();

  /// Brings every stage up to date and returns the object of `wanted`. Rethrows the first error (in table
  /// order where several stages failed) after the running ones have ended.
  template <class T>
  std::shared_ptr<const T> run(Artefact<T> wanted) {
    return std::static_pointer_cast<const T>(run_object(ArtefactName(wanted)));
  }

  /// The keys of this run; complete after run() for every stage that has been looked at.
  StageKeys keys() const;

  /// Notes of all stages, in table order; complete after run().
  Notes notes() const;

 private:
  struct Parts;
  void give_object(const ArtefactName& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
                   std::vector<std::pair<std::string, std::string>> parts);
  Object run_object(const ArtefactName& wanted);
  bool forecast_stage(const Stage& stage, StageExplanation& explanation);
  std::unique_ptr<Parts> parts_;
};

}  // namespace texmesh
