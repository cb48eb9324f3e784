#pragma once
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string_view>

namespace texmesh {

// What exists of two registries: facts, written by pipeline/about/make_tables.

/// Identifiers of licences and of exceptions to them, by letters without regard to case.
extern const std::string_view kSpdxLicences[];
extern const std::size_t kSpdxLicenceCount;
extern const std::string_view kSpdxExceptions[];
extern const std::size_t kSpdxExceptionCount;

/// EPSG codes first .. last of coordinate reference systems, rising.
struct EpsgRun {
  std::uint32_t first, last;
};
extern const EpsgRun kEpsgRuns[];
extern const std::size_t kEpsgRunCount;

}  // namespace texmesh
