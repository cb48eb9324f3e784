#pragma once
#include <atomic>
#include <cstdint>

namespace texmesh::testing {

/// Calls that change a file system, as the shim counts them.
enum class FaultCall : std::uint32_t { kOpen, kWrite, kSync, kLink, kRename, kUnlink, kMkdir, kCount };

/// What the processes under the shim share, in a mapped file.
struct FaultCounts {
  std::atomic<std::uint64_t> calls{0}, fired{0};
  std::atomic<std::uint32_t> fired_call{0};
  std::atomic<std::uint64_t> of[static_cast<std::size_t>(FaultCall::kCount)]{};
};

}  // namespace texmesh::testing
