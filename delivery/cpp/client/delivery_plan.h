#pragma once
#include <optional>
#include <string>
#include <vector>

#include "delivery/cpp/decide/fragment_list.h"
#include "delivery/cpp/simulate/network_model.h"
#include "delivery/cpp/simulate/simulation.h"
#include "format/documents/viewing.h"

namespace texmesh {

/// How somebody looks at the object, and over what.
struct DeliveryRequest {
  double displayed_px = 1000;  // displayed height, device pixels
  StepRule rule = StepRule::kDefault;
  bool measured = true;      // kDefault only: finer than that where finer_where_seen() says so
  int scale = -1;            // -1 = by the rule
  double time_limit_s = 5;   // from the first request on
  double beta0_bytes_s = 0;  // first guess of the throughput; 0 = what the mesh's transfer has shown
  HtcOptions htc;            // policy, order, window ..: its time limit and beta_0 are set from the others
  NetworkOptions network;
};

/// What a viewer will get. Times of what never comes, because every server dies before, are +infinity.
struct DeliveryPlan {
  int scale = 0;
  std::vector<PlaneChoice> planes;
  std::uint64_t bootstrap_bytes = 0, first_picture_bytes = 0, mesh_bytes = 0, table_bytes = 0,
                texture_bytes = 0;
  double first_picture_s = 0;                  // the coarsest mesh is complete, its images are previews
  double mesh_s = 0;                           // the chosen scale and all tables are there
  double complete_s = 0;                       // the last fragment
  SimulationResult textures;                   // its times count from mesh_s
  double mean_quality = 0, worst_quality = 0;  // IJG quality of fragments, surface-weighted mean; skipped = 0
  double ssim = 0;                             // predicted, from the package's measured table
  double texture_dssim = 0;                    // surface-weighted 1 - SSIM of the textures as displayed
  std::vector<std::string> warnings;
  std::uint64_t bytes() const {
    return bootstrap_bytes + first_picture_bytes + mesh_bytes + table_bytes + texture_bytes;
  }
};

/// The scale is the rule's, or a coarser one where a simulation of both shows a better picture in the time:
/// mesh first, then texture; or where the mesh itself comes too late. Deterministic.
DeliveryPlan plan_delivery(PackageReader& package, const DeliveryRequest& request);
/// The scale and the textures that look best in so many bytes, whatever the time: no scale finer than the
/// display needs, mesh first, then texture. Where nothing fits the least there is, with a warning.
DeliveryPlan plan_budget(PackageReader& package, const DeliveryRequest& request, std::uint64_t bytes);

/// From a scale that the step function finds good enough to a finer one, as long as the package's measured
/// table says that each is seen to be better (0.004 of SSIM with the best textures): the rules speak of
/// distances, and shading tells more. The table holds for objects displayed at least as high as its pictures.
int finer_where_seen(const QualityTable& table, int scale, double displayed_px);
/// SSIM of the rendered object for a scale and a mean quality of its textures: bilinear in the
/// package's measured table (scale number, log-quantiser of the quality), and below its lowest quality
/// on the same line.
double predicted_ssim(const QualityTable& table, int scale, double quality);
/// The same for what the textures lose as they are displayed, mip_loss() included.
double predicted_ssim(PackageReader& package, double displayed_px, int scale, double texture_dssim);
/// The scale that the request asks for: its own, or the rule's, or a finer one by measurement.
int wanted_scale(PackageReader& package, const DeliveryRequest& request);
/// The uniform quality whose textures lose as much as these do: by interpolation over the
/// uniform rungs' losses.
double equivalent_quality(PackageReader& package, const std::vector<PlaneChoice>& planes,
                          double texture_dssim);

}  // namespace texmesh
