#pragma once
#include <string>
#include <vector>

#include "delivery/cpp/client/several_objects.h"

namespace texmesh {

/// A package beside the first one, "PKG" or "PKG,PX" with its displayed height.
struct BesideObject {
  std::string package;
  double displayed_px = 0;  // 0 = as the first one
};
/// UsageError for a height out of 1 .. 1e6.
BesideObject beside_object(const std::string& text);

/// Plays several objects that share one link and one time limit; the first one is `first`. `json`: one object
/// (schemas/simulate.v1.schema.json), else a table.
std::string simulated_page(const std::string& first, const std::vector<std::string>& beside,
                           const DeliveryRequest& request, bool json);

}  // namespace texmesh
