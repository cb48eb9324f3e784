#pragma once
#include "tests/delivery/vectors.h"

namespace texmesh {

/// The policies of clients with the order that the vectors have: by the sign of the credit.
template <class Base>
struct ByCredit final : Base {
  bool finest_is_next(const HarmonicTimePlan&, double credit_s) const override { return credit_s <= 0; }
};

inline bool by_credit(VectorOptions& o) {
  if (o.order != "credit" || o.estimator != "last" || (o.policy != "guard" && o.policy != "thesis"))
    return false;
  o.htc.policy = o.policy == "guard" ? Policy::kGuard : Policy::kThesis;
  o.htc.other_policy = [guard = o.policy == "guard"]() -> std::unique_ptr<TransferPolicy> {
    if (guard) return std::make_unique<ByCredit<GuardPolicy>>();
    return std::make_unique<ByCredit<ThesisPolicy>>();
  };
  return true;
}

}  // namespace texmesh
