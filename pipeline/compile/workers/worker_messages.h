#pragma once
#include <set>
#include <string>
#include <vector>

#include "pipeline/compile/workers/worker.h"

namespace texmesh {

// What the parent and a worker tell each other: a job as JSON on the worker's standard input, event lines
// (schemas/event.v1.schema.json, and some for the parent alone) on its standard output.

/// The job of a worker. A layer that is left out is null, so that the others keep their numbers.
std::string job_to_json(const WorkerJob& job, const std::string& temporary, const WorkerLimits& limits,
                        int threads, const std::set<std::string>& layers_left_out);

/// Enters what an event says about the model into the report. False when the event is for the parent alone.
/// A line that is no event, or has values of other types, is passed on and believed no further: whoever has
/// taken over a child writes what he likes.
bool apply_event(const std::string& line, double now_s, WorkerReport& report);

/// The event line of a report's error.
std::string error_event(const WorkerReport& report);

/// How files travel; what is malformed is left out.
std::string files_to_json(const std::vector<FileRequest>& files);
std::vector<FileRequest> files_from_json(const std::string& json);

}  // namespace texmesh
