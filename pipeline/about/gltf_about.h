#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "format/base/note.h"
#include "format/documents/about.h"

namespace texmesh {

/// What a glTF says about itself, in rising priority: asset.copyright, asset.extras, extras of the root and
/// of the scene shown, the XMP packet of the asset (else of the scene). Unit and up axis are glTF's: metres,
/// y. Asset, extras and packets are kept verbatim in About::source while they fit kMaxAboutSourceBytes; what
/// does not fit is named there and costs a note. `document` may hold anything.
About about_from_gltf(const nlohmann::json& document, const std::string& format, Notes& notes);

/// Writes what is known into the JSON of a GLB: asset.copyright; the source's asset.extras; as
/// KHR_xmp_json_ld the source's packets and, where the fields say something else, one more, to which the
/// asset refers; as extras.texmesh of the root unit, up axis and coordinate reference where they are not
/// glTF's.
void write_gltf_about(const About& about, nlohmann::ordered_json& root);

/// As much of `about` as write_gltf_about() puts into `bytes` bytes of JSON: all, else without what the
/// source said verbatim, else title, creator, attribution and licence alone.
About about_within(const About& about, std::uint64_t bytes);

}  // namespace texmesh
