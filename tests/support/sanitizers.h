#pragma once

namespace texmesh::testing {

/// Whether a sanitizer watches the test, and the commands that it starts: they need more memory than limits
/// leave them, and libraries cannot be preloaded.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// A bound of time for what takes `time` without a sanitizer.
template <class T>
constexpr T sanitizers_take(T time) {
  return kSanitized ? 10 * time : time;
}

}  // namespace texmesh::testing
