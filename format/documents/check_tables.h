#pragma once
// What holds for the tables of a plane (SPEC 8), for their writer and their reader.
// Inside the room only.
#include <cstdint>
#include <string>

#include "format/documents/tables.h"

namespace texmesh {

/// Throws RuleError for tables.bin.
[[noreturn]] void fail_tables(const char* rule, const std::string& place, const std::string& expected,
                              const std::string& found);
void require_tables(bool good, const char* rule, const std::string& place, const char* expected,
                    const std::string& found);

/// Numbers that a plane's tables hold, about 4 bytes of memory each: F * (5 R + N).
std::uint64_t cells_of(std::uint64_t fragments, std::uint64_t rungs, std::uint64_t scales);
std::uint64_t cells_of(const PlaneTables& tables);

// Few bytes of a file may tell of many fragments without any.
inline constexpr std::uint64_t kMaxPlaneCells = 1u << 24;
inline constexpr std::uint32_t kMaxFragments = 65535, kMaxScaleCount = 100;

/// Everything that holds for the tables of a plane. `rounding` is how far fractions may be out of their
/// range: a writer tolerates what arithmetic does and clamps it, a reader nothing.
void check_plane(const PlaneTables& tables, float rounding, const std::string& place);

}  // namespace texmesh
