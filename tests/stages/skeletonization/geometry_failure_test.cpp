#include "stages/skeletonization/wrap.h"

#include <gtest/gtest.h>

#include <new>

#include "format/base/errors.h"
#include "stages/base/run_context.h"

namespace texmesh::geometry_failure_test {

template <class Thrown>
bool falls_back_on(Thrown thrown) {
  bool fell_back = false;
  try_geometry([&] { throw thrown; }, [&] { fell_back = true; });
  return fell_back;
}

TEST(TryGeometry, FallsBackWhereTheGeometryIsAtFault) {
  EXPECT_TRUE(falls_back_on(GeometryFailure("the wrap is empty")));
  bool fell_back = false;
  try_geometry([] {}, [&] { fell_back = true; });
  EXPECT_FALSE(fell_back);
}

TEST(TryGeometry, LetsMistakesAndLimitsOfTheMachinePass) {
  EXPECT_THROW(falls_back_on(std::logic_error("a mistake")), std::logic_error);
  EXPECT_THROW(falls_back_on(std::out_of_range("a wrong index")), std::out_of_range);
  EXPECT_THROW(falls_back_on(std::runtime_error("something else")), std::runtime_error);
  EXPECT_THROW(falls_back_on(StageError("skeletonization", "mesh", "triangles", "none")), StageError);
  EXPECT_THROW(falls_back_on(Cancelled()), Cancelled);
  EXPECT_THROW(falls_back_on(std::bad_alloc()), std::bad_alloc);
}

}  // namespace texmesh::geometry_failure_test
