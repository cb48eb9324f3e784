#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

// Limits of about.json (SPEC.md, section about.json), bytes of UTF-8.
inline constexpr std::uint64_t kMaxAboutBytes = 262'144;
inline constexpr std::size_t kMaxAboutTitleBytes = 200, kMaxAboutDescriptionBytes = 10'000,
                             kMaxAboutTextBytes = 2'000, kMaxAboutNameBytes = 100, kMaxAboutValueBytes = 500,
                             kMaxUnitNameBytes = 50, kMaxAboutList = 32;
inline constexpr std::size_t kMaxAboutExtrasBytes = 16'384, kMaxAboutSourceBytes = 65'536;
inline constexpr double kMaxMetresPerUnit = 1e12;
inline constexpr std::uint32_t kMaxEpsgCode = 999'999;

/// An identifier of the object, or a date: of what kind, and its text as somebody gave it.
struct NamedText {
  std::string name, text;
  friend bool operator==(const NamedText&, const NamedText&) = default;
  static void archive(auto& s, auto& a) { a(s.name, s.text); }
};

/// about.json: what the object is, whose it is, and what its coordinates mean. Everything may be missing:
/// an empty text or list, 0 of a number.
struct About {
  std::string title, description, creator, attribution;
  std::string licence, licence_url;  // an SPDX expression, a URL, or a text of the source; where to read it
  std::string source_url, capture;
  std::vector<NamedText> identifiers, dates;
  std::string unit;            // name of the object unit
  double metres_per_unit = 0;  // 0 = not known
  std::string up_axis;         // "x", "y", "z"
  std::string crs;             // coordinate reference in words
  std::uint32_t epsg = 0;
  std::string source;  // JSON object: what the source file said, verbatim
  std::string extras;  // JSON: what the publisher added
  friend bool operator==(const About&, const About&) = default;
  static void archive(auto& s, auto& a) {
    a(s.title, s.description, s.creator, s.attribution, s.licence, s.licence_url, s.source_url, s.capture,
      s.identifiers, s.dates, s.unit, s.metres_per_unit, s.up_axis, s.crs, s.epsg, s.source, s.extras);
  }
};

/// Canonical JSON: fixed order of names, no blanks; what is missing is left out. FormatError when a value
/// breaks a rule that read_about checks.
std::string write_about(const About& about);
/// Strict for what this version defines (types, limits, URLs), ignores unknown members. FormatError names the
/// JSON pointer.
About read_about(std::span<const std::uint8_t> json);

/// `over` wins field by field over `under`. A licence brings its own URL: that of another licence goes, and
/// so does the page of another creator. A unit is one field, and so is a coordinate reference.
About merge_about(About under, const About& over);

/// The identifier that is the creator's page.
inline constexpr const char* kCreatorScheme = "creator";
/// The creator's page; "" = not known.
std::string creator_url(const About& about);

/// Whether a text is an absolute http or https URL without blanks and control characters.
bool is_web_url(const std::string& text);

/// The line for asset.copyright of a GLB: the attribution, else the creator, with the licence behind it
/// unless the line names it. "" when nothing is known.
std::string copyright_line(const About& about);

/// One line per field that people read, name and value, in a fixed order: for dump, diff, report. `source`
/// and `extras` are left out.
std::vector<NamedText> about_lines(const About& about);

}  // namespace texmesh
