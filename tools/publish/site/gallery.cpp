#include "tools/publish/site/gallery.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "format/base/sha256.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "tools/publish/view/site.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostNameBytes = 100;

std::string in_lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::uint64_t bytes_beneath(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uint64_t bytes = 0;
  for (const fs::directory_entry& e : fs::recursive_directory_iterator(path))
    if (fs::is_regular_file(e.symlink_status())) bytes += e.file_size();
  return bytes;
}

std::string without_ending(std::string path) {
  if (path.ends_with("/")) path.pop_back();
  return path.ends_with(".texmesh") ? path.substr(0, path.size() - 8) : path;
}

void read_object(GalleryObject& object) {
  PackageReader package(open_store(object.source));
  const Manifest& m = package.manifest();
  object.about = package.about();
  object.title = m.title.empty() ? fs::path(without_ending(object.path)).filename().string() : m.title;
  object.bytes = bytes_beneath(object.source);
  object.start_bytes = start_bytes(m);
  object.triangles = m.scales.front().triangles;
  for (const TextureInfo& t : package.textures())
    object.texture_px = std::max({object.texture_px, t.width_px, t.height_px});
  if (!m.poster) return;
  object.poster = package.entry(*m.poster);
  object.poster_width_px = m.poster->width_px;
  object.poster_height_px = m.poster->height_px;
}

std::string address_of(const GalleryObject& object, const GalleryOptions& options) {
  if (!options.packages_url.empty()) return options.packages_url + percent_encoded(object.path);
  return "packages/" + object.name + (object.path.ends_with("/") ? "/" : ".texmesh");
}

}  // namespace

std::string gallery_name(const std::string& path, std::vector<std::string>& taken) {
  std::string name;
  for (const char c : without_ending(path)) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       c == '-' || c == '_' || c == '.';
    if (plain || name.empty() || name.back() != '-') name += plain ? c : '-';
  }
  name.resize(std::min(name.size(), kMostNameBytes));
  // A name that begins with a dot is hidden on servers.
  if (name.empty() || name.front() == '.' || std::ranges::find(taken, in_lower_case(name)) != taken.end()) {
    constexpr std::size_t kDigits = 10;
    name = "p" + name + "-" + to_hex(sha256(text_bytes(path))).substr(0, kDigits);
  }
  taken.push_back(in_lower_case(name));
  return name;
}

Gallery read_gallery(const std::string& packages, const GalleryOptions& options) {
  Gallery gallery{options, {}, {}};
  const PackageFolder folder = find_packages(packages);
  std::vector<std::string> taken;
  for (const std::string& path : folder.packages) {
    GalleryObject object;
    object.path = path;
    object.source = (fs::path(folder.path) / path).string();
    try {
      read_object(object);
    } catch (const InputError& error) {
      gallery.faults.push_back({path, error.what()});
      continue;
    } catch (const FormatError& error) {
      gallery.faults.push_back({path, error.what()});
      continue;
    }
    object.name = gallery_name(path, taken);
    object.address = address_of(object, options);
    gallery.objects.push_back(std::move(object));
  }
  std::ranges::sort(gallery.objects, {},
                    [](const GalleryObject& o) { return std::tuple(in_lower_case(o.title), o.path); });
  return gallery;
}

std::string gallery_json(const Gallery& gallery, const std::string& folder) {
  using Json = nlohmann::ordered_json;
  Json objects = Json::array(), faults = Json::array();
  for (const GalleryObject& o : gallery.objects)
    objects.push_back({{"package", o.path},
                       {"page", "objects/" + o.name + ".html"},
                       {"title", o.title},
                       {"bytes", o.bytes}});
  for (const GalleryFault& f : gallery.faults) faults.push_back({{"package", f.path}, {"error", f.message}});
  const Json out{{"version", 1},
                 {"page", (fs::path(folder) / "index.html").string()},
                 {"objects", std::move(objects)},
                 {"faults", std::move(faults)}};
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace texmesh
