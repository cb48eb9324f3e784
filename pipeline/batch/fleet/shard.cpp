// Which part of a collection is one run's: as it is told, or as a batch system numbers its tasks.
#include "pipeline/batch/fleet/shard.h"

#include <optional>
#include <vector>

#include "format/base/errors.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

constexpr int kMaxShards = 1'000'000;
constexpr const char* kFlag = "--shard";

/// What one batch system says.
struct TaskNumber {
  std::string found;  // for messages: "SLURM_ARRAY_TASK_ID=3 SLURM_ARRAY_TASK_COUNT=8"
  int index = 0;
  std::optional<int> count;
};

class TaskReader {
 public:
  explicit TaskReader(const EnvironmentLookup& environment) : environment_(environment) {}

  bool has(const char* name) const {
    const char* text = environment_(name);
    return text != nullptr && *text != '\0';
  }
  /// The variable's number, and its text for messages.
  int number(const char* name) {
    const std::string text = environment_(name);
    found_ += (found_.empty() ? "" : " ") + std::string(name) + "=" + text;
    const std::optional<int> value = whole_number<int>(text);
    if (!value || *value < 0) throw InputError(kFlag, name, "a number from 0", text);
    return *value;
  }
  std::optional<int> number_if_set(const char* name) {
    return has(name) ? std::optional(number(name)) : std::nullopt;
  }
  const std::string& found() const { return found_; }

 private:
  const EnvironmentLookup& environment_;
  std::string found_;
};

/// Tasks of an array are numbered from MIN in steps. An array of which some tasks run again ("3,5") looks
/// like a smaller one: its numbers have gaps or begin elsewhere, and are refused.
TaskNumber slurm_task(const EnvironmentLookup& environment) {
  TaskReader read(environment);
  TaskNumber task;
  const int id = read.number("SLURM_ARRAY_TASK_ID");
  task.count = read.number_if_set("SLURM_ARRAY_TASK_COUNT");
  const int least = read.number_if_set("SLURM_ARRAY_TASK_MIN").value_or(0);
  const std::optional<int> most = read.number_if_set("SLURM_ARRAY_TASK_MAX");
  const int step = read.number_if_set("SLURM_ARRAY_TASK_STEP").value_or(1);
  task.found = read.found();
  const bool whole = least <= 1 && step >= 1 && id >= least && (id - least) % step == 0;
  if (!whole || (most && (*most < id || !task.count || (*most - least) / step + 1 != *task.count)))
    throw InputError(kFlag, "", "an array that begins at 0 or 1 and leaves no task out (or --shard I/N)",
                     task.found);
  task.index = (id - least) / step;
  return task;
}

std::vector<TaskNumber> tasks_of(const EnvironmentLookup& environment) {
  std::vector<TaskNumber> tasks;
  if (TaskReader(environment).has("SLURM_ARRAY_TASK_ID")) tasks.push_back(slurm_task(environment));
  for (const auto& [index, count] :
       {std::pair{"AWS_BATCH_JOB_ARRAY_INDEX", "AWS_BATCH_JOB_ARRAY_SIZE"}, {"JOB_COMPLETION_INDEX", ""}}) {
    TaskReader read(environment);
    if (!read.has(index)) continue;
    TaskNumber task;
    task.index = read.number(index);
    if (*count != '\0') task.count = read.number_if_set(count);
    task.found = read.found();
    tasks.push_back(std::move(task));
  }
  return tasks;
}

/// "auto" and, where it is told, the number of shards.
Shard task_shard(const std::optional<int>& told, const EnvironmentLookup& environment) {
  const std::vector<TaskNumber> tasks = tasks_of(environment);
  if (tasks.empty())
    throw InputError(kFlag, "",
                     "SLURM_ARRAY_TASK_ID, AWS_BATCH_JOB_ARRAY_INDEX or JOB_COMPLETION_INDEX, or --shard I/N",
                     "none of them set");
  std::string found;
  std::optional<int> count = told;
  bool agree = true;
  for (const TaskNumber& task : tasks) {
    found += (found.empty() ? "" : ", ") + task.found;
    agree = agree && task.index == tasks[0].index && (!count || !task.count || *count == *task.count);
    if (!count) count = task.count;
  }
  if (told) found += ", --shard auto/" + std::to_string(*told);
  if (!agree) throw InputError(kFlag, "", "numbers that agree", found);
  if (!count) throw InputError(kFlag, "", "the number of shards: --shard auto/N", found);
  if (*count < 1 || *count > kMaxShards || tasks[0].index >= *count)
    throw InputError(kFlag, "", "a task in 0 .. N - 1 of N", found);
  return {tasks[0].index, *count};
}

}  // namespace

Shard read_shard(const std::string& text, const EnvironmentLookup& environment) {
  if (text == "auto") return task_shard(std::nullopt, environment);
  const std::size_t slash = text.find('/');
  const std::string_view before = std::string_view(text).substr(0, slash);
  const std::optional<int> count =
      slash == std::string::npos ? std::nullopt : whole_number<int>(std::string_view(text).substr(slash + 1));
  if (count && *count >= 1 && *count <= kMaxShards) {
    if (before == "auto") return task_shard(count, environment);
    const std::optional<int> index = whole_number<int>(before);
    if (index && *index >= 0 && *index < *count) return {*index, *count};
  }
  throw InputError(kFlag, "", "I/N with I in 0 .. N - 1, auto, or auto/N", text);
}

}  // namespace texmesh
