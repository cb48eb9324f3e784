#pragma once

#include "format/base/bytes.h"

namespace texmesh {

/// Major version of packages that this library writes and reads (SPEC.md, Version history).
inline constexpr int kFormatMajor = 2;
/// Minor version of packages that this library writes. It reads packages of later minor versions, too.
inline constexpr int kFormatMinor = 0;

/// What a reader says it has found instead of kFormatMajor.
inline std::string describe_other_major(int major) {
  return std::to_string(major) + (major < kFormatMajor ? ", which is no longer read: compile the model again"
                                                       : ", which a later reader is for");
}

/// Magic word and version, with which index.bin, tables.bin and thesis.bin begin.
inline void write_entry_start(BytesOut& out, std::string_view magic) {
  out.text(magic);
  out.u16(kFormatMajor);
  out.u16(kFormatMinor);
}
/// The minor version. RuleError for another magic word (`magic_rule`) or major version (W03).
inline int read_entry_start(BytesIn& in, std::string_view magic, const char* magic_rule) {
  under_rule(magic_rule, [&] { in.expect("the magic " + std::string(magic), magic); });
  if (const auto major = under_rule(magic_rule, [&] { return in.u16(); }); major != kFormatMajor)
    fail_by("W03", in, "major version " + std::to_string(kFormatMajor), describe_other_major(major));
  return under_rule(magic_rule, [&] { return in.u16(); });
}

}  // namespace texmesh
