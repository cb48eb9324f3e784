#pragma once
// Inside the room only: the pages of targets that have one.
#include <cstdint>
#include <string>

#include "tools/publish/export/export.h"
#include "tools/publish/export/oembed.h"

namespace texmesh {

/// What the package calls itself, or the name of its file without its ending. Plain text.
std::string page_title(PackageReader& package);

/// index.html beside model.glb, of `glb_bytes` bytes.
std::string model_viewer_page(PackageReader& package, const ExportOptions& options, std::uint64_t glb_bytes);

/// index.html that frames `viewer`, an address relative to it, and says where oembed.json stands: `url`.
std::string oembed_page(const EmbeddedObject& object, const std::string& url, const std::string& viewer);

}  // namespace texmesh
