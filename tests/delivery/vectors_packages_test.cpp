#include "tests/delivery/by_credit.h"
#include "tests/delivery/vector_packages.h"

namespace texmesh::vectors_packages_test {

/// The thesis's order is its own where it is asked for as printed.
bool of_clients(VectorOptions& o) { return o.policy == "thesis" || by_credit(o); }

TEST(Vectors, Packages) {
  expect_cases("packages.json", packages(of_clients), [](Json& c) {
    Json plans = Json::array();
    for (Json& p : c["plans"])
      if (p["policy"] == "guard" || p["policy"] == "thesis") plans.push_back(std::move(p));
    c["plans"] = std::move(plans);
    return true;
  });
}

}  // namespace texmesh::vectors_packages_test
