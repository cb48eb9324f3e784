#include "tools/publish/export/oembed.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/markup.h"
#include "pipeline/io/record.h"

namespace texmesh {
template <>
struct RecordFields<EmbeddedObject> {
  static void fields(auto& s, auto&& v) {
    v("version", Constant{"1.0"}, "");
    v("type", Constant{"rich"}, "");
    v("title", s.about.title, kMayMiss, "");
    v("author_name", s.about.creator, kMayMiss, "");
    v("provider_name", s.provider_name, kMayMiss, "");
    v("provider_url", s.provider_url, kMayMiss, "");
    v("cache_age", Constant{86400}, "seconds");
    v("thumbnail_url", s.thumbnail_url, kMayMiss, "");
    v("thumbnail_width", s.thumbnail_width_px, kMayMiss, "");
    v("thumbnail_height", s.thumbnail_height_px, kMayMiss, "");
    v("width", s.width_px, "");
    v("height", s.height_px, "");
    v("html", embedded_frame(s), "");
    v("license", s.about.licence, kMayMiss, "");
    v("license_url", s.about.licence_url, kMayMiss, "");
    v("attribution", s.about.attribution, kMayMiss, "");
    v("description", s.about.description, kMayMiss, "");
  }
};

std::string embedded_frame(const EmbeddedObject& o) {
  return fmt::format(
      R"(<iframe src="{}" width="{}" height="{}" title="{}" style="border:0;max-width:100%" loading="lazy" allow="fullscreen"></iframe>)",
      markup_escaped(o.page_url), o.width_px, o.height_px, markup_escaped(o.about.title));
}

std::string oembed_json(const EmbeddedObject& object) {
  EmbeddedObject o = object;
  if (o.thumbnail_url.empty()) o.thumbnail_width_px = o.thumbnail_height_px = 0;  // a size alone says nothing
  return to_json(o).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace texmesh
