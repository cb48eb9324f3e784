#include "pipeline/batch/find_models.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>

#include "format/base/errors.h"
#include "pipeline/batch/repeated_texts.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

bool may_be_model(const fs::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return std::tolower(c); });
  return e == ".glb" || e == ".gltf" || e == ".obj" || e == ".ply" || e == ".stl" || e == ".json";
}

// Texts, not fs::path: taking a thousand paths apart again and again took a sixth of a run that does nothing.
struct Found {
  std::string path;
  std::size_t relative = 0;  // where the path within the input begins
  bool unread = false;
};

/// The order of fs::path: by parts, so that a folder's files stand together.
bool path_less(std::string_view a, std::string_view b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    const auto rank = [](char c) { return c == '/' ? 0 : static_cast<unsigned char>(c) + 1; };
    return rank(x) < rank(y);
  });
}

}  // namespace

bool is_json(const std::string& path) {
  constexpr std::string_view kEnd = ".json";
  return path.size() > kEnd.size() &&
         std::ranges::equal(std::string_view(path).substr(path.size() - kEnd.size()), kEnd, {},
                            [](unsigned char c) { return std::tolower(c); });
}

bool is_range_scan(const std::string& path) {
  std::error_code ec;
  if (!fs::is_regular_file(path, ec)) return false;  // to open a FIFO is to wait
  std::ifstream in(path, std::ios::binary);
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  return head.find("\"cylindrical-range-scan\"") != std::string::npos;
}

namespace {

std::size_t prefix_bytes(const std::string& folder) {
  return folder.size() + (folder.ends_with('/') ? 0 : 1);
}

/// Paths as this process can open them, in the order of list_models().
std::vector<std::string> model_paths(const std::string& folder) {
  std::error_code ec;
  fs::recursive_directory_iterator it(folder, ec), end;
  if (ec) throw InputError(folder, "", "a folder with models", ec.message());
  std::vector<std::string> models;
  while (it != end) {
    std::string path = it->path().string();
    if (it->path().filename().string().front() == '.')
      it.disable_recursion_pending();
    else if (it->is_regular_file(ec) && may_be_model(it->path()))
      models.push_back(path);
    it.increment(ec);  // a folder that is left out without a word is a collection without its models
    if (ec) throw InputError(path, "", "a folder that can be listed", ec.message());
  }
  std::sort(models.begin(), models.end(),
            [same = prefix_bytes(folder)](std::string_view a, std::string_view b) {
              return path_less(a.substr(same), b.substr(same));
            });
  if (std::ranges::all_of(models, is_json) && std::ranges::none_of(models, is_range_scan))
    throw InputError(folder, "", "a folder with models", "none");
  return models;
}

}  // namespace

std::vector<std::string> list_models(const std::string& folder) {
  std::vector<std::string> models = model_paths(folder);
  for (std::string& path : models) path.erase(0, prefix_bytes(folder));
  return models;
}

std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output) {
  std::vector<Found> found;
  bool any_folder = false;
  for (const std::string& input : inputs) {
    if (fs::is_directory(input)) {
      any_folder = true;
      for (std::string& path : model_paths(input)) {
        const bool unread = is_json(path);
        found.push_back({std::move(path), prefix_bytes(input), unread});
      }
    } else {
      found.push_back({input, input.size() - fs::path(input).filename().string().size()});
    }
  }
  const bool one_file = inputs.size() == 1 && !any_folder && fs::path(output).extension() == ".texmesh" &&
                        !fs::is_directory(output);
  if (one_file) return {{inputs[0], output}};
  if (fs::path(output).extension() == ".texmesh" && !fs::is_directory(output))
    throw InputError(output, "", "a folder for the packages of several models", "the name of one package");

  const std::string prefix = (fs::path(output) / "").string();
  std::vector<ModelPath> models;
  models.reserve(found.size());
  for (Found& f : found) {
    const std::size_t slash = f.path.rfind('/') + 1, dot = f.path.rfind('.');
    const bool extension = dot != std::string::npos && dot > std::max(slash, f.relative);
    const std::string_view relative = std::string_view(f.path).substr(f.relative);
    std::string package = prefix;
    package.reserve(prefix.size() + relative.size() + 8);  // of 100,000, what growing leaves free counts
    package.append(relative.substr(0, extension ? dot - f.relative : relative.npos)).append(".texmesh");
    models.push_back({std::move(f.path), std::move(package), f.unread});
  }
  std::map<std::string_view, int> others;  // by shared package: its files that are not unread
  const auto shared = repeated_texts(models, [](const ModelPath& m) { return std::string_view(m.output); });
  for (const ModelPath& m : models)
    if (shared.contains(m.output)) others[m.output] += m.unread ? 0 : 1;
  std::vector<std::size_t> longer;
  for (const ModelPath& m : models)
    if (const auto it = others.find(m.output); it != others.end() && (m.unread || it->second > 1))
      longer.push_back(static_cast<std::size_t>(&m - models.data()));
  for (const std::size_t i : longer)
    models[i].output = prefix + models[i].input.substr(found[i].relative) + ".texmesh";
  return models;
}

}  // namespace texmesh
