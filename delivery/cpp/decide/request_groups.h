#pragma once
#include "delivery/cpp/decide/fragment_list.h"

namespace texmesh {

// Fragments that one request brings and one decision chooses the rung of. The browser client groups the same
// (decide/request_groups.ts).

/// Bytes that one request should bring: so many that the link is not idle between two answers, and so few
/// that the decisions left at the end of a time limit can make up for a bad start.
double group_bytes(double bytes_s, double rtt_s, double limit_s);

/// Two offers of equal rungs as one.
void join(FragmentOffer& all, const FragmentOffer& one);

/// Neighbours of a list, of one plane each.
struct GroupedOffers {
  std::vector<FragmentOffer> offers;
  std::vector<std::uint32_t> counts;  // offers of the list by offer, in the list's order
};
/// Groups of about so many bytes each where `budget` bytes are spent on all; 0 = each offer by itself.
GroupedOffers grouped_offers(const FragmentList& list, double bytes_each, double budget);

}  // namespace texmesh
