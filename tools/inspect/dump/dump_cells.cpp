#include "tools/inspect/dump/dump_cells.h"

#include <fmt/format.h>

#include "pipeline/io/text_table.h"

namespace texmesh {

std::string plane_title(const TextureInfo& t, std::size_t plane) {
  const std::string name = t.name.empty() ? "" : " \"" + printable(t.name) + "\"";
  const std::string mip = t.mip == 0 ? "" : fmt::format(", mip {} of plane {}", t.mip, t.base);
  return fmt::format("texture plane {}{}, {}{}: {} x {} px, {} channel{}\n", plane, name, t.role, mip,
                     t.width_px, t.height_px, t.channels, t.channels == 1 ? "" : "s");
}

}  // namespace texmesh
