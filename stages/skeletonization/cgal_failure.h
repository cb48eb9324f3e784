#pragma once
#include <exception>
#include <utility>

namespace texmesh {

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
