#pragma once
#include <optional>
#include <string>
#include <vector>

#include "delivery/cpp/decide/fragment_list.h"
#include "delivery/cpp/simulate/network_model.h"
#include "delivery/cpp/simulate/simulation.h"
#include "format/documents/viewing.h"

namespace texmesh {

/// How somebody looks at the object, and over which network.
struct DeliveryRequest {
  double displayed_px = 1000;  // displayed height, device pixels
  StepRule rule = StepRule::kDefault;
  bool measured = true;      // kDefault only: a finer scale where finer_where_seen() says so
  int scale = -1;            // -1 = by the rule
  double time_limit_s = 5;   // from the first request on
  double beta0_bytes_s = 0;  // first guess of the throughput; 0 = what the mesh's transfer has shown
  HtcOptions htc;            // policy, order, window ..: its time limit and beta_0 are set from the others
  NetworkOptions network;
};

/// What a viewer will get. The time of a part that never comes, because every server dies before, is
/// +infinity.
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

/// What comes within a time limit, mesh first, then textures. The scale is the rule's. A coarser scale takes
/// its place where the rule's mesh comes too late, or where simulations of both scales show that the coarser
/// one gives the better picture in the time. Deterministic.
DeliveryPlan plan_delivery(PackageReader& package, const DeliveryRequest& request);
/// The scale and the textures that look best in so many bytes, whatever the time: no scale finer than the
/// display needs, mesh first, then texture. Where nothing fits: the least that the package has, with a
/// warning.
DeliveryPlan plan_budget(PackageReader& package, const DeliveryRequest& request, std::uint64_t bytes);

/// `scale`, which the step function finds good enough, or a finer scale: takes the next finer one as long as
/// the package's measured table says that the difference is seen (0.004 of SSIM with the best textures). The
/// step function knows distances only, and shading tells more. The table holds for objects that are displayed
/// at least as high as the table's pictures.
int finer_where_seen(const QualityTable& table, int scale, double displayed_px);
/// SSIM of the rendered object for a scale and a mean quality of its textures: bilinear in the package's
/// measured table (scale number, logarithm of the quantiser). Below the table's lowest quality the last line
/// goes on.
double predicted_ssim(const QualityTable& table, int scale, double quality);
/// The same for a loss of the textures as they are displayed, mip_loss() included.
double predicted_ssim(PackageReader& package, double displayed_px, int scale, double texture_dssim);
/// The scale that the request asks for: DeliveryRequest::scale, or the rule's, or a finer scale by
/// measurement.
int wanted_scale(PackageReader& package, const DeliveryRequest& request);
/// The quality at which the textures lose `texture_dssim` when all fragments have it: interpolated between
/// the losses of the rungs of those planes whose role weighs most, base colours where there are some.
double equivalent_quality(PackageReader& package, const std::vector<PlaneChoice>& planes,
                          double texture_dssim);

}  // namespace texmesh
