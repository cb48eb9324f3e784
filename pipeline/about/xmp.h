#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "format/base/note.h"
#include "format/documents/about.h"

namespace texmesh {

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
