#pragma once
#include <memory>
#include <string>
#include <typeindex>
#include <utility>

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

}  // namespace texmesh
