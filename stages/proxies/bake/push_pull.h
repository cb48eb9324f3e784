#pragma once
// Inside the room only.
#include <cstdint>
#include <vector>

#include "format/base/vec.h"

namespace texmesh::proxies {

/// Gives every value whose `covered` is 0 a smooth continuation of the others (Gortler et al. 1996); the
/// others stay. Without any covered value nothing changes. Lists are width * height long.
void push_pull(std::vector<Vec3f>& values, const std::vector<std::uint8_t>& covered, std::uint32_t width,
               std::uint32_t height);

}  // namespace texmesh::proxies
