#pragma once

#include "tools/cli/options/common_options.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh {

class Command;

/// Something to be painted: `texmesh render --what`, `texmesh-lab picture`.
struct Painting {
  std::string input, what, output;
  std::string profile;                // as for compile; "" = none
  std::vector<std::string> settings;  // STAGE.OPTION=VALUE
  int size_px = 640, jobs = 0;
  CacheChoice cache;
  bool json = false;  // print the legend as JSON
};

/// --profile, --set and where stages' results are kept.
void add_painting_options(Command& command, Painting& painting);
/// Paints the quantity of that name, writes x.png or x.glb, prints the legend. UsageError for what makes no
/// sense; errors as compile's.
int run_painting(const Painting& painting, std::span<const PaintedQuantity> quantities);

}  // namespace texmesh
