#pragma once

#include "format/base/fields.h"

namespace texmesh {

enum class Subsampling : std::uint8_t { k420, k444 };

template <>
struct EnumNames<Subsampling> {
  static constexpr std::array<std::string_view, 2> names{"420", "444"};
};

}  // namespace texmesh
