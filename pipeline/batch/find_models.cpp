#include "pipeline/batch/find_models.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <unordered_map>

#include "format/base/errors.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

bool is_model(const fs::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return std::tolower(c); });
  return e == ".glb" || e == ".gltf" || e == ".obj" || e == ".ply" || e == ".stl" ||
         (e == ".json" && is_range_scan(path.string()));
}

// Texts, not fs::path: taking a thousand paths apart again and again took a sixth of a run that does nothing.
struct Found {
  std::string path, relative;
};

/// The order of fs::path: by parts, so that a folder's files stand together.
bool path_less(const std::string& a, const std::string& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    const auto rank = [](char c) { return c == '/' ? 0 : static_cast<unsigned char>(c) + 1; };
    return rank(x) < rank(y);
  });
}

void add_folder(const std::string& folder, std::vector<Found>& found) {
  const std::string prefix = (fs::path(folder) / "").string();
  for (const std::string& relative : list_models(folder)) found.push_back({prefix + relative, relative});
}

}  // namespace

bool is_range_scan(const std::string& path) {
  std::error_code ec;
  if (!fs::is_regular_file(path, ec)) return false;  // to open a FIFO is to wait
  std::ifstream in(path, std::ios::binary);
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  return head.find("\"cylindrical-range-scan\"") != std::string::npos;
}

std::vector<std::string> list_models(const std::string& folder) {
  std::error_code ec;
  fs::recursive_directory_iterator it(folder, ec), end;
  if (ec) throw InputError(folder, "", "a folder with models", ec.message());
  std::vector<std::string> models;
  const std::size_t prefix = folder.ends_with('/') ? folder.size() : folder.size() + 1;
  while (it != end) {
    const std::string path = it->path().string();
    if (it->path().filename().string().front() == '.')
      it.disable_recursion_pending();
    else if (it->is_regular_file(ec) && is_model(it->path()))
      models.push_back(path.substr(prefix));
    it.increment(ec);  // a folder that is left out without a word is a collection without its models
    if (ec) throw InputError(path, "", "a folder that can be listed", ec.message());
  }
  if (models.empty()) throw InputError(folder, "", "a folder with models", "none");
  std::sort(models.begin(), models.end(), path_less);
  return models;
}

std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output) {
  std::vector<Found> found;
  bool any_folder = false;
  for (const std::string& input : inputs) {
    if (fs::is_directory(input)) {
      any_folder = true;
      add_folder(input, found);
    } else {
      found.push_back({input, fs::path(input).filename().string()});
    }
  }
  const bool one_file = inputs.size() == 1 && !any_folder && fs::path(output).extension() == ".texmesh" &&
                        !fs::is_directory(output);
  if (one_file) return {{inputs[0], output}};
  if (fs::path(output).extension() == ".texmesh" && !fs::is_directory(output))
    throw InputError(output, "", "a folder for the packages of several models", "the name of one package");

  const std::string prefix = (fs::path(output) / "").string();
  const auto package_of = [&](const Found& f) {
    const std::size_t slash = f.relative.rfind('/') + 1, dot = f.relative.rfind('.');
    const bool extension = dot != std::string::npos && dot > slash;
    return prefix + (extension ? f.relative.substr(0, dot) : f.relative) + ".texmesh";
  };
  std::unordered_map<std::string, int> sharing;
  sharing.reserve(found.size());
  for (const Found& f : found) ++sharing[package_of(f)];
  std::vector<ModelPath> models;
  models.reserve(found.size());
  std::unordered_map<std::string, std::string> taken;
  taken.reserve(found.size());
  for (const Found& f : found) {
    std::string package = package_of(f);
    if (sharing[package] > 1) package = prefix + f.relative + ".texmesh";
    const auto [other, fresh] = taken.emplace(package, f.path);
    if (!fresh)
      throw InputError(f.path, "", "a package of its own", package + ", which is that of " + other->second);
    models.push_back({f.path, std::move(package)});
  }
  return models;
}

}  // namespace texmesh
