#pragma once
#include <algorithm>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// An object of a page.
struct PageObject {
  PackageReader* package = nullptr;
  double displayed_px = 1000;
  int scale = -1;  // -1 = what looks best
};

/// Several objects that share one time limit and one link (thesis 10.1).
struct PagePlan {
  /// Of each object: scale or proxy, planes, bytes, predicted FLIP. Times are the page's.
  std::vector<DeliveryPlan> objects;
  std::vector<bool> first_picture_only;  // what more there is would not come in time with the object's part
  /// The objects one by one, each with its part of the link to itself: the same choices and the same limit.
  std::vector<double> alone_flip;
  double first_pictures_s = 0, meshes_s = 0, complete_s = 0;
  SimulationResult textures;  // of the fragments of all objects, its times from meshes_s on
  /// Mean over the pixels of all objects.
  double flip = 0, alone_mean_flip = 0;
};

/// First pictures of all objects come first, then the meshes and tables of all, then the fragments of all in
/// one list with one limit: a fragment's losses count by the square of its object's displayed height. What
/// each object should be (scale or proxy, planes) is planned with that part of the link. Where the object's
/// mesh would come too late so, its first picture stays, and its part is the others'. All packages come over
/// the same link; request.displayed_px and request.scale are those of the objects. std::invalid_argument for
/// no object. Deterministic.
PagePlan plan_page(const std::vector<PageObject>& objects, const DeliveryRequest& request);

// Where somebody looks.

constexpr double kFoveaRadius_degrees = 0.5, kHalfAcuity_degrees = 2.3;

/// What somebody resolves so many degrees beside the point that they look at, as a part of what they resolve
/// at that point (thesis 5.2, 10.1): 1 in the fovea, the central degree; outside of it the finest detail that
/// is seen grows in proportion to the distance and has doubled 2.3 degrees beyond. The browser client goes by
/// it, with the same bits. `degrees` >= 0.
inline double acuity_at(double degrees) {
  return kHalfAcuity_degrees / (kHalfAcuity_degrees + std::max(0.0, degrees - kFoveaRadius_degrees));
}
/// What a loss counts there: the square, since detail is lost in two directions.
inline double gaze_weight(double degrees) { return acuity_at(degrees) * acuity_at(degrees); }

}  // namespace texmesh
