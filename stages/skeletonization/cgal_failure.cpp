#include "stages/skeletonization/cgal_failure.h"

#include <CGAL/Uncertain.h>
#include <CGAL/exceptions.h>

#include "stages/skeletonization/geometry_failure.h"

namespace texmesh {

void rethrow_cgal_failure() {
  try {
    throw;
  } catch (const CGAL::Failure_exception& e) {
    throw GeometryFailure(e.what());
  } catch (const CGAL::Uncertain_conversion_exception& e) {
    throw GeometryFailure(e.what());
  }
}

}  // namespace texmesh
