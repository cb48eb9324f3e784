#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/publish/view/site.h"

namespace texmesh {

/// What a list shows of a package.
struct PackageCard {
  std::string title;  // "" = none
  bool poster = false;
};
/// Of a package of the site, by its decoded path ("/packages/bust.texmesh", "/packages/tree/"). Nothing for
/// what cannot be read: lists show its name then.
std::optional<PackageCard> package_card(const Site& site, const std::string& path);

/// The package's poster, a JPEG, its digest checked; nothing where there is none. Thread-safe.
std::optional<std::vector<std::uint8_t>> package_poster(const Site& site, const std::string& path);

/// `{"packages":[{"url":"packages/bust.texmesh","title":"A bust","poster":"posters/bust.texmesh"}, ...]}`,
/// what the viewer offers to choose from, by the names of the files. `title` and `poster` stand where the
/// package has them.
std::string package_list(const Site& site);

}  // namespace texmesh
