#pragma once
// Inside stages only.
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// StageError of `stage` unless every plane has pixels of its channels and of the size of all its fragments,
/// which is what fill_planes() returns.
void check_pixels(const char* stage, const Fragments& fragments, const std::vector<Pixels>& pixels);

}  // namespace texmesh
