#include "pipeline/graph/graph_run.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "pipeline/graph/artefact_table.h"
#include "pipeline/graph/stage_executor.h"
#include "pipeline/graph/stage_results.h"
#include "pipeline/graph/stage_scheduler.h"

namespace texmesh {
namespace {
constexpr int kMostThreads = 4;  // stages side by side: each has threads of its own

/// What a stage has freed goes back to the system: the next stages ask for blocks of other sizes, and would
/// find no place between those that are left (126 MB on a saxophone). A few are kept: fetching pages back
/// takes a small model longer.
void return_free_memory() {
#ifdef __GLIBC__
  constexpr std::size_t kKeptBytes = std::size_t{16} << 20;
  if (::mallinfo2().fordblks > kKeptBytes) ::malloc_trim(0);
#endif
}
}  // namespace

struct GraphRun::Parts {
  Parts(const std::vector<Stage>& all, Store& store_of_results, const RunContext& run_context,
        StageObserver observer)
      : stages(all),
        store(store_of_results),
        context(run_context),
        artefacts(all),
        executor(all, artefacts, store_of_results, run_context, std::move(observer)) {}
  const std::vector<Stage>& stages;
  Store& store;
  const RunContext& context;
  ArtefactTable artefacts;
  StageExecutor executor;
  bool has_run = false;
};

GraphRun::GraphRun(const std::vector<Stage>& stages, Store& store, const RunContext& context,
                   StageObserver observer)
    : parts_(std::make_unique<Parts>(stages, store, context, std::move(observer))) {}
GraphRun::~GraphRun() = default;

void GraphRun::give_object(const ArtefactName& artefact, Object object, const Sha256& digest,
                           std::uint64_t bytes, std::vector<std::pair<std::string, std::string>> parts) {
  parts_->artefacts.give(artefact, std::move(object), digest, bytes, std::move(parts));
}

void GraphRun::explain(StageKeys earlier, StageExplainer explainer) {
  parts_->executor.explain(std::move(earlier), std::move(explainer));
}

StageKeys GraphRun::keys() const { return parts_->executor.keys(); }
Notes GraphRun::notes() const { return parts_->executor.notes(); }

/// False while an input is unknown.
bool GraphRun::forecast_stage(const Stage& stage, StageExplanation& explanation) {
  ArtefactTable& artefacts = parts_->artefacts;
  if (!artefacts.first_unknown_input(stage).empty()) return false;
  const Key key = artefacts.key_of(stage);
  if (!stage.stored) {
    artefacts.publish_key(stage, key.digest());
    return true;
  }
  using Verdict = StageExplanation::Verdict;
  const auto blobs = look_for_results(parts_->store, stage, key.digest());
  if (blobs) artefacts.publish_blobs(stage, *blobs);
  explanation = parts_->executor.explanation_of(stage, key, blobs ? Verdict::kHit : Verdict::kRuns);
  return true;
}

std::vector<std::pair<const Stage*, StageExplanation>> GraphRun::forecast() {
  const std::vector<Stage>& stages = parts_->stages;
  std::vector<StageExplanation> explanations(stages.size());
  std::vector<bool> is_forecast(stages.size(), false);
  // The table is in the order of the graph only by custom: go round until nothing new becomes known.
  for (bool progress = true; progress;) {
    progress = false;
    for (std::size_t i = 0; i < stages.size(); ++i)
      if (!is_forecast[i] && forecast_stage(stages[i], explanations[i])) is_forecast[i] = progress = true;
  }
  std::vector<std::pair<const Stage*, StageExplanation>> all;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (!is_forecast[i]) {
      explanations[i].verdict = StageExplanation::Verdict::kUnknown;
      explanations[i].waits_for = parts_->artefacts.first_unknown_input(stages[i]);
    }
    if (stages[i].stored) all.emplace_back(&stages[i], std::move(explanations[i]));
  }
  return all;
}

Object GraphRun::run_object(const ArtefactName& wanted) {
  Parts& p = *parts_;
  if (std::exchange(p.has_run, true)) throw std::logic_error("a graph runs once");
  p.artefacts.check_type(wanted);
  p.artefacts.add_use(wanted.name);
  StageScheduler scheduler(
      p.stages.size(), [&p](std::size_t i) { return p.artefacts.first_unknown_input(p.stages[i]).empty(); },
      [&p](std::size_t i) {
        p.executor.bring_up_to_date(i);
        if (p.stages[i].stored) p.artefacts.release_inputs(p.stages[i]);
        return_free_memory();
      });
  scheduler.run_all(std::clamp(p.context.threads, 1, kMostThreads));
  if (const auto left = scheduler.tasks_not_run(); !left.empty())
    throw std::logic_error("stage " + p.stages[left.front()].name + " waits for an input that nothing gives");
  return p.executor.fetch(wanted.name);
}

}  // namespace texmesh
