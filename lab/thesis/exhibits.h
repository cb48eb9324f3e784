#pragma once
#include <span>
#include <string>
#include <vector>

#include "lab/thesis/exhibit.h"
#include "stages/base/run_context.h"

namespace texmesh {

// Every exhibit is made from models, pictures and links that are made by code, by the stages and the delivery
// themselves. Same result for any thread count and on any machine.

std::vector<Exhibit> scale_exhibits(const RunContext& context);       // Table 2.1, Fig. 6.2
std::vector<Exhibit> fragment_exhibits(const RunContext& context);    // Table 3.1, Figs. 3.5 to 3.8
std::vector<Exhibit> quality_exhibits(const RunContext& context);     // Fig. 3.9
std::vector<Exhibit> transfer_exhibits(const RunContext& context);    // Tables 4.1, 4.2, Figs. 4.3, 4.6, 4.7
std::vector<Exhibit> perceptual_exhibits(const RunContext& context);  // Tables 7.1, 7.2, 7.3
std::vector<Exhibit> predictor_exhibits(const RunContext& context);   // Figs. 8.2, 8.3, 8.5

/// Exhibits that are made together.
struct ExhibitGroup {
  std::vector<std::string> ids;
  std::vector<Exhibit> (*make)(const RunContext& context);
};
/// All of them, in the thesis's order of chapters.
std::span<const ExhibitGroup> exhibit_groups();
/// Those with one of these ids, or all for none.
std::vector<Exhibit> make_exhibits(const std::vector<std::string>& ids, const RunContext& context);

}  // namespace texmesh
