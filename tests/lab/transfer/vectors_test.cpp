// The vectors in delivery/vectors of which the laboratory knows all cases: written and compared whole.
#include "lab/transfer/chapter_4.h"
#include "lab/transfer/policies.h"
#include "lab/transfer/several_objects.h"
#include "tests/delivery/vector_decisions.h"
#include "tests/delivery/vector_packages.h"

namespace texmesh::vectors_test {

LabOptions lab_options(const VectorOptions& o) {
  const auto at = [](const std::string& name, const std::vector<std::string>& names) {
    return static_cast<std::uint8_t>(std::ranges::find(names, name) - names.begin());
  };
  LabOptions choice;
  choice.policy = static_cast<LabPolicy>(at(o.policy, kPolicies));
  choice.order = static_cast<HtcOrder>(at(o.order, {"credit", "beta0", "finest"}));
  choice.estimator = static_cast<Estimator>(at(o.estimator, {"last", "harmonic", "ewma"}));
  choice.samples = o.samples;
  return choice;
}

bool every_policy(VectorOptions& o) {
  use_policy(lab_options(o), o.htc);
  return true;
}

TEST(Vectors, HarmonicTime) {
  const auto theorem = [](const HarmonicTimePlan& plan) -> Json {
    const HtcTheorem t = theorem_of(plan);
    return {{"surplus_s", t.surplus_s},
            {"last_residual_s", t.last_residual_s},
            {"corrected_bound_s", t.corrected_bound_s},
            {"published_bound_s", t.published_bound_s}};
  };
  expect_file("harmonic-time.json", "calls of a HarmonicTimePlan in order, and what it answers",
              harmonic_time(every_policy, theorem));
}

TEST(Vectors, Throughput) {
  const auto make = [](const std::string& estimator, int samples) -> Estimate {
    const LabOptions options = lab_options({"htc", "credit", estimator, samples});
    return [options, ewma = EwmaThroughput(1e5)](double bytes, double seconds, Throughput& t) mutable {
      t.add(bytes, seconds);
      ewma.add(bytes, seconds);
      return estimate_bytes_s(options, t, ewma);
    };
  };
  expect_file("throughput.json", "samples added to a Throughput, and its estimates after each",
              throughput(make));
}

TEST(Vectors, PortableMath) {
  Json cases = portable_math();
  add_function("acuity", acuity_at, 0, 30, cases);
  add_function("gaze_weight", gaze_weight, 0, 30, cases);
  expect_file("portable-math.json", "functions whose bits decide", cases);
}

TEST(Vectors, Packages) {
  expect_file("packages.json",
              "what a client reads and works out from a package, relative to the project's root",
              packages(every_policy));
}

}  // namespace texmesh::vectors_test
