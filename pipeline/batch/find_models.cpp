#include "pipeline/batch/find_models.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>

#include "format/errors.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

bool is_model(const fs::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return std::tolower(c); });
  return e == ".glb" || e == ".gltf" || e == ".obj" || e == ".ply" || e == ".stl" ||
         (e == ".json" && is_range_scan(path.string()));
}

struct Found {
  fs::path path, relative;
};

void add_folder(const fs::path& folder, std::vector<Found>& found) {
  for (const std::string& relative : list_models(folder.string()))
    found.push_back({folder / relative, relative});
}

}  // namespace

bool is_range_scan(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  return head.find("\"cylindrical-range-scan\"") != std::string::npos;
}

std::vector<std::string> list_models(const std::string& folder) {
  std::error_code ec;
  fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied, ec), end;
  if (ec) throw InputError(folder, "", "a folder with models", ec.message());
  std::vector<std::string> models;
  const std::size_t prefix = folder.ends_with('/') ? folder.size() : folder.size() + 1;
  for (; it != end; it.increment(ec)) {
    if (ec) throw InputError(folder, "", "a folder that can be listed", ec.message());
    const std::string path = it->path().string();
    if (it->path().filename().string().front() == '.') continue;
    if (is_model(it->path()) && it->is_regular_file()) models.push_back(path.substr(prefix));
  }
  if (models.empty()) throw InputError(folder, "", "a folder with models", "none");
  std::sort(models.begin(), models.end(),
            [](const std::string& a, const std::string& b) { return fs::path(a) < fs::path(b); });
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
      found.push_back({input, fs::path(input).filename()});
    }
  }
  const bool one_file = inputs.size() == 1 && !any_folder && fs::path(output).extension() == ".texmesh" &&
                        !fs::is_directory(output);
  if (one_file) return {{inputs[0], output}};
  if (fs::path(output).extension() == ".texmesh" && !fs::is_directory(output))
    throw InputError(output, "", "a folder for the packages of several models", "the name of one package");

  std::map<fs::path, int> sharing;
  auto package_of = [&](const Found& f) {
    return fs::path(output) / fs::path(f.relative).replace_extension(".texmesh");
  };
  for (const Found& f : found) ++sharing[package_of(f)];
  std::vector<ModelPath> models;
  std::map<fs::path, fs::path> taken;
  for (const Found& f : found) {
    fs::path package = package_of(f);
    if (sharing[package] > 1) package = fs::path(output) / (f.relative.string() + ".texmesh");
    const auto [other, fresh] = taken.emplace(package, f.path);
    if (!fresh)
      throw InputError(f.path.string(), "", "a package of its own",
                       package.string() + ", which is that of " + other->second.string());
    models.push_back({f.path.string(), package.string()});
  }
  return models;
}

}  // namespace texmesh
