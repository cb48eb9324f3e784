#include "tools/publish/view/package_card.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "format/base/errors.h"
#include "format/base/sha256.h"
#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/manifest.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kManifestOffset = 64;  // of the data in a container (SPEC.md, section 2)

std::vector<std::uint8_t> read_part(const SiteFile& file, std::uint64_t offset, std::uint64_t bytes) {
  std::vector<std::uint8_t> out(static_cast<std::size_t>(bytes));
  std::size_t at = 0;
  while (at < out.size()) {
    const std::size_t n = file.read(offset + at, reinterpret_cast<char*>(out.data()) + at, out.size() - at);
    if (n == 0) break;
    at += n;
  }
  out.resize(at);
  return out;
}

/// Of the container's first bytes, or of a tree's file.
std::optional<Manifest> manifest_of(const Site& site, const std::string& path) {
  const bool tree = path.ends_with("/");
  const auto file = site.open(tree ? path + kManifestPath : path);
  if (!file) return std::nullopt;
  std::vector<std::uint8_t> bytes = read_part(*file, 0, std::min(file->bytes(), kBootstrapBytes));
  if (!tree) {
    if (bytes.size() < kManifestOffset) return std::nullopt;
    std::uint64_t length = 0;
    for (int i = 3; i >= 0; --i) length = length << 8 | bytes[static_cast<std::size_t>(22 + i)];
    bytes.erase(bytes.begin(), bytes.begin() + kManifestOffset);
    if (length > bytes.size()) return std::nullopt;
    bytes.resize(static_cast<std::size_t>(length));
  }
  try {
    return read_manifest(bytes);
  } catch (const FormatError&) {
    return std::nullopt;
  }
}

std::string decoded(const std::string& url) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'A' + 10; };
  std::string out;
  for (std::size_t i = 0; i < url.size(); ++i)
    if (url[i] == '%' && i + 2 < url.size()) {
      out += static_cast<char>(16 * digit(url[i + 1]) + digit(url[i + 2]));
      i += 2;
    } else {
      out += url[i];
    }
  return out;
}

}  // namespace

std::optional<PackageCard> package_card(const Site& site, const std::string& path) {
  const std::optional<Manifest> m = manifest_of(site, path);
  if (!m) return std::nullopt;
  return PackageCard{m->title, m->poster.has_value()};
}

std::optional<std::vector<std::uint8_t>> package_poster(const Site& site, const std::string& path) {
  const std::optional<Manifest> m = manifest_of(site, path);
  if (!m || !m->poster) return std::nullopt;
  const bool tree = path.ends_with("/");
  const auto file = site.open(tree ? path + kPosterPath : path);
  if (!file) return std::nullopt;
  std::vector<std::uint8_t> bytes = read_part(*file, tree ? 0 : m->poster->offset, m->poster->bytes);
  if (bytes.size() != m->poster->bytes || sha256(bytes) != m->poster->digest) return std::nullopt;
  return bytes;
}

std::string package_list(const Site& site) {
  constexpr std::string_view kPackages = "packages/";
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const std::string& url : site.packages()) {
    nlohmann::ordered_json entry{{"url", url}};
    if (const auto card = package_card(site, "/" + decoded(url))) {
      if (!card->title.empty()) entry["title"] = card->title;
      if (card->poster) entry["poster"] = "posters/" + url.substr(kPackages.size());
    }
    list.push_back(std::move(entry));
  }
  return nlohmann::ordered_json{{"packages", list}}.dump();
}

}  // namespace texmesh
