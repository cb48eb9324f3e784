#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/text_table.h"
#include "tools/extract/extract.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

const char* format_name(FileImage format) { return mime_type_of(format) + 6; }  // behind "image/"

}  // namespace

std::string extract_json(const Extracted& e, const ExtractRequest& request, const std::string& file) {
  Json images = Json::array();
  for (const ExtractedImage& i : e.images)
    images.push_back({{"image", i.image},
                      {"role", i.role},
                      {"format", format_name(i.format)},
                      {"width_px", i.width_px},
                      {"height_px", i.height_px},
                      {"quality", i.quality},
                      {"bytes", i.bytes}});
  Json out{{"version", 1},
           {"file", file},
           {"bytes", e.glb.size()},
           {"scale", e.scale},
           {"levels", e.levels},
           {"triangles", e.triangles},
           {"mesh_bytes", e.mesh_bytes},
           {"images", images}};
  if (e.proxy) out["proxy"] = *e.proxy;
  if (request.bytes > 0) {
    out["asked_bytes"] = request.bytes;
    out["within"] = e.within;
    out["difference"] = e.difference;
    out["mesh_difference"] = e.mesh_difference;
    out["views"] = e.views;
    out["side_px"] = e.side_px;
  }
  out["notes"] = e.notes;
  return out.dump();
}

std::string extract_text(const Extracted& e, const ExtractRequest& request, const std::string& file) {
  std::string text = fmt::format("{}: {} bytes, {} with {} triangles", file, grouped(e.glb.size()),
                                 e.proxy ? fmt::format("proxy {}", *e.proxy) : fmt::format("S_{}", e.scale),
                                 grouped(e.triangles));
  for (std::size_t l = 1; l < e.levels.size(); ++l)
    text += fmt::format("{} S_{}", l == 1 ? ", levels" : ",", e.levels[l]);
  text += fmt::format("; mesh {} bytes\n", grouped(e.mesh_bytes));
  for (const ExtractedImage& i : e.images) {
    text += fmt::format("  image {}, {}: {} x {} px, {}", i.image, i.role, i.width_px, i.height_px,
                        format_name(i.format));
    if (i.format != FileImage::kPng) text += fmt::format(" of quality {:.4g}", i.quality);
    text += fmt::format(", {} bytes\n", grouped(i.bytes));
  }
  if (request.bytes > 0)
    text += fmt::format(
        "difference to the package's best (FLIP of lit pictures, {} views of {} px): {:.4f}; of the mesh alone "
        "{:.4f}\n",
        e.views, e.side_px, e.difference, e.mesh_difference);
  if (!e.within)
    text += fmt::format(
        "{} bytes cannot be reached within 2 %: this is the nearest file that the package gives\n",
        grouped(request.bytes));
  for (const std::string& n : e.notes) text += "note: " + n + "\n";
  return text;
}

}  // namespace texmesh
