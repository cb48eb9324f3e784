#include "pipeline/batch/write_reports.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/batch/depfile.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/batch/reports.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

void write_text(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  if (is_special_file(path)) return write_output_file(path, text_bytes(text));
  remove_stale_temporaries(fs::path(path).parent_path().string(), fs::path(path).filename().string());
  if (!file_holds(path, text_bytes(text))) write_output_file(path, text_bytes(text));
}

std::vector<std::string> dependencies(const BatchPlan& plan, const RunSettings& settings,
                                      const WorkerReport& report) {
  const fs::path folder = fs::path(plan.models[0].input).parent_path();
  std::vector<std::string> all;
  for (const FileRequest& f : report.more->files)
    if (f.found) all.push_back(f.uri.empty() ? plan.models[0].input : (folder / f.uri).string());
  all.insert(all.end(), settings.more_inputs.begin(), settings.more_inputs.end());
  return all;
}

void check_report(const std::string& path) {
  if (path.empty() || is_special_file(path)) return;
  const std::string folder = fs::path(path).parent_path().string();
  if (fs::is_directory(path) || ::access(folder.empty() ? "." : folder.c_str(), W_OK) != 0)
    throw InputError(path, "", "a file that can be written",
                     fs::is_directory(path) ? "a folder" : std::strerror(errno));
}

}  // namespace

void check_reports(const BatchPlan& plan, const RunSettings& settings) {
  for (const std::string* path : {&settings.summary, &settings.junit, &settings.trace, &settings.depfile})
    check_report(*path);
  if (!settings.depfile.empty()) write_depfile(plan.models.at(0).output, {plan.models[0].input});
}

bool write_reports(const BatchPlan& plan, const RunSettings& settings,
                   const std::vector<WorkerReport>& reports, double seconds) {
  bool all_written = true;
  const auto write = [&](const std::string& path, auto&& text) {
    try {
      if (!path.empty()) write_text(path, text());
    } catch (const InputError& e) {
      std::cerr << "texmesh compile: " << e.what() << '\n';
      all_written = false;
    }
  };
  write(settings.summary, [&] { return write_summary(summarize_run(plan, reports, seconds)); });
  write(settings.junit, [&] { return write_junit(summarize_run(plan, reports, seconds)); });
  write(settings.trace, [&] { return write_trace(plan.models, reports); });
  if (settings.statistics && settings.mode != OutputMode::kJson) std::cout << write_statistics(reports);
  if (!settings.depfile.empty() && reports[0].ok())
    write(settings.depfile,
          [&] { return write_depfile(plan.models[0].output, dependencies(plan, settings, reports[0])); });
  return all_written;
}

}  // namespace texmesh
