#pragma once
#include <nlohmann/json_fwd.hpp>

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

/// What a file may say of the object, most first: all, without what the source said verbatim, and title,
/// creator, attribution and licence alone.
std::vector<About> about_choices(const About& about);
/// The first of these that write_gltf_about() puts into `bytes` bytes of JSON, else the last.
About about_within(const About& about, std::uint64_t bytes);

/// Enters what an XMP packet (JSON-LD, as KHR_xmp_json_ld holds it) says with Dublin Core, XMP Basic and XMP
/// Rights: dc:title, dc:creator, dc:description, dc:rights, dc:identifier, dc:date, dc:source,
/// xmp:CreateDate, xmpRights:UsageTerms, xmpRights:WebStatement, xmpRights:Owner. Prefixes follow the
/// packet's @context. Of texts in several languages the default one counts, then English, then the first.
/// What is shaped otherwise is ignored.
void apply_xmp(About& about, const nlohmann::json& packet, const std::string& place, Notes& notes);

/// A packet that says what `about` says, over `packet`: properties that say the same already stay as they
/// are.
nlohmann::ordered_json xmp_packet(const About& about, nlohmann::ordered_json packet);

}  // namespace texmesh
