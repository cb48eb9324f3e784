#include "pipeline/graph/explanation.h"

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

}  // namespace

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

}  // namespace texmesh
