#include "stages/gltf/check_glb_textures.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;

constexpr std::uint64_t kMaxPreviewPixels = 1ull << 26;

/// Checks that every "index" of a texture info of `object` (recursively: materials hold them at several
/// depths) is in range.
void check_texture_infos(GlbDocument& d, const Json& object, std::size_t textures, const std::string& place) {
  if (!object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_object()) continue;
    if (key.size() > 7 && key.ends_with("Texture")) d.index(value, "index", textures, place + "/" + key);
    check_texture_infos(d, value, textures, place + "/" + key);
  }
}

/// The path of a preview from the folder of the meshes.
bool is_preview_uri(const Json& uri) {
  constexpr std::string_view kUp = "../";
  if (!uri.is_string() || !uri.get_ref<const std::string&>().starts_with(kUp)) return false;
  const EntryName name = parse_entry_path(uri.get_ref<const std::string&>().substr(kUp.size()));
  return name.kind == EntryKind::kPreview;
}

}  // namespace

void check_glb_image(GlbDocument& d, std::size_t i, GlbFacts& facts) {
  const Json& json = d.root()["images"][i];
  const std::string place = GlbDocument::element("images", i);
  facts.image_names.push_back(json.value("name", std::string()));
  facts.image_uris.emplace_back();
  facts.image_digests.emplace_back();
  if (!d.standalone() && json.contains("uri")) {
    const bool preview = is_preview_uri(json["uri"]) && !json.contains("bufferView");
    if (!preview || json.value("mimeType", std::string()) != "image/jpeg")
      d.fail({"glb-image", "G06"}, place + "/uri", "a preview as image/jpeg, ../preview/PPP.jpg",
             json["uri"].dump().substr(0, 80));
    facts.image_uris.back() = json["uri"].get<std::string>();
    return;
  }
  const auto& view = d.views()[d.index(json, "bufferView", d.views().size(), place)];
  if (!view.ok) return;
  const std::vector<std::uint8_t> bytes(view.data.begin(), view.data.end());
  facts.image_digests.back() = sha256(bytes);
  const std::string type = json.value("mimeType", std::string());
  const auto shown = sniff_image_format(bytes);
  const bool jpeg = shown == ImageFormat::kJpeg, png = shown == ImageFormat::kPng;
  const bool webp = d.standalone() && shown == ImageFormat::kWebp;
  if (!(jpeg && type == "image/jpeg") && !(png && type == "image/png") && !(webp && type == "image/webp"))
    d.fail("glb-image", place + "/mimeType", jpeg ? "image/jpeg" : png ? "image/png" : "a JPEG or PNG", type);
  const Pixels pixels = jpeg ? decode_jpeg(bytes, kMaxPreviewPixels)
                             : decode_image(probe_image(place, bytes, {16384, kMaxPreviewPixels}));
  facts.largest_image_px = std::max({facts.largest_image_px, pixels.width_px, pixels.height_px});
}

void check_glb_texture(GlbDocument& d, std::size_t i) {
  const Json& json = d.root()["textures"][i];
  const std::string place = GlbDocument::element("textures", i);
  if (d.standalone() && json.contains("extensions") && json["extensions"].contains("EXT_texture_webp"))
    d.index(json["extensions"]["EXT_texture_webp"], "source", d.array(d.root(), "images", "").size(),
            place + "/extensions/EXT_texture_webp");
  else
    d.index(json, "source", d.array(d.root(), "images", "").size(), place);
  if (json.contains("sampler")) d.index(json, "sampler", d.array(d.root(), "samplers", "").size(), place);
}

void check_glb_material(GlbDocument& d, std::size_t i) {
  check_texture_infos(d, d.root()["materials"][i], d.array(d.root(), "textures", "").size(),
                      GlbDocument::element("materials", i));
}

}  // namespace texmesh
