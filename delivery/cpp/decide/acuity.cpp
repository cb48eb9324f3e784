#include "delivery/cpp/decide/acuity.h"

#include <algorithm>

namespace texmesh {
namespace {

constexpr double kFoveaRadius_degrees = 0.5, kHalfAcuity_degrees = 2.3;

}  // namespace

double acuity_at(double degrees) {
  return kHalfAcuity_degrees / (kHalfAcuity_degrees + std::max(0.0, degrees - kFoveaRadius_degrees));
}

double gaze_weight(double degrees) {
  const double acuity = acuity_at(degrees);
  return acuity * acuity;
}

}  // namespace texmesh
