#pragma once
#include <string>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// What lost packets cost that nobody sends again (thesis ch. 10), for the scale and the fragments of a plan.
struct LostPacketsRow {
  double loss = 0;
  std::size_t lost_points = 0, lost_fragments = 0;
  double neighbours_rms = 0, texture_rms = 0, texture_p95 = 0;  // of lost points, in mean edges
  double flip = 0;                                              // predicted, of the lost fragments alone
};
struct LostPacketsTable {
  std::size_t points = 0, fragments = 0;
  std::vector<LostPacketsRow> rows;  // none, a half, all, twice the rate that was asked for
};
/// InputError where the plan is about a proxy or a package without a stream.
LostPacketsTable lost_packets(PackageReader& package, const DeliveryPlan& plan, const FragmentList& list,
                              const DeliveryRequest& request, double loss, std::uint64_t seed);
std::string lost_packets_text(const LostPacketsTable& table);
std::string lost_packets_json(const LostPacketsTable& table);
std::string lost_packets_csv(const LostPacketsTable& table);
/// The scale as clay, three times side by side: nothing lost; lost points at the mean of their neighbours; at
/// the places that their texture coordinates suggest. PNG.
std::vector<std::uint8_t> lost_packets_picture(PackageReader& package, int scale, double loss,
                                               std::uint64_t seed);

}  // namespace texmesh
