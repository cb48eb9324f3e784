#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <typeindex>
#include <utility>
#include <vector>

#include "format/base/archive.h"
#include "format/base/bytes.h"
#include "format/base/note.h"
#include "pipeline/graph/option_text.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// The value of an artefact whose type the graph does not know.
using Object = std::shared_ptr<const void>;

/// The handle of an artefact: its name, and its type for the compiler. Whoever makes or reads the artefact
/// goes by the one handle, so both mean the same type:
///   inline constexpr Artefact<ConditionedMesh> kConditioned{"condition"};
template <class T>
struct Artefact {
  const char* name;  // "condition", or "stage.part" where a stage has several results
};

/// The same for the graph, which compares types where stages are joined.
struct ArtefactName {
  template <class T>
  explicit ArtefactName(Artefact<T> artefact) : name(artefact.name), type(typeid(T)) {}
  std::string name;
  std::type_index type;
};

template <class T>
Object make_object(T value) {
  return std::make_shared<const T>(std::move(value));
}

/// One result of a stage, and how it gets into and out of the store; the functions are empty for derived
/// data.
struct StageOutput : ArtefactName {
  std::function<Bytes(const void*)> encode;
  std::function<ArtefactDigest(const void*)> digest;  // of these bytes, where nobody keeps them
  std::function<Object(ByteSpan)> decode;             // throws FormatError
};

/// Options that a stage reads: a whole section ("ssf") or a single field ("ladder.mode").
struct StageOption {
  std::string name;
  OptionTexts fields;  // "ssf.scales": "20", for the key
};

/// A library whose version changes the stage's bytes.
struct StageLibrary {
  std::string name, version;
};

/// What a stage's function gives.
struct StageResult {
  std::vector<Object> objects;  // in the order of Stage::outputs
  Notes notes;
};

/// One node of the graph, as make_stage() makes it. Its key consists of name, version, options, libraries and
/// the digests of its inputs; `run` has the options inside and gets nothing but its inputs.
struct Stage {
  std::string name;
  int version = 1;
  std::string summary;    // one line for `texmesh compile --stages`
  double time_share = 0;  // of a model's time, about: it only shapes the progress bar
  std::vector<ArtefactName> inputs;
  std::vector<StageOutput> outputs;
  std::vector<StageOption> options;
  std::vector<StageLibrary> libraries;
  bool stored = true;  // false: derived data, computed when somebody needs it, never kept
  std::function<StageResult(std::span<const Object> inputs, const RunContext& context)> run;
};

enum class StageEvent : std::uint8_t { kStarted, kProgress, kHit, kRan };

/// Told from any thread, one call at a time. `fraction` is 0..1 for kProgress; `seconds` is wall time of
/// kRan.
using StageObserver =
    std::function<void(const Stage& stage, StageEvent event, double fraction, double seconds)>;

}  // namespace texmesh
