// A run of the graph over one model, from below:
// - the results of one stage in a store: found, looked for, loaded, put;
// - Artefacts knows which artefacts are known, under which digests, and who still needs their objects;
// - StageExecutor brings single stages up to date by them, and explains what it does;
// - StageScheduler runs the stages that are ready side by side;
// - GraphRun joins these.
#include "pipeline/graph/graph_run.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

namespace texmesh {
namespace {

const std::string* find_part(const Key& key, const std::string& label) {
  for (const auto& [l, value] : key.parts())
    if (l == label) return &value;
  return nullptr;
}

std::vector<KeyChange> changes_between(const Key& before, const Key& after) {
  std::vector<KeyChange> changes;
  for (const auto& [label, value] : before.parts()) {
    const std::string* now = find_part(after, label);
    if (!now || *now != value) changes.push_back({label, value, now ? *now : ""});
  }
  for (const auto& [label, value] : after.parts())
    if (!find_part(before, label)) changes.push_back({label, "", value});
  return changes;
}

/// Compares a stage's key with the key of an earlier run, whose parts the store remembers.
StageExplanation explain_key(const Stage& stage, const Key& key, StageExplanation::Verdict verdict,
                             const StageKeys& earlier, Store& store) {
  StageExplanation e;
  e.verdict = verdict;
  const auto known = earlier.find(stage.name);
  if (known == earlier.end()) return e;
  if (known->second == key.digest()) {
    e.has_history = true;
    return e;
  }
  const auto preimage = store.preimage(known->second);
  const auto before = preimage ? key_from_preimage(*preimage) : std::nullopt;
  if (!before) return e;
  e.has_history = true;
  e.changes = changes_between(*before, key);
  return e;
}

// A stage's results in a store: one blob per output, and the stage's notes as the last blob. Blobs with the
// right key and digests that are no results of the stage all the same are rejected.

/// What a store has of one run of a stage.
struct FoundResults {
  std::vector<StoredBlob> blobs;  // of the outputs in their order, then of the notes
  Notes notes;
};

/// One result of a run that was found.
struct LoadedResult {
  Object object;             // null: the store has lost it
  bool is_rejected = false;  // the blob was no result; the store does not give this run again
};
/// Nothing where the store has no such run, or only some blobs of the run.
std::optional<FoundResults> find_results(Store& store, const Stage& stage, const Sha256& key) {
  auto blobs = store.find(key);
  if (!blobs) return std::nullopt;
  if (blobs->size() != stage.outputs.size() + 1) {
    store.reject(key, *blobs, std::to_string(blobs->size()) + " results");
    return std::nullopt;
  }
  const SharedBytes bytes = store.load(blobs->back());
  if (!bytes) return std::nullopt;
  FoundResults found;
  try {
    found.notes = decode_artefact<Notes>(*bytes, stage.name + ".notes");
  } catch (const Error& e) {
    store.reject(key, *blobs, e.what());
    return std::nullopt;
  }
  found.blobs = std::move(*blobs);
  return found;
}

/// The blobs of such a run, as far as the store can tell without loading anything; rejects nothing.
std::optional<std::vector<StoredBlob>> look_for_results(Store& store, const Stage& stage, const Sha256& key) {
  auto blobs = store.find(key);
  if (!blobs || blobs->size() != stage.outputs.size() + 1) return std::nullopt;
  return blobs;
}

LoadedResult load_result(Store& store, const Stage& stage, std::size_t output, const Sha256& key,
                         const std::vector<StoredBlob>& blobs) {
  const SharedBytes bytes = store.load(blobs.at(output));
  if (!bytes) return {};
  try {
    return {stage.outputs[output].decode(*bytes), false};
  } catch (const Error& e) {
    store.reject(key, blobs, e.what());
    return {nullptr, true};
  }
}

/// Puts a run into the store; returns its blobs.
std::vector<StoredBlob> put_results(Store& store, const Stage& stage, const Key& key,
                                    const StageResult& result) {
  std::vector<std::pair<std::string, SharedBytes>> encoded;
  std::vector<StoredBlob> blobs;
  const std::string notes = stage.name + ".notes";
  if (!store.keeps_results()) {
    const auto add = [&](const std::string& name, const ArtefactDigest& d) {
      blobs.push_back({name, d.digest, d.bytes});
    };
    for (std::size_t k = 0; k < stage.outputs.size(); ++k)
      add(stage.outputs[k].name, stage.outputs[k].digest(result.objects[k].get()));
    add(notes, digest_artefact(result.notes));
    return blobs;
  }
  const auto add = [&](const std::string& name, Bytes bytes) {
    blobs.push_back({name, sha256(bytes), bytes.size()});
    encoded.emplace_back(name, std::make_shared<const Bytes>(std::move(bytes)));
  };
  for (std::size_t k = 0; k < stage.outputs.size(); ++k)
    add(stage.outputs[k].name, stage.outputs[k].encode(result.objects[k].get()));
  add(notes, encode_artefact(result.notes));
  store.put(key, encoded);
  return blobs;
}

/// The artefacts of one run of a graph: of each, the stage that makes the artefact, the digest or parts that
/// stand for it in keys, and its object while a stage needs the object. Safe from several threads.
class Artefacts {
 public:
  static constexpr std::size_t kGiven = static_cast<std::size_t>(-1);
  /// Where an artefact comes from.
  struct Origin {
    std::size_t stage = kGiven;  // index into the stages; kGiven: from outside the graph
    std::size_t output = 0;      // of that stage
  };

  /// `stages` must outlive the table. Throws std::logic_error where an artefact is made twice, or is made as
  /// one type and read as another.
  explicit Artefacts(const std::vector<Stage>& stages) : stages_(stages) {
    for (std::size_t i = 0; i < stages.size(); ++i)
      for (std::size_t k = 0; k < stages[i].outputs.size(); ++k) {
        Slot& slot = slot_of(stages[i].outputs[k]);
        if (slot.origin.stage != kGiven)
          throw std::logic_error("artefact " + stages[i].outputs[k].name + " is made twice");
        slot.origin = {i, k};
      }
    for (const Stage& s : stages)
      for (const ArtefactName& input : s.inputs) ++slot_of(input).uses_left;
  }

  /// Takes an artefact from outside the graph. In keys `parts` stand for the artefact where there are any,
  /// else digest and bytes. Throws std::logic_error for another type than the stages read.
  void give(const ArtefactName& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
            std::vector<std::pair<std::string, std::string>> parts) {
    Slot& slot = slot_of(artefact);
    slot.object = std::move(object);
    slot.digest = digest;
    slot.bytes = bytes;
    slot.parts = std::move(parts);
    slot.known = true;
  }

  /// std::logic_error for an artefact of another type, or of no stage.
  void check_type(const ArtefactName& artefact) const {
    const auto it = slots_.find(artefact.name);
    if (it == slots_.end() || it->second.type != artefact.type)
      throw std::logic_error("no stage makes artefact " + artefact.name + " with this type");
  }
  Origin origin_of(const std::string& artefact) const { return slots_.at(artefact).origin; }

  /// From now on these stand for a stage's results in keys: the blobs that hold the results, or, for derived
  /// data, the stage's own key.
  void publish_blobs(const Stage& stage, const std::vector<StoredBlob>& blobs) {
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < stage.outputs.size(); ++k) {
      Slot& slot = slots_.at(stage.outputs[k].name);
      slot.digest = blobs.at(k).digest;
      slot.bytes = blobs[k].bytes;
      slot.known = true;
    }
  }
  void publish_key(const Stage& stage, const Sha256& key) {
    const std::lock_guard lock(mutex_);
    for (const StageOutput& output : stage.outputs) {
      Slot& slot = slots_.at(output.name);
      slot.digest = key;
      slot.bytes = 0;
      slot.known = true;
    }
  }

  bool is_known(const std::string& artefact) const {
    const std::lock_guard lock(mutex_);
    return slots_.at(artefact).known;
  }
  /// The first input that is not known yet; "" when all are known.
  std::string first_unknown_input(const Stage& stage) const {
    const std::lock_guard lock(mutex_);
    for (const ArtefactName& input : stage.inputs)
      if (!slots_.at(input.name).known) return input.name;
    return "";
  }
  /// All inputs must be known.
  Key key_of(const Stage& stage) const {
    Key key(stage.name, stage.version);
    for (const StageOption& option : stage.options)
      for (const auto& [path, text] : option.fields) key.add("option " + path, text);
    for (const StageLibrary& library : stage.libraries) key.add("library " + library.name, library.version);
    const std::lock_guard lock(mutex_);
    for (const ArtefactName& input : stage.inputs) {
      const Slot& slot = slots_.at(input.name);
      if (slot.parts.empty()) key.add_input(input.name, slot.digest, slot.bytes);
      for (const auto& [label, value] : slot.parts) key.add(label, value);
    }
    return key;
  }

  /// The object at hand, or null.
  Object object(const std::string& artefact) const {
    const std::lock_guard lock(mutex_);
    return slots_.at(artefact).object;
  }
  /// Keeps an object until the artefact's last use is over. An object without a further use is not kept.
  void keep(const std::string& artefact, Object object) {
    const std::lock_guard lock(mutex_);
    Slot& slot = slots_.at(artefact);
    if (slot.uses_left > 0) slot.object = std::move(object);
  }
  /// One more use of an artefact than the stages' own.
  void add_use(const std::string& artefact) {
    const std::lock_guard lock(mutex_);
    ++slots_.at(artefact).uses_left;
  }
  /// Ends a stage's uses of its inputs. The inputs of derived data are in use until the last use of the
  /// derived data, which may still have to be computed.
  void release_inputs(const Stage& stage) {
    const std::lock_guard lock(mutex_);
    release_inputs_locked(stage);
  }

 private:
  struct Slot {
    explicit Slot(const ArtefactName& artefact) : type(artefact.type) {}
    std::type_index type;
    Origin origin;
    int uses_left = 0;
    bool known = false;
    Sha256 digest{};
    std::uint64_t bytes = 0;
    std::vector<std::pair<std::string, std::string>> parts;  // see give()
    Object object;
  };
  Slot& slot_of(const ArtefactName& artefact) {
    Slot& slot = slots_.try_emplace(artefact.name, artefact).first->second;
    if (slot.type != artefact.type)
      throw std::logic_error("artefact " + artefact.name + " is read as another type than it is made");
    return slot;
  }
  void release_inputs_locked(const Stage& stage) {
    for (const ArtefactName& input : stage.inputs) {
      Slot& slot = slots_.at(input.name);
      if (--slot.uses_left > 0 || slot.origin.stage == kGiven) continue;
      slot.object.reset();
      const Stage& producer = stages_[slot.origin.stage];
      if (!producer.stored) release_inputs_locked(producer);
    }
  }

  const std::vector<Stage>& stages_;
  mutable std::mutex mutex_;           // of what changes inside the slots
  std::map<std::string, Slot> slots_;  // the map itself is complete before the run begins
};

/// Brings single stages of a graph up to date and fetches artefacts, from the store or by running stages.
/// Safe from several threads: a stage is never run by two of them at once, however many results it has.
///
/// The order of locks, outermost first: the `running` of a stage, held while that stage is looked up, loaded
/// or run; then one of those inside Artefacts, the store or this class. Whoever holds the `running` of a
/// stage takes only those of stages before it in the graph, whose results it reads. The graph has no circle,
/// so no two threads wait for each other.
class StageExecutor {
 public:
  /// All arguments must outlive the executor.
  StageExecutor(const std::vector<Stage>& stages, Artefacts& artefacts, Store& store,
                const RunContext& context, StageObserver observer)
      : stages_(stages),
        artefacts_(artefacts),
        store_(store),
        context_(context),
        observer_(std::move(observer)),
        states_(stages.size()) {}

  /// See GraphRun::explain.
  void explain(StageKeys earlier, StageExplainer explainer) {
    earlier_keys_ = std::move(earlier);
    explainer_ = std::move(explainer);
  }
  StageExplanation explanation_of(const Stage& stage, const Key& key,
                                  StageExplanation::Verdict verdict) const {
    return explain_key(stage, key, verdict, earlier_keys_, store_);
  }

  /// Makes the results of a stage known: finds the results in the store, or runs the stage and stores the
  /// results. Derived data is known by its key alone and computed by fetch(). All inputs must be known.
  void bring_up_to_date(std::size_t index) {
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

  /// The object of an artefact that is known: at hand, from the store, or by running its stage (again).
  Object fetch(const std::string& artefact) {
    const Artefacts::Origin origin = artefacts_.origin_of(artefact);
    if (origin.stage == Artefacts::kGiven) {
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

  /// Of the stages that have been looked at.
  StageKeys keys() const {
    StageKeys keys;
    for (std::size_t i = 0; i < stages_.size(); ++i) {
      const std::lock_guard exclusive(states_[i].running);
      if (states_[i].has_key) keys[stages_[i].name] = states_[i].key;
    }
    return keys;
  }
  /// Of all stages, in their order.
  Notes notes() const {
    Notes all;
    for (const StageState& state : states_) {
      const std::lock_guard exclusive(state.running);
      all.insert(all.end(), state.notes.begin(), state.notes.end());
    }
    return all;
  }

 private:
  struct StageState {  // guarded by `running`
    mutable std::mutex running;
    bool has_key = false;
    Sha256 key{};
    std::vector<StoredBlob> blobs;  // of a stored stage that is up to date
    Notes notes;
  };

  bool find_in_store(std::size_t index, const Key& key) {
    auto found = find_results(store_, stages_[index], key.digest());
    if (!found) return false;
    publish(index, key.digest(), std::move(found->blobs), found->notes);
    explain_verdict(index, key, StageExplanation::Verdict::kHit);
    notify(stages_[index], StageEvent::kHit);
    return true;
  }
  StageResult run(std::size_t index) {
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
  StageResult run_and_store(std::size_t index) {
    const Stage& stage = stages_[index];
    StageResult result = run(index);
    // An input that the store turned out to hold wrongly has another digest now.
    const Key key = artefacts_.key_of(stage);
    publish(index, key.digest(), put_results(store_, stage, key, result), result.notes);
    return result;
  }
  void publish(std::size_t index, const Sha256& key, std::vector<StoredBlob> blobs, const Notes& notes) {
    artefacts_.publish_blobs(stages_[index], blobs);
    StageState& state = states_[index];
    state.key = key;
    state.has_key = true;
    state.blobs = std::move(blobs);
    state.notes = notes;
  }
  /// After a stage has got other digests than it seemed to have, derived data behind it has another key.
  void publish_keys_of_derived_data() {
    for (const Stage& stage : stages_)
      if (!stage.stored && artefacts_.is_known(stage.outputs.front().name))
        artefacts_.publish_key(stage, artefacts_.key_of(stage).digest());
  }
  void explain_verdict(std::size_t index, const Key& key, StageExplanation::Verdict verdict) {
    states_[index].key = key.digest();
    states_[index].has_key = true;
    if (!explainer_) return;
    const StageExplanation e = explanation_of(stages_[index], key, verdict);
    const std::lock_guard lock(observer_mutex_);
    explainer_(stages_[index], e);
  }
  void notify(const Stage& stage, StageEvent event, double fraction = 0, double seconds = 0) {
    if (!observer_) return;
    const std::lock_guard lock(observer_mutex_);
    observer_(stage, event, fraction, seconds);
  }

  const std::vector<Stage>& stages_;
  Artefacts& artefacts_;
  Store& store_;
  const RunContext& context_;
  StageObserver observer_;
  StageExplainer explainer_;
  StageKeys earlier_keys_;
  std::vector<StageState> states_;
  std::mutex observer_mutex_;  // one call of observer or explainer at a time
};

/// Runs numbered tasks on several threads, each once, as soon as it is ready.
class StageScheduler {
 public:
  /// `is_ready` is called under the scheduler's lock, `run` is not. A task becomes ready only when another
  /// task ends.
  StageScheduler(std::size_t tasks, std::function<bool(std::size_t)> is_ready,
                 std::function<void(std::size_t)> run)
      : is_ready_(std::move(is_ready)), run_(std::move(run)), tasks_(tasks) {}

  /// Returns when all tasks have run. After a failure, or when no task is ready, returns as soon as the
  /// running tasks have ended. Rethrows the error of the first task that failed, by number.
  void run_all(int threads) {
    std::vector<std::thread> others;
    for (int i = 1; i < threads; ++i) others.emplace_back([this] { run_ready_tasks(); });
    run_ready_tasks();
    for (std::thread& t : others) t.join();
    for (const Task& task : tasks_)
      if (task.error) std::rethrow_exception(task.error);
  }

  /// Tasks that have not run because they never became ready.
  std::vector<std::size_t> tasks_not_run() const {
    std::vector<std::size_t> left;
    for (std::size_t i = 0; i < tasks_.size(); ++i)
      if (!tasks_[i].is_taken) left.push_back(i);
    return left;
  }

 private:
  struct Task {
    bool is_taken = false;
    std::exception_ptr error;
  };
  /// One thread: takes the first ready task until none is left.
  void run_ready_tasks() {
    std::unique_lock lock(mutex_);
    for (;;) {
      std::size_t next = tasks_.size();
      bool any_left = false;
      for (std::size_t i = 0; i < tasks_.size() && next == tasks_.size(); ++i) {
        if (tasks_[i].is_taken) continue;
        any_left = true;
        if (is_ready_(i)) next = i;
      }
      if (!any_left || has_failed_) return;
      if (next == tasks_.size()) {
        if (running_ == 0) return;  // a circle, or something that nobody gives
        task_ended_.wait(lock);
        continue;
      }
      tasks_[next].is_taken = true;
      ++running_;
      lock.unlock();
      std::exception_ptr error;
      try {
        run_(next);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      --running_;
      tasks_[next].error = error;
      has_failed_ = has_failed_ || error;
      task_ended_.notify_all();
    }
  }

  std::function<bool(std::size_t)> is_ready_;
  std::function<void(std::size_t)> run_;
  std::mutex mutex_;  // of what follows
  std::condition_variable task_ended_;
  std::vector<Task> tasks_;
  int running_ = 0;
  bool has_failed_ = false;
};

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
  const std::vector<Stage>& stages;
  Store& store;
  const RunContext& context;
  StageObserver observer;
  Artefacts artefacts{stages};
  StageExecutor executor{stages, artefacts, store, context, std::move(observer)};
  bool has_run = false;
};

GraphRun::GraphRun(const std::vector<Stage>& stages, Store& store, const RunContext& context,
                   StageObserver observer)
    : parts_(new Parts{stages, store, context, std::move(observer)}) {}
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
  Artefacts& artefacts = parts_->artefacts;
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
