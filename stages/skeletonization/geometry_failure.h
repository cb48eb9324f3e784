#pragma once
#include <stdexcept>
#include <utility>

namespace texmesh {

/// A surface cannot be wrapped or contracted: CGAL's checks failed on it, or it costs more than a bound
/// allows. The next simpler way may still work.
struct GeometryFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Runs `attempt`, and `fallback` where it throws a GeometryFailure. All other exceptions pass through: a
/// lack of memory is a limit of the machine that must not decide about the result, and our own mistakes are
/// no property of the geometry.
template <class Attempt, class Fallback>
void try_geometry(Attempt&& attempt, Fallback&& fallback) {
  try {
    std::forward<Attempt>(attempt)();
  } catch (const GeometryFailure&) {
    std::forward<Fallback>(fallback)();
  }
}

}  // namespace texmesh
