#include "pipeline/batch/fleet/run_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "pipeline/batch/fleet/json_lines.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/markup.h"

namespace texmesh {
namespace {

using SummaryJson = nlohmann::ordered_json;

SummaryJson shard_json(const Shard& s) { return {{"index", s.index}, {"count", s.count}}; }

SummaryJson model_json(const ModelSummary& m) {
  SummaryJson j{{"model", m.model},
                {"output", m.output},
                {"package", m.package},
                {"result", enum_name(m.result)},
                {"ran", m.ran},
                {"bytes", m.bytes},
                {"seconds", m.seconds},
                {"peak_memory_bytes", m.peak_memory_bytes},
                {"stages_ran", m.stages_ran},
                {"stages_from_cache", m.stages_hit}};
  if (m.made_s > 0) j["made"] = {{"seconds", m.made_s}, {"peak_memory_bytes", m.made_memory_bytes}};
  if (!m.error.kind.empty())
    j["error"] = {{"kind", m.error.kind},         {"file", m.error.file},   {"place", m.error.place},
                  {"expected", m.error.expected}, {"found", m.error.found}, {"message", m.error.message}};
  return j;
}

class SummaryReader {
 public:
  explicit SummaryReader(const std::string& file) : file_(file) {}

  RunSummary read(const SummaryJson& j) {
    if (!j.is_object() || j.value("version", SummaryJson()) != 1 || !j.contains("models") ||
        !j["models"].is_array() || !j.contains("compiled"))
      fail("", "a summary of texmesh compile, version 1", "another document");
    RunSummary s;
    s.seconds = number(j, "", "seconds");
    if (j.contains("shard")) s.shard = shard(j["shard"], "/shard");
    s.models_in_collection = static_cast<std::size_t>(whole(j, "", "models_in_collection", 0));
    s.collection = j.contains("collection") ? text(j, "", "collection") : "";
    s.models.reserve(j["models"].size());
    for (const SummaryJson& m : j["models"])
      s.models.push_back(model(m, "/models/" + std::to_string(s.models.size())));
    if (j.contains("parts")) read_parts(j["parts"], s);
    return s;
  }

 private:
  [[noreturn]] void fail(const std::string& place, const std::string& expected,
                         const std::string& found) const {
    throw InputError(file_, place, expected, found.substr(0, 120));
  }
  const SummaryJson& member(const SummaryJson& j, const std::string& place, const char* key) const {
    if (!j.is_object() || !j.contains(key)) fail(place + "/" + key, "a value", "nothing");
    return j[key];
  }
  std::string text(const SummaryJson& j, const std::string& place, const char* key) const {
    const SummaryJson& v = member(j, place, key);
    if (!v.is_string()) fail(place + "/" + key, "a text", v.type_name());
    return v.get<std::string>();
  }
  double number(const SummaryJson& j, const std::string& place, const char* key) const {
    const SummaryJson& v = member(j, place, key);
    if (!v.is_number() || !(v.get<double>() >= 0 && v.get<double>() <= 1e12))
      fail(place + "/" + key, "a number from 0", v.dump());
    return v.get<double>();
  }
  std::uint64_t whole(const SummaryJson& j, const std::string& place, const char* key,
                      std::optional<std::uint64_t> otherwise = {}) const {
    if (otherwise && !j.contains(key)) return *otherwise;
    const SummaryJson& v = member(j, place, key);
    if (!v.is_number_unsigned()) fail(place + "/" + key, "a whole number from 0", v.dump());
    return v.get<std::uint64_t>();
  }

  Shard shard(const SummaryJson& j, const std::string& place) const {
    const std::uint64_t index = whole(j, place, "index"), count = whole(j, place, "count");
    if (count < 1 || count > 1'000'000 || index >= count) fail(place, "index below count", j.dump());
    return {static_cast<int>(index), static_cast<int>(count)};
  }

  ModelSummary model(const SummaryJson& j, const std::string& place) const {
    ModelSummary m;
    m.model = text(j, place, "model");
    m.output = text(j, place, "output");
    m.package = text(j, place, "package");
    const auto& names = EnumNames<ModelResult>::names;
    const std::string result = text(j, place, "result");
    const auto name = std::find(names.begin(), names.end(), result);
    if (name == names.end()) fail(place + "/result", "a result", result);
    m.result = static_cast<ModelResult>(name - names.begin());
    m.ran = member(j, place, "ran") == true;
    m.bytes = whole(j, place, "bytes");
    m.seconds = number(j, place, "seconds");
    m.peak_memory_bytes = whole(j, place, "peak_memory_bytes");
    m.stages_ran = static_cast<int>(std::min<std::uint64_t>(whole(j, place, "stages_ran"), 1'000'000));
    m.stages_hit = static_cast<int>(std::min<std::uint64_t>(whole(j, place, "stages_from_cache"), 1'000'000));
    if (j.contains("made")) {
      m.made_s = number(j["made"], place + "/made", "seconds");
      m.made_memory_bytes = whole(j["made"], place + "/made", "peak_memory_bytes");
    }
    if (j.contains("error")) {
      const SummaryJson& e = j["error"];
      const std::string at = place + "/error";
      m.error.kind = text(e, at, "kind"), m.error.file = text(e, at, "file");
      m.error.place = text(e, at, "place"), m.error.expected = text(e, at, "expected");
      m.error.found = text(e, at, "found"), m.error.message = text(e, at, "message");
    }
    return m;
  }

  /// What was merged before is merged again like any other summary; its parts stay known.
  void read_parts(const SummaryJson& list, RunSummary& s) const {
    if (!list.is_array()) fail("/parts", "a list", list.type_name());
    for (const SummaryJson& j : list) {
      const std::string place = "/parts/" + std::to_string(s.parts.size());
      SummaryPart part{text(j, place, "file"),
                       {},
                       static_cast<std::size_t>(whole(j, place, "models")),
                       number(j, place, "seconds")};
      if (j.contains("shard")) part.shard = shard(j["shard"], place + "/shard");
      s.parts.push_back(std::move(part));
    }
  }

  const std::string& file_;
};

}  // namespace

SummaryCounts count_results(const std::vector<ModelSummary>& models) {
  SummaryCounts c;
  for (const ModelSummary& m : models)
    ++(m.result == ModelResult::kOk          ? c.compiled
       : m.result == ModelResult::kUnchanged ? c.unchanged
       : m.result == ModelResult::kCancelled ? c.cancelled
                                             : c.failed);
  return c;
}

RunSummary summarize_run(const BatchPlan& plan, const std::vector<WorkerReport>& reports, double seconds) {
  RunSummary s;
  s.seconds = seconds;
  if (plan.shard.count > 1) s.shard = plan.shard;
  s.models_in_collection = plan.models_in_collection;
  s.collection = plan.collection;
  s.models.reserve(plan.models.size());
  for (std::size_t i = 0; i < plan.models.size(); ++i) {
    const PlannedModel& m = plan.models[i];
    const WorkerReport& r = reports[i];
    s.models.push_back({std::string(m.name()), m.output, package_within(plan, m), r.result, r.ran,
                        r.package_bytes, r.peak_memory_bytes, r.seconds, r.stages_ran, r.stages_hit, r.made_s,
                        r.made_memory_bytes, r.more->error});
  }
  return s;
}

std::string write_summary(const RunSummary& s) {
  const SummaryCounts c = count_results(s.models);
  SummaryJson head{{"version", 1},       {"compiled", c.compiled},   {"unchanged", c.unchanged},
                   {"failed", c.failed}, {"cancelled", c.cancelled}, {"seconds", s.seconds}};
  if (s.shard) head["shard"] = shard_json(*s.shard);
  if (!s.collection.empty()) {
    head["models_in_collection"] = s.models_in_collection;
    head["collection"] = s.collection;
  }
  for (const SummaryPart& p : s.parts) {
    SummaryJson part{{"file", p.file}, {"models", p.models}, {"seconds", p.seconds}};
    if (p.shard) part["shard"] = shard_json(*p.shard);
    head["parts"].push_back(std::move(part));
  }
  for (const SummaryProblem& p : s.problems)
    head["problems"].push_back({{"file", p.file}, {"kind", p.kind}, {"text", p.text}});
  return json_with_lines(head, "models", s.models, model_json);
}

std::string write_junit(const RunSummary& s) {
  const SummaryCounts c = count_results(s.models);
  std::string out = fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n"
      "<testsuite name=\"texmesh compile\" tests=\"{}\" failures=\"{}\" errors=\"0\" skipped=\"{}\" "
      "time=\"{:.3f}\">\n",
      s.models.size(), c.failed, c.cancelled, s.seconds);
  for (const ModelSummary& m : s.models) {
    out += fmt::format("<testcase classname=\"texmesh\" name=\"{}\" time=\"{:.3f}\"", markup_escaped(m.model),
                       m.seconds);
    out += fmt::format(
        ">\n<properties><property name=\"result\" value=\"{}\"/><property name=\"output\" value=\"{}\"/>"
        "<property name=\"bytes\" value=\"{}\"/><property name=\"peak_memory_bytes\" value=\"{}\"/>"
        "<property name=\"stages_ran\" value=\"{}\"/><property name=\"stages_from_cache\" value=\"{}\"/>"
        "</properties>\n",
        enum_name(m.result), markup_escaped(m.output), m.bytes, m.peak_memory_bytes, m.stages_ran,
        m.stages_hit);
    if (m.result == ModelResult::kCancelled)
      out += "<skipped message=\"not reached\"/>\n";
    else if (!m.ok())
      out += fmt::format("<failure type=\"{}\" message=\"{}\"/>\n", markup_escaped(m.error.kind),
                         markup_escaped(m.error.message));
    out += "</testcase>\n";
  }
  return out + "</testsuite>\n</testsuites>\n";
}

RunSummary read_summary(std::span<const std::uint8_t> bytes, const std::string& file) {
  return SummaryReader(file).read(parse_bounded_json(bytes, file, 8));
}

std::map<std::string, double> recorded_costs_s(const RunSummary& summary) {
  std::map<std::string, double> costs;
  for (const ModelSummary& m : summary.models)
    if (m.cost_s() > 0) costs[m.package] = m.cost_s();
  return costs;
}

int exit_code_of(ModelResult result, const std::string& error_kind) {
  switch (result) {
    case ModelResult::kOk:
    case ModelResult::kUnchanged:
      return kExitOk;
    case ModelResult::kCancelled:
      return kExitTryAgain;
    case ModelResult::kInternal:
      return kExitInternal;
    case ModelResult::kFailed:
      break;
  }
  return error_kind == "resource" ? kExitTryAgain : kExitModelFailed;
}

int graver_exit_code(int a, int b) {
  for (const int code : {kExitInternal, kExitTryAgain, kExitModelFailed})
    if (a == code || b == code) return code;
  return kExitOk;
}

}  // namespace texmesh
