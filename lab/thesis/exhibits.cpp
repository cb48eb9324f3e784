#include "lab/thesis/exhibits.h"

#include <algorithm>
#include <iterator>

namespace texmesh {

std::span<const ExhibitGroup> exhibit_groups() {
  static const std::vector<ExhibitGroup> kGroups{
      {{"2.1", "fig-6.2"}, scale_exhibits},
      {{"3.1", "fig-3.5"}, fragment_exhibits},
      {{"fig-3.9"}, quality_exhibits},
      {{"4.1", "4.2", "fig-4.6", "fig-4.7"}, transfer_exhibits},
      {{"7.1", "7.2", "7.3"}, perceptual_exhibits},
      {{"fig-8.2", "fig-8.3", "fig-8.5"}, predictor_exhibits},
  };
  return kGroups;
}

std::vector<Exhibit> make_exhibits(const std::vector<std::string>& ids, const RunContext& context) {
  const auto wanted = [&](const std::string& id) { return ids.empty() || std::ranges::count(ids, id) > 0; };
  std::vector<Exhibit> out;
  for (const ExhibitGroup& group : exhibit_groups()) {
    if (std::ranges::none_of(group.ids, wanted)) continue;
    for (Exhibit& e : group.make(context))
      if (wanted(e.id)) out.push_back(std::move(e));
  }
  return out;
}

}  // namespace texmesh
