#include "pipeline/compile/workers/worker_messages.h"

#include <nlohmann/json.hpp>

namespace texmesh {
namespace {

/// The event of the list whose name the line has.
template <class... E>
std::optional<std::variant<E...>> event_of(const Json& json, const std::variant<E...>*) {
  std::optional<std::variant<E...>> event;
  const auto name = json.find("event");
  if (name == json.end()) return event;
  const auto read = [&](const auto* type) {
    using Event = std::remove_cvref_t<decltype(*type)>;
    if (*name == Event::kEvent) event = from_json<Event>(json, "event");
  };
  (read(static_cast<const E*>(nullptr)), ...);
  return event;
}

template <class... Event>
Json one_of_events() {
  return Json{{"oneOf", Json::array({schema_of<Event>()...})}};
}

}  // namespace

std::optional<WorkerEvent> read_event(const std::string& line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  try {
    return event_of(json, static_cast<const WorkerEvent*>(nullptr));
  } catch (const InputError&) {
    return std::nullopt;
  }
}

DocumentSchema event_schema() {
  return document_schema(
      "event.v1", "texmesh log event, version 1",
      "One line of `texmesh compile --json`. Programs ignore events that they do not know.",
      one_of_events<ModelStarted, StageStarted, StageProgress, StageFinished, StageExplained, CacheTold,
                    NoteTold, ErrorTold, PackageMade, ModelFinished, RunFinished>());
}

}  // namespace texmesh
