#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/graph/key.h"
#include "pipeline/graph/stage.h"
#include "pipeline/graph/store.h"

namespace texmesh {

/// One labelled part of a key that has changed; "" where the key had, or has, no such part.
struct KeyChange {
  std::string label, from, to;
};

/// Why a stage is run or not.
struct StageExplanation {
  enum class Verdict : std::uint8_t {
    kHit,      // the result is in the store
    kRuns,     // the result is not in the store
    kUnknown,  // forecasts only: depends on the result of an earlier stage that runs
  };
  Verdict verdict = Verdict::kHit;
  bool has_history = false;        // a key of an earlier run of this stage for this model is known
  std::vector<KeyChange> changes;  // against that key, in the order of its parts; empty where nothing changed
  std::string waits_for;           // kUnknown: the artefact
};
using StageExplainer = std::function<void(const Stage& stage, const StageExplanation& explanation)>;

/// Compares a stage's key with the key of an earlier run, whose parts the store remembers.
StageExplanation explain_key(const Stage& stage, const Key& key, StageExplanation::Verdict verdict,
                             const StageKeys& earlier, Store& store);

}  // namespace texmesh
