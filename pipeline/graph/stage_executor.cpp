#include "pipeline/graph/stage_executor.h"

#include <chrono>
#include <stdexcept>

namespace texmesh {

StageExecutor::StageExecutor(const std::vector<Stage>& stages, ArtefactTable& artefacts, Store& store,
                             const RunContext& context, StageObserver observer)
    : stages_(stages),
      artefacts_(artefacts),
      store_(store),
      context_(context),
      observer_(std::move(observer)),
      states_(stages.size()) {}

void StageExecutor::explain(StageKeys earlier, StageExplainer explainer) {
  earlier_keys_ = std::move(earlier);
  explainer_ = std::move(explainer);
}

StageExplanation StageExecutor::explanation_of(const Stage& stage, const Key& key,
                                               StageExplanation::Verdict verdict) const {
  return explain_key(stage, key, verdict, earlier_keys_, store_);
}

void StageExecutor::bring_up_to_date(std::size_t index) {
  const std::lock_guard exclusive(states_[index].running);
  const Stage& stage = stages_[index];
  const Key key = artefacts_.key_of(stage);
  if (!stage.stored) {
    artefacts_.publish_key(stage, key.digest());
    return;
  }
  if (find_in_store(index, key)) return;
  // Another process may be computing this very key: wait for it, then look again.
  const std::unique_ptr<Claim> claim = store_.claim(key.digest(), context_);
  if (claim && find_in_store(index, key)) return;
  explain_verdict(index, key, StageExplanation::Verdict::kRuns);
  run_and_store(index);
}

bool StageExecutor::find_in_store(std::size_t index, const Key& key) {
  auto found = find_results(store_, stages_[index], key.digest());
  if (!found) return false;
  publish(index, key.digest(), std::move(found->blobs), found->notes);
  explain_verdict(index, key, StageExplanation::Verdict::kHit);
  notify(stages_[index], StageEvent::kHit);
  return true;
}

Object StageExecutor::fetch(const std::string& artefact) {
  const ArtefactTable::Origin origin = artefacts_.origin_of(artefact);
  if (origin.stage == ArtefactTable::kGiven) {
    if (Object given = artefacts_.object(artefact)) return given;
    throw std::logic_error("artefact " + artefact + " was not given");
  }
  StageState& state = states_[origin.stage];
  const std::lock_guard exclusive(state.running);
  if (Object at_hand = artefacts_.object(artefact)) return at_hand;
  const Stage& stage = stages_[origin.stage];
  if (stage.stored && !state.blobs.empty()) {
    const LoadedResult loaded = load_result(store_, stage, origin.output, state.key, state.blobs);
    artefacts_.keep(artefact, loaded.object);
    if (loaded.object) return loaded.object;
    if (loaded.is_rejected) state.blobs.clear();
  }
  if (!stage.stored || !state.blobs.empty()) return run(origin.stage).objects[origin.output];
  // The store held something else under the key: the right results replace it.
  Object object = run_and_store(origin.stage).objects[origin.output];
  publish_keys_of_derived_data();
  return object;
}

StageResult StageExecutor::run(std::size_t index) {
  const Stage& stage = stages_[index];
  RunContext context = context_;
  context.progress = [&](double fraction) { notify(stage, StageEvent::kProgress, fraction); };
  std::vector<Object> inputs;
  for (const ArtefactName& input : stage.inputs) inputs.push_back(fetch(input.name));
  context.check_cancelled();
  notify(stage, StageEvent::kStarted);
  const auto start = std::chrono::steady_clock::now();
  StageResult result = stage.run(inputs, context);
  notify(stage, StageEvent::kRan, 1,
         std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  for (std::size_t k = 0; k < stage.outputs.size(); ++k)
    artefacts_.keep(stage.outputs[k].name, result.objects.at(k));
  states_[index].notes = result.notes;
  return result;
}

StageResult StageExecutor::run_and_store(std::size_t index) {
  const Stage& stage = stages_[index];
  StageResult result = run(index);
  // An input that the store turned out to hold wrongly has another digest now.
  const Key key = artefacts_.key_of(stage);
  publish(index, key.digest(), put_results(store_, stage, key, result), result.notes);
  return result;
}

void StageExecutor::publish(std::size_t index, const Sha256& key, std::vector<StoredBlob> blobs,
                            const Notes& notes) {
  artefacts_.publish_blobs(stages_[index], blobs);
  StageState& state = states_[index];
  state.key = key;
  state.has_key = true;
  state.blobs = std::move(blobs);
  state.notes = notes;
}

/// After a stage has got other digests than it seemed to have, derived data behind it has another key.
void StageExecutor::publish_keys_of_derived_data() {
  for (const Stage& stage : stages_)
    if (!stage.stored && artefacts_.is_known(stage.outputs.front().name))
      artefacts_.publish_key(stage, artefacts_.key_of(stage).digest());
}

void StageExecutor::explain_verdict(std::size_t index, const Key& key, StageExplanation::Verdict verdict) {
  states_[index].key = key.digest();
  states_[index].has_key = true;
  if (!explainer_) return;
  const StageExplanation e = explanation_of(stages_[index], key, verdict);
  const std::lock_guard lock(observer_mutex_);
  explainer_(stages_[index], e);
}

void StageExecutor::notify(const Stage& stage, StageEvent event, double fraction, double seconds) {
  if (!observer_) return;
  const std::lock_guard lock(observer_mutex_);
  observer_(stage, event, fraction, seconds);
}

StageKeys StageExecutor::keys() const {
  StageKeys keys;
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    const std::lock_guard exclusive(states_[i].running);
    if (states_[i].has_key) keys[stages_[i].name] = states_[i].key;
  }
  return keys;
}

Notes StageExecutor::notes() const {
  Notes all;
  for (const StageState& state : states_) {
    const std::lock_guard exclusive(state.running);
    all.insert(all.end(), state.notes.begin(), state.notes.end());
  }
  return all;
}

}  // namespace texmesh
