#include "stages/data/uv_sets.h"

#include <algorithm>

namespace texmesh {

std::vector<UvSets> uv_sets_of(const std::vector<Material>& materials) {
  std::vector<UvSets> sets;
  for (const Material& m : materials) {
    UvSets s;
    bool first = true;
    for_each_texture(m, [&](const TextureRef& t) {  // the base colour comes first
      if (!t.used()) return;
      const std::uint8_t set = t.texcoord == 1 ? 1 : 0;
      if (first) s.guide = set;
      if (set != s.guide) s.both = 1;
      first = false;
    });
    sets.push_back(s);
  }
  if (std::all_of(sets.begin(), sets.end(), [](const UvSets& s) { return s == UvSets{}; })) sets.clear();
  return sets;
}

}  // namespace texmesh
