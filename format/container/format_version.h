#pragma once

namespace texmesh {

/// The version of packages that this library writes, and the highest that it reads
/// (SPEC.md, Version history).
inline constexpr int kFormatMajor = 1, kFormatMinor = 1;

}  // namespace texmesh
