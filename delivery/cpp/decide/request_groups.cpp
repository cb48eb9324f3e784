#include "delivery/cpp/decide/request_groups.h"

namespace texmesh {
namespace {

constexpr double kLeastRequest_s = 0.006;  // a request is worth at least so much of the link
constexpr double kHiddenRtts = 0.6;        // that six connections at once hide
constexpr double kLeastDecisions = 48;

}  // namespace

double group_bytes(double bytes_s, double rtt_s, double limit_s) {
  return std::min(bytes_s * std::max(kLeastRequest_s, kHiddenRtts * rtt_s),
                  bytes_s * limit_s / kLeastDecisions);
}

void join(FragmentOffer& all, const FragmentOffer& one) {
  for (std::size_t r = 0; r < all.bytes.size(); ++r) all.bytes[r] += one.bytes[r];
  for (std::size_t r = 0; r < all.loss.size(); ++r) all.loss[r] += one.loss[r];
  all.eta = std::max(all.eta, one.eta);
  all.planned_bytes += one.planned_bytes;
}

GroupedOffers grouped_offers(const FragmentList& list, double bytes_each, double budget) {
  double planned = 0;
  for (const FragmentOffer& f : list.offers) planned += f.planned_bytes;
  const double factor = budget / std::max(planned, 1.0);
  GroupedOffers out;
  double open = 0;  // expected bytes of the last group
  for (std::size_t i = 0; i < list.offers.size(); ++i) {
    const FragmentOffer& f = list.offers[i];
    const double expected =
        std::min<double>(std::max<double>(f.planned_bytes * factor, f.bytes.front()), f.bytes.back());
    open += expected;
    if (i > 0 && open <= bytes_each && list.fragments[i].plane == list.fragments[i - 1].plane) {
      join(out.offers.back(), f);
      ++out.counts.back();
      continue;
    }
    out.offers.push_back(f);
    out.counts.push_back(1);
    open = expected;
  }
  return out;
}

}  // namespace texmesh
