#include "pipeline/compile/workers/worker_messages.h"

#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// The layers of a job; null stands for one that is left out, so that their numbers stay.
Json layers_of(const CacheSettings& cache, const std::set<std::string>& left_out) {
  Json layers = Json::array();
  for (const std::string& place : cache.layers)
    layers.push_back(left_out.contains(place) ? Json() : Json(to_wire(place)));
  return layers;
}

void apply_stage_event(const Json& e, double now_s, WorkerReport& report) {
  const std::string stage = e.value("stage", "");
  if (e.value("event", "") == "stage-started") {
    report.more->spans.push_back({stage, now_s, now_s, false, true});
    return;
  }
  const bool hit = e.value("result", "") == "hit";
  ++(hit ? report.stages_hit : report.stages_ran);
  const auto open = std::find_if(report.more->spans.rbegin(), report.more->spans.rend(),
                                 [&](const StageSpan& s) { return s.stage == stage; });
  if (hit || open == report.more->spans.rend()) {
    report.more->spans.push_back({stage, now_s, now_s, hit});
  } else {
    open->end_s = now_s;
    open->running = false;
  }
}

void apply_inputs_event(const Json& e, WorkerReport& report) {
  report.more->files = files_from_json(e.value("files", ""));
  from_hex(e.value("package", ""), report.package_digest);
  const Json keys = e.value("keys", Json::object());
  for (const auto& [stage, key] : keys.items())
    if (Sha256 digest; key.is_string() && from_hex(key.get<std::string>(), digest))
      report.more->keys[stage] = digest;
}

bool apply_object(const Json& e, double now_s, WorkerReport& report) {
  const std::string event = e.value("event", "");
  if (event == "inputs") {
    apply_inputs_event(e, report);
    return false;
  }
  if (event == "layer-left-out") {
    report.more->layers_left_out.push_back(e.value("layer", -1));
    return false;
  }
  if (event == "stage-started" || event == "stage-finished") {
    apply_stage_event(e, now_s, report);
  } else if (event == "result") {
    report.package_bytes = e.value("bytes", std::uint64_t{0});
    report.result = e.value("unchanged", false) ? ModelResult::kUnchanged : ModelResult::kOk;
  } else if (event == "error") {
    report.more->error = {e.value("kind", ""),     e.value("file", ""),  e.value("place", ""),
                          e.value("expected", ""), e.value("found", ""), e.value("message", "")};
  }
  return true;
}

}  // namespace

std::string job_to_json(const WorkerJob& job, const std::string& temporary, const WorkerLimits& limits,
                        int threads, const std::set<std::string>& layers_left_out) {
  Json keys = Json::object();
  for (const auto& [stage, key] : job.earlier_keys) keys[stage] = to_hex(key);
  return Json{{"input", to_wire(job.input)},
              {"output", to_wire(job.output)},
              {"temporary", to_wire(temporary)},
              {"profile", *job.profile},
              {"cache", to_wire(job.cache.folder)},
              {"layers", layers_of(job.cache, layers_left_out)},
              {"upload", job.cache.upload},
              {"strict", job.strict},
              {"parent", ::getpid()},
              {"explain", job.explain},
              {"forecast", job.forecast},
              {"known", files_to_json(job.known)},
              {"keys", keys},
              {"threads", threads},
              {"wall_s", limits.wall_s},
              {"memory_bytes", limits.memory_bytes},
              {"cpu_s", limits.cpu_s},
              {"sandbox", enum_name(limits.sandbox)}}
      .dump();
}

bool apply_event(const std::string& line, double now_s, WorkerReport& report) {
  const Json e = Json::parse(line, nullptr, false);
  if (!e.is_object()) return true;
  try {
    return apply_object(e, now_s, report);
  } catch (const Json::exception&) {  // of a value: a text where a number belongs
    return true;
  }
}

std::string error_event(const WorkerReport& r) {
  const ModelError& e = r.more->error;
  return Json{{"event", "error"},       {"kind", e.kind},   {"file", e.file},      {"place", e.place},
              {"expected", e.expected}, {"found", e.found}, {"message", e.message}}
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string files_to_json(const std::vector<FileRequest>& files) {
  Json list = Json::array();
  for (const FileRequest& r : files)
    list.push_back({to_wire(r.uri), r.found, to_hex(r.digest), r.bytes, r.stamp.device, r.stamp.inode,
                    r.stamp.bytes, r.stamp.modified_ns, r.stamp.changed_ns});
  return list.dump();
}

std::vector<FileRequest> files_from_json(const std::string& json) {
  std::vector<FileRequest> files;
  const Json list = Json::parse(json, nullptr, false);
  if (!list.is_array()) return files;
  for (const Json& j : list) {
    FileRequest r;
    const auto is_number = [](const Json& n) { return n.is_number_integer(); };
    if (!j.is_array() || j.size() != 9 || !j[0].is_string() || !j[1].is_boolean() || !j[2].is_string() ||
        !from_hex(j[2].get<std::string>(), r.digest) || !std::all_of(j.begin() + 3, j.end(), is_number))
      continue;
    r.uri = from_wire(j[0].get<std::string>());
    r.found = j[1].get<bool>();
    r.bytes = j[3].get<std::uint64_t>();
    r.stamp = {j[4].get<std::uint64_t>(), j[5].get<std::uint64_t>(), j[6].get<std::uint64_t>(),
               j[7].get<std::int64_t>(), j[8].get<std::int64_t>()};
    files.push_back(std::move(r));
  }
  return files;
}

}  // namespace texmesh
