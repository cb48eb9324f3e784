// What the command line needs to know of layers; apart from them, so that it does not load libcurl.
#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "format/base/errors.h"
#include "pipeline/cache/cache_layer.h"

namespace texmesh {

void check_layer(const std::string& place) {
  if (place.find("://") != std::string::npos && !place.starts_with("http://") &&
      !place.starts_with("https://"))
    throw InputError("cache layer", "", "a folder, or a URL that begins with http:// or https://",
                     place.substr(0, place.find("://") + 3) + "...");
}

LayerPatience patience_within(double limit_s) {
  LayerPatience patience;
  if (limit_s <= 0) return patience;
  patience.all_transfers_s = std::min(patience.all_transfers_s, limit_s / 4);
  patience.answer_s = std::min(patience.answer_s, patience.all_transfers_s);
  return patience;
}

std::vector<std::string> layers_from_environment() {
  const char* text = std::getenv("TEXMESH_CACHE_LAYERS");
  std::istringstream in(text ? text : "");
  std::vector<std::string> places;
  for (std::string place; in >> place;) places.push_back(place);
  return places;
}

}  // namespace texmesh
