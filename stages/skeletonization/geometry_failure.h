#pragma once
#include <exception>
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

/// Called in a handler: throws a GeometryFailure where the exception in flight is a failed check of CGAL, and
/// the exception itself where it is another one.
[[noreturn]] void rethrow_cgal_failure();

/// Runs `work`, a call into CGAL, whose failed checks become GeometryFailure. CGAL derives them from
/// std::logic_error: nothing above could tell them from our own mistakes.
template <class Work>
auto with_cgal_checks(Work&& work) {
  try {
    return std::forward<Work>(work)();
  } catch (const std::exception&) {
    rethrow_cgal_failure();
  }
}

}  // namespace texmesh
