#include "pipeline/graph/graph_run.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <set>
#include <thread>

#include "format/base/errors.h"
#include "pipeline/compile/library_versions.h"

namespace texmesh {
namespace {

constexpr std::size_t kOutside = static_cast<std::size_t>(-1);

std::vector<KeyChange> changes_between(const Key& before, const Key& after) {
  const auto find = [](const Key& key, const std::string& label) -> const std::string* {
    for (const auto& [l, value] : key.parts())
      if (l == label) return &value;
    return nullptr;
  };
  std::vector<KeyChange> changes;
  for (const auto& [label, value] : before.parts()) {
    const std::string* now = find(after, label);
    if (!now || *now != value) changes.push_back({label, value, now ? *now : ""});
  }
  for (const auto& [label, value] : after.parts())
    if (!find(before, label)) changes.push_back({label, "", value});
  return changes;
}

/// Whether a field belongs to what a stage lists: a whole section or that very field.
bool names_field(const std::vector<std::string>& listed, const OptionField& field) {
  return std::any_of(listed.begin(), listed.end(),
                     [&](const std::string& l) { return l == field.stage || l == field.path(); });
}

}  // namespace

/// The order of locks, outermost first: `schedule`; the `running` of a stage, held while that stage is looked
/// up, loaded or run, so that no stage runs twice at once however many results it has; then one of `mutex`,
/// `observer_mutex` and the store's own. Whoever holds the `running` of a stage takes only those of stages
/// before it, whose results it reads. The graph has no circle, so no two threads wait for each other.
/// `schedule` is never held while a `running` is taken.
struct GraphRun::State {
  struct Slot {                       // one artefact
    std::size_t producer = kOutside;  // index into nodes
    std::size_t output = 0;
    Object object;
    Sha256 digest{};
    std::uint64_t bytes = 0;
    std::vector<std::pair<std::string, std::string>> parts;  // see give()
    bool known = false;                                      // digest stands
    int uses_left = 0;
  };
  struct Node {
    const Stage* stage = nullptr;
    Sha256 key{};                   // of blobs
    std::vector<StoredBlob> blobs;  // of a stored stage that is up to date
    Notes notes;
    bool done = false;
    std::exception_ptr error;
    std::shared_ptr<std::mutex> running = std::make_shared<std::mutex>();  // see the order of locks
  };

  State(const std::vector<Stage>& stages, const CompileOptions& opts, Store& st, const RunContext& ctx,
        StageObserver obs)
      : options(opts), store(st), context(ctx), observer(std::move(obs)) {
    for (std::size_t i = 0; i < stages.size(); ++i) {
      nodes.emplace_back().stage = &stages[i];
      for (std::size_t k = 0; k < stages[i].outputs.size(); ++k) {
        Slot& slot = slots[stages[i].outputs[k].name];
        slot.producer = i;
        slot.output = k;
      }
    }
    for (const Stage& s : stages)
      for (const std::string& input : s.inputs) ++slots[input].uses_left;
  }

  /// What has changed since the earlier run that is known, if one is.
  StageExplanation explanation_of(const Stage& stage, const Key& key, StageExplanation::Verdict verdict) {
    StageExplanation e;
    e.verdict = verdict;
    const auto earlier = earlier_keys.find(stage.name);
    if (earlier == earlier_keys.end()) return e;
    if (earlier->second == key.digest()) {
      e.has_history = true;
      return e;
    }
    const auto preimage = store.preimage(earlier->second);
    const auto before = preimage ? key_from_preimage(*preimage) : std::nullopt;
    if (!before) return e;
    e.has_history = true;
    e.changes = changes_between(*before, key);
    return e;
  }

  void tell_why(const Stage& stage, const Key& key, StageExplanation::Verdict verdict) {
    {
      const std::lock_guard lock(mutex);
      keys[stage.name] = key.digest();
    }
    if (!explainer) return;
    const StageExplanation e = explanation_of(stage, key, verdict);
    const std::lock_guard lock(observer_mutex);
    explainer(stage, e);
  }

  void notify(const Stage& stage, StageEvent event, double fraction = 0, double seconds = 0) {
    if (!observer) return;
    const std::lock_guard lock(observer_mutex);
    observer(stage, event, fraction, seconds);
  }

  Key key_of(const Stage& stage) {
    Key key(stage.name, stage.version);
    CompileOptions copy = options;
    for (const OptionField& f : list_options(copy))
      if (names_field(stage.options, f)) key.add("option " + f.path(), option_text(f));
    for (const std::string& library : stage.libraries)
      key.add("library " + library, library_versions().at(library));
    const std::lock_guard lock(mutex);
    for (const std::string& input : stage.inputs) {
      const Slot& slot = slots.at(input);
      if (slot.parts.empty()) key.add_input(input, slot.digest, slot.bytes);
      for (const auto& [label, value] : slot.parts) key.add(label, value);
    }
    return key;
  }

  bool is_ready(const Stage& stage) const {
    return std::all_of(stage.inputs.begin(), stage.inputs.end(),
                       [&](const std::string& i) { return slots.at(i).known; });
  }

  /// The object of an artefact: at hand, from the store, or by running its stage (again).
  Object fetch(const std::string& name) {
    Slot* slot = nullptr;
    {
      const std::lock_guard lock(mutex);
      slot = &slots.at(name);
    }
    if (slot->producer == kOutside) {
      if (!slot->object) throw std::logic_error("artefact " + name + " was not given");
      return slot->object;
    }
    Node& node = nodes[slot->producer];
    const std::lock_guard exclusive(*node.running);
    {
      const std::lock_guard lock(mutex);
      if (slot->object) return slot->object;
    }
    if (Object stored = object_from_store(node, slot->output)) {
      const std::lock_guard lock(mutex);
      return slot->object = std::move(stored);
    }
    const bool is_rejected = [&] {
      const std::lock_guard lock(mutex);
      return node.stage->stored && node.blobs.empty();
    }();
    if (is_rejected) {
      compute_and_store(node);
      publish_derived_again();
    } else {
      execute(node);
    }
    const std::lock_guard lock(mutex);
    return slot->object;
  }

  /// Null where the store has lost it, or holds something else under its key: that is rejected.
  Object object_from_store(Node& node, std::size_t output) {
    std::vector<StoredBlob> blobs;
    {
      const std::lock_guard lock(mutex);
      blobs = node.blobs;
    }
    if (!node.stage->stored || blobs.empty()) return nullptr;
    const SharedBytes bytes = store.load(blobs.at(output));
    if (!bytes) return nullptr;
    try {
      return node.stage->outputs[output].decode(*bytes);
    } catch (const Error& e) {
      store.reject(node.key, blobs, e.what());
      const std::lock_guard lock(mutex);
      if (node.blobs == blobs) node.blobs.clear();
      return nullptr;
    }
  }

  /// Runs a stage's function on fetched inputs; leaves its objects in their slots.
  StageOutputs execute(Node& node) {
    const Stage& stage = *node.stage;
    RunContext own = context;
    own.progress = [&](double fraction) { notify(stage, StageEvent::kProgress, fraction); };
    StageInputs inputs(options, own);
    for (const std::string& input : stage.inputs) inputs.objects[input] = fetch(input);
    context.check_cancelled();
    notify(stage, StageEvent::kStarted);
    const auto start = std::chrono::steady_clock::now();
    StageOutputs outputs = stage.run(inputs);
    notify(stage, StageEvent::kRan, 1,
           std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    const std::lock_guard lock(mutex);
    for (std::size_t k = 0; k < outputs.objects.size(); ++k)
      slots.at(stage.outputs[k].name).object = outputs.objects[k];
    node.notes = outputs.notes;
    return outputs;
  }

  void publish_digest(const std::string& name, const Sha256& digest, std::uint64_t bytes) {
    const std::lock_guard lock(mutex);
    Slot& slot = slots.at(name);
    slot.digest = digest;
    slot.bytes = bytes;
    slot.known = true;
  }

  /// Brings one stage up to date.
  void settle(Node& node) {
    const std::lock_guard exclusive(*node.running);
    const Stage& stage = *node.stage;
    const Key key = key_of(stage);
    if (!stage.stored) {  // derived: its key stands for its bytes, and it runs when somebody fetches it
      for (const Artefact& a : stage.outputs) publish_digest(a.name, key.digest(), 0);
      return;
    }
    if (take_from_store(node, key)) return;
    // Whoever else computes this very key: wait for it, then look again.
    std::unique_ptr<Claim> claim = store.claim(key.digest(), context);
    if (claim && take_from_store(node, key)) return;
    tell_why(stage, key, StageExplanation::Verdict::kRuns);
    compute_and_store(node);
  }

  bool take_from_store(Node& node, const Key& key) {
    const Stage& stage = *node.stage;
    auto blobs = store.find(key.digest());
    if (!blobs) return false;
    if (blobs->size() != stage.outputs.size() + 1) {
      store.reject(key.digest(), *blobs, std::to_string(blobs->size()) + " results");
      return false;
    }
    const SharedBytes bytes = store.load(blobs->back());
    if (!bytes) return false;
    Notes notes;
    try {
      notes = decode_artefact<Notes>(*bytes, stage.name + ".notes");
    } catch (const Error& e) {
      store.reject(key.digest(), *blobs, e.what());
      return false;
    }
    settle_node(node, key, *blobs, notes);
    tell_why(stage, key, StageExplanation::Verdict::kHit);
    notify(stage, StageEvent::kHit);
    return true;
  }

  /// What stands for a stage in the keys of those after it.
  void settle_node(Node& node, const Key& key, std::vector<StoredBlob> blobs, const Notes& notes) {
    const Stage& stage = *node.stage;
    for (std::size_t k = 0; k < stage.outputs.size(); ++k)
      publish_digest(stage.outputs[k].name, blobs[k].digest, blobs[k].bytes);
    const std::lock_guard lock(mutex);
    node.key = keys[stage.name] = key.digest();
    node.blobs = std::move(blobs);
    node.notes = notes;
  }

  /// Derived data's keys, after a stage before it has got other digests than it seemed to have.
  void publish_derived_again() {
    for (const Node& node : nodes) {
      const Stage& stage = *node.stage;
      {
        const std::lock_guard lock(mutex);
        if (stage.stored || !slots.at(stage.outputs.front().name).known) continue;
      }
      const Sha256 key = key_of(stage).digest();
      for (const Artefact& a : stage.outputs) publish_digest(a.name, key, 0);
    }
  }

  void compute_and_store(Node& node) {
    const Stage& stage = *node.stage;
    StageOutputs outputs = execute(node);
    const Key key = key_of(stage);  // an input that turned out to be none has another digest now
    std::vector<std::pair<std::string, SharedBytes>> encoded;
    for (std::size_t k = 0; k < stage.outputs.size(); ++k)
      encoded.emplace_back(stage.outputs[k].name, std::make_shared<const std::vector<std::uint8_t>>(
                                                      stage.outputs[k].encode(outputs.objects[k].get())));
    encoded.emplace_back(stage.name + ".notes",
                         std::make_shared<const std::vector<std::uint8_t>>(encode_artefact(outputs.notes)));
    store.put(key, encoded);
    std::vector<StoredBlob> blobs;
    for (const auto& [name, bytes] : encoded) blobs.push_back({name, sha256(*bytes), bytes->size()});
    settle_node(node, key, std::move(blobs), outputs.notes);
  }

  /// Counts down the uses of a stage's inputs. Derived data holds on to its own inputs until its last use is
  /// over: it may still have to be computed from them.
  void release_inputs(const Stage& stage) {
    const std::lock_guard lock(mutex);
    release_locked(stage);
  }
  void release_locked(const Stage& stage) {
    for (const std::string& input : stage.inputs) {
      Slot& slot = slots.at(input);
      if (--slot.uses_left > 0 || slot.producer == kOutside) continue;
      slot.object.reset();
      const Stage& producer = *nodes[slot.producer].stage;
      if (!producer.stored) release_locked(producer);
    }
  }

  /// One worker: takes the first ready stage of the table until none is left.
  void work() {
    std::unique_lock lock(schedule);
    for (;;) {
      std::size_t pick = nodes.size();
      bool any_left = false;
      for (std::size_t i = 0; i < nodes.size() && pick == nodes.size(); ++i) {
        if (taken.contains(i)) continue;
        any_left = true;
        const std::lock_guard state(mutex);
        if (is_ready(*nodes[i].stage)) pick = i;
      }
      if (!any_left || failed) return;
      if (pick == nodes.size()) {
        if (running == 0) return;  // a cycle or an artefact nobody gives: run() reports it
        wake.wait(lock);
        continue;
      }
      taken.insert(pick);
      ++running;
      lock.unlock();
      try {
        settle(nodes[pick]);
        if (nodes[pick].stage->stored) release_inputs(*nodes[pick].stage);
      } catch (...) {
        nodes[pick].error = std::current_exception();
      }
      lock.lock();
      --running;
      nodes[pick].done = !nodes[pick].error;
      failed = failed || nodes[pick].error;
      wake.notify_all();
    }
  }

  const CompileOptions& options;
  Store& store;
  const RunContext& context;
  StageObserver observer;
  StageExplainer explainer;
  StageKeys earlier_keys, keys;
  std::vector<Node> nodes;
  std::map<std::string, Slot> slots;
  std::mutex mutex, observer_mutex, schedule;
  std::condition_variable wake;
  std::set<std::size_t> taken;
  int running = 0;
  bool failed = false;
};

GraphRun::GraphRun(const std::vector<Stage>& stages, const CompileOptions& options, Store& store,
                   const RunContext& context, StageObserver observer)
    : state_(std::make_unique<State>(stages, options, store, context, std::move(observer))) {}
GraphRun::~GraphRun() = default;

void GraphRun::give(const std::string& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
                    std::vector<std::pair<std::string, std::string>> parts) {
  State::Slot& slot = state_->slots[artefact];
  slot.object = std::move(object);
  slot.digest = digest;
  slot.bytes = bytes;
  slot.parts = std::move(parts);
  slot.known = true;
}

void GraphRun::explain(StageKeys earlier, StageExplainer explainer) {
  state_->earlier_keys = std::move(earlier);
  state_->explainer = std::move(explainer);
}

StageKeys GraphRun::keys() const {
  const std::lock_guard lock(state_->mutex);
  return state_->keys;
}

std::vector<std::pair<const Stage*, StageExplanation>> GraphRun::forecast() {
  State& s = *state_;
  std::vector<std::pair<const Stage*, StageExplanation>> all(s.nodes.size());
  // The table is in the order of the graph only by custom: go round until nothing new becomes known.
  for (bool progress = true; progress;) {
    progress = false;
    for (std::size_t i = 0; i < s.nodes.size(); ++i) {
      const Stage& stage = *s.nodes[i].stage;
      if (all[i].first || !s.is_ready(stage)) continue;
      progress = true;
      const Key key = s.key_of(stage);
      if (!stage.stored) {
        for (const Artefact& a : stage.outputs) s.publish_digest(a.name, key.digest(), 0);
        all[i] = {&stage, {}};
        continue;
      }
      const auto blobs = s.store.find(key.digest());
      const bool hit = blobs && blobs->size() == stage.outputs.size() + 1;
      for (std::size_t k = 0; hit && k < stage.outputs.size(); ++k)
        s.publish_digest(stage.outputs[k].name, (*blobs)[k].digest, (*blobs)[k].bytes);
      all[i] = {&stage,
                s.explanation_of(stage, key,
                                 hit ? StageExplanation::Verdict::kHit : StageExplanation::Verdict::kRuns)};
    }
  }
  for (std::size_t i = 0; i < s.nodes.size(); ++i) {
    if (all[i].first) continue;
    const Stage& stage = *s.nodes[i].stage;
    StageExplanation e;
    e.verdict = StageExplanation::Verdict::kUnknown;
    for (const std::string& input : stage.inputs)
      if (e.waits_for.empty() && !s.slots.at(input).known) e.waits_for = input;
    all[i] = {&stage, e};
  }
  std::erase_if(all, [](const auto& a) { return !a.first->stored; });
  return all;
}

Object GraphRun::run(const std::string& wanted) {
  ++state_->slots.at(wanted).uses_left;
  std::vector<std::thread> workers;
  const int extra = std::clamp(state_->context.threads, 1, 4) - 1;
  for (int i = 0; i < extra; ++i) workers.emplace_back([this] { state_->work(); });
  state_->work();
  for (std::thread& w : workers) w.join();
  for (const State::Node& node : state_->nodes)
    if (node.error) std::rethrow_exception(node.error);
  for (const State::Node& node : state_->nodes)
    if (!node.done)
      throw std::logic_error("stage " + node.stage->name + " waits for an input that nothing gives");
  return state_->fetch(wanted);
}

Notes GraphRun::notes() const {
  Notes all;
  for (const State::Node& node : state_->nodes) all.insert(all.end(), node.notes.begin(), node.notes.end());
  return all;
}

}  // namespace texmesh
