#include "pipeline/batch/stale_packages.h"

#include <filesystem>
#include <fstream>
#include <unordered_map>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/resolver.h"

namespace texmesh {
namespace fs = std::filesystem;

std::vector<std::string> stale_packages(const BatchPlan& plan) {
  std::vector<std::string> stale;
  std::error_code ec;
  fs::recursive_directory_iterator it(plan.outputs, ec), end;
  if (ec) return stale;  // nothing has been made there
  std::unordered_map<std::string_view, const PlannedModel*> makers;
  for (const PlannedModel& m : plan.models)
    if (m.output.starts_with(plan.output_prefix))
      makers.emplace(std::string_view(m.output).substr(plan.output_prefix.size()), &m);
  const std::size_t prefix = (fs::path(plan.outputs) / "").native().size();
  for (; !ec && it != end; it.increment(ec)) {
    const std::string& path = it->path().native();
    if (path[path.rfind('/') + 1] == '.' || (it->is_directory(ec) && is_made_folder(it->path())))
      it.disable_recursion_pending();
    else if (path.ends_with(".texmesh") && it->is_regular_file(ec) && !it->is_symlink(ec)) {
      const auto maker = makers.find(std::string_view(path).substr(prefix));
      if (maker == makers.end() || (maker->second->unread && !holds_model(maker->second->input)))
        stale.push_back(path.substr(prefix));
    }
  }
  std::ranges::sort(stale);
  return stale;
}

void list_stale(const std::string& folder, const std::vector<std::string>& packages) {
  const std::string path = (fs::path(folder) / kStaleList).string();
  std::string text;
  for (const std::string& package : packages) text += package + "\n";
  std::error_code ec;
  if (text.empty())
    fs::remove(path, ec);  // most often there is none
  else if (!file_holds(path, text_bytes(text)))
    write_file_atomically(path, text_bytes(text));
}

std::set<std::string> listed_stale(const std::string& folder) {
  std::ifstream in(fs::path(folder) / kStaleList);
  std::set<std::string> out;
  for (std::string line; std::getline(in, line);)
    if (!line.empty()) out.insert(line);
  return out;
}

void remove_stale(const std::string& folder, const std::vector<std::string>& packages) {
  for (const std::string& package : packages) {
    const fs::path path = fs::path(folder) / package;
    std::error_code ec;
    if (!fs::remove(path, ec) && ec) fail_to_write(path.string(), "remove", ec.value());
  }
}

}  // namespace texmesh
