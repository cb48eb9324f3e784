#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "format/base/archive.h"
#include "format/base/note.h"
#include "pipeline/compile/options.h"
#include "stages/base/run_context.h"
#include "stages/data/uv_sets.h"

namespace texmesh {

using Object = std::shared_ptr<const void>;

/// One output of a stage: how to get it into and out of the store.
struct Artefact {
  std::string name;  // "condition", or "stage.part" where a stage has several outputs
  std::function<std::vector<std::uint8_t>(const void*)> encode;
  std::function<Object(std::span<const std::uint8_t>)> decode;
};

/// What a stage's adapter sees.
class StageInputs {
 public:
  StageInputs(const CompileOptions& all_options, const RunContext& run_context)
      : options(all_options), context(run_context) {}
  template <class T>
  const T& get(const std::string& artefact) const {
    return *static_cast<const T*>(objects.at(artefact).get());
  }

  const CompileOptions& options;
  const RunContext& context;
  std::map<std::string, Object> objects;
};

struct StageOutputs {
  std::vector<Object> objects;  // in the order of Stage::outputs
  Notes notes;
};

/// One node of the graph. `options` names what of CompileOptions the stage reads, as sections ("ssf") or
/// single fields
/// ("perceptual_values.jnd"); together with version, libraries and input digests that is its key.
struct Stage {
  std::string name;
  int version = 1;
  std::string summary;              // one line for `texmesh stages`
  std::vector<std::string> inputs;  // artefact names; "source" and "provenance" come from outside the graph
  std::vector<Artefact> outputs;
  std::vector<std::string> options;
  std::vector<std::string> libraries;  // whose versions change bytes; see library_versions.h
  bool stored = true;                  // false: derived data, computed when somebody needs it, never kept
  std::function<StageOutputs(const StageInputs&)> run;
};

template <class T>
Artefact artefact(std::string name) {
  Artefact a;
  a.name = name;
  a.encode = [](const void* p) { return encode_artefact(*static_cast<const T*>(p)); };
  a.decode = [name](std::span<const std::uint8_t> bytes) -> Object {
    return std::make_shared<const T>(decode_artefact<T>(bytes, name));
  };
  return a;
}
template <class T>
Object object(T value) {
  return std::make_shared<const T>(std::move(value));
}

/// What import hands on, apart from images and materials.
struct ImportedMesh {
  Mesh mesh;
  RangeGrid range;
  bool normals_by_specification = false;
  std::vector<UvSets> uv_sets;  // of the materials: no other change of theirs is one of the shapes
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.mesh, s.range, s.normals_by_specification, s.uv_sets);
  }
};

/// The artefact "source": the model file behind its import.
struct Source {
  std::function<ImportedModel(const RunContext&)> import;
};

/// The whole graph, in an order in which every input stands before its use. This is the one place where it
/// can be read.
const std::vector<Stage>& stage_table();

/// The stages of the table that `last` needs, directly or not, in the table's order, and `last` itself: for
/// commands that want to see what is in the middle of the graph.
std::vector<Stage> graph_towards(Stage last);

}  // namespace texmesh
