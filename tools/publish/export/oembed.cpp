#include "tools/publish/export/oembed.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/markup.h"

namespace texmesh {
namespace {

constexpr int kCacheSeconds = 86400;

}  // namespace

std::string embedded_frame(const EmbeddedObject& o) {
  return fmt::format(
      R"(<iframe src="{}" width="{}" height="{}" title="{}" style="border:0;max-width:100%" loading="lazy" allow="fullscreen"></iframe>)",
      markup_escaped(o.page_url), o.width_px, o.height_px, markup_escaped(o.about.title));
}

std::string oembed_json(const EmbeddedObject& o) {
  nlohmann::ordered_json out{{"version", "1.0"}, {"type", "rich"}};
  const auto add = [&](const char* name, const std::string& text) {
    if (!text.empty()) out[name] = text;
  };
  add("title", o.about.title);
  add("author_name", o.about.creator);
  add("provider_name", o.provider_name);
  add("provider_url", o.provider_url);
  out["cache_age"] = kCacheSeconds;
  if (!o.thumbnail_url.empty()) {
    out["thumbnail_url"] = o.thumbnail_url;
    out["thumbnail_width"] = o.thumbnail_width_px;
    out["thumbnail_height"] = o.thumbnail_height_px;
  }
  out["width"] = o.width_px;
  out["height"] = o.height_px;
  out["html"] = embedded_frame(o);
  add("license", o.about.licence);
  add("license_url", o.about.licence_url);
  add("attribution", o.about.attribution);
  add("description", o.about.description);
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace texmesh
