#pragma once
#include <cstdint>
#include <string>

#include "format/documents/about.h"

namespace texmesh {

/// What an oEmbed answer is about. URLs are absolute.
struct EmbeddedObject {
  About about;
  std::string page_url;       // what the frame shows
  std::string thumbnail_url;  // "" = none
  std::uint32_t thumbnail_width_px = 0, thumbnail_height_px = 0;
  std::uint32_t width_px = 640, height_px = 480;  // of the frame
  std::string provider_name, provider_url;
};

/// The frame as HTML, for pages and for the answer.
std::string embedded_frame(const EmbeddedObject& object);

/// An answer of oEmbed 1.0, type rich, as JSON. Beside the fields of oEmbed: license, license_url,
/// attribution and description, where they are known.
std::string oembed_json(const EmbeddedObject& object);

}  // namespace texmesh
