#pragma once

#include "delivery/cpp/decide/texture_budget.h"
#include "delivery/cpp/simulate/simulation.h"
#include "format/rules/proxy_choice.h"
#include "format/rules/viewing.h"

namespace texmesh {

/// How somebody looks at the object, and over which network.
struct DeliveryRequest {
  double displayed_px = 1000;  // displayed height, device pixels
  StepRule rule = StepRule::kFlip;
  int scale = -1;            // -1 = by the rule
  double time_limit_s = 5;   // from the first request on
  double beta0_bytes_s = 0;  // first guess of the throughput; 0 = what the mesh's transfer has shown
  HtcOptions htc;            // policy, window ..: its time limit and beta_0 are set from the others
  NetworkOptions network;
  /// How the textures of a scale are played; not set: simulate().
  std::function<SimulationResult(int scale, const std::vector<FragmentOffer>& offers, const HtcOptions& htc,
                                 const NetworkOptions& network)>
      play;
  /// GPU memory for mesh and textures, see texture_budget.h. What is least takes its place where nothing
  /// fits.
  double memory_bytes = std::numeric_limits<double>::infinity();
  /// Above 0: the viewer's own JND. Instead of the rule's scale comes the coarsest one that this viewer
  /// cannot tell from it, see refine_to(): by p95, and by the average of 7.2's chains with Policy::kThesis.
  double jnd = 0;
  bool proxy_steps = true;  // a larger proxy may be shown on the way, see format/rules/proxy_choice.h
};

/// The request with chapters 4 and 7 as printed: Policy::kThesis, StepRule::kDistance, one request at a
/// time, hard limits.
DeliveryRequest as_printed(DeliveryRequest request);
/// The request's policy for the textures: `left_s` seconds are left for them. `shown_bytes_s`, what transfers
/// before them have shown, is the first guess of the throughput unless the request has one.
HtcOptions request_htc(const DeliveryRequest& request, double left_s, double shown_bytes_s);

/// What a viewer will get. The time of a part that never comes, because every server dies before, is
/// +infinity.
struct DeliveryPlan {
  int scale = 0;
  /// The proxy that is shown instead of a scale: no documents, no planes, no fragments are fetched, `scale`
  /// is the coarsest one, mesh_bytes are the proxy's where it is not the first picture, and texture_flip is
  /// flip.
  std::optional<std::uint32_t> proxy;
  /// The larger proxy that is shown on the way to the scale, and when; it delays all that follows.
  std::optional<std::uint32_t> step;
  double step_s = 0;
  std::uint64_t step_bytes = 0;
  std::vector<PlaneChoice> planes;
  std::uint64_t bootstrap_bytes = 0, first_picture_bytes = 0, mesh_bytes = 0, table_bytes = 0,
                texture_bytes = 0;
  double first_picture_s = 0;                  // the smallest proxy, else the coarsest mesh with previews
  double mesh_s = 0;                           // the chosen scale and all tables are there
  double complete_s = 0;                       // the last fragment
  SimulationResult textures;                   // its times count from mesh_s
  double mean_quality = 0, worst_quality = 0;  // IJG quality of fragments, surface-weighted mean; skipped = 0
  // Predicted FLIP of lit pictures of that height against S_0 with the source's texels: 0 = equal, 1 = as
  // different as can be, which is also what nothing to show has.
  double flip = 0;
  double texture_flip = 0;          // what it would be of S_0 with these textures
  PerGroup group_weights{1, 1, 1};  // ListOptions::group_weights of the list that `textures` is about
  double gamma = -1;                // ListOptions::gamma of that list
  GpuBytes gpu;                     // the browser keeps the mesh in main memory, too
  std::vector<std::string> warnings;
  std::uint64_t bytes() const {
    return bootstrap_bytes + first_picture_bytes + step_bytes + mesh_bytes + table_bytes + texture_bytes;
  }
};

/// What comes within a time limit, mesh first, then textures. The scale is the rule's. A coarser scale takes
/// its place where the rule's mesh comes too late, or where simulations of both scales show that the coarser
/// one gives the better picture in the time. By kFlip a finer one does where time is left and its picture is
/// much better, up to finest_shown(): what passes for S_0 still differs from it. A proxy that cannot be told
/// from S_0 at the displayed height, or that looks better than what scales give in the time, takes the place
/// of all; not where the request says a scale, and not the former where it asks for another rule than kFlip.
/// Textures are those that look best in the bytes that the link gives in the time left; where a simulation
/// shows a picture farther off than these could, also those for fewer bytes, and what looks better stays.
/// Fragments come in groups, as clients ask for them (decide/request_groups.h); one by one with
/// Policy::kThesis or a window of the request's own.
/// On a slow link a larger proxy may come before documents and mesh, where proxy_step() says so. A scale and
/// mips of the textures keep within DeliveryRequest::memory_bytes.
/// With Policy::kThesis it is as printed: the rule's scale and no other, textures by the display's
/// resolution (8.1.1), the list whose D_i(Gamma) is T_0 beta_0. Deterministic.
DeliveryPlan plan_delivery(PackageReader& package, const DeliveryRequest& request);
/// Chapter 4's textures for so many bytes: planes_for_display(), and the list whose D_i(Gamma) comes to that.
/// `options.scale` and `options.displayed_px` count.
struct ThesisTextures {
  std::vector<PlaneChoice> planes;
  ListOptions options;  // of `list`
  FragmentList list;
};
ThesisTextures thesis_textures(TextureLoss& loss, const ListOptions& options, double bytes);

/// The scale and the textures that look best in so many bytes, whatever the time and the rule: a scale that
/// passes for S_0 still differs from it, and bytes that are left may go into a finer one. Mesh first, then
/// texture, or a proxy and nothing else. Where nothing fits: the least that the package has, with a warning.
DeliveryPlan plan_budget(PackageReader& package, const DeliveryRequest& request, std::uint64_t bytes);

/// The scale that the request asks for: DeliveryRequest::scale, or the rule's.
int wanted_scale(PackageReader& package, const DeliveryRequest& request);

// What a transfer decides by itself, as it goes. It keeps within DeliveryRequest::memory_bytes as plans do.

/// A proxy that no one can tell from S_0; nothing where the request says a scale or another rule than kFlip.
std::optional<std::size_t> proxy_instead(const Manifest& manifest, const DeliveryRequest& request);
/// The larger proxy that comes before documents and mesh; nothing where none pays, or where the request says
/// a scale, another rule than kFlip or Policy::kThesis.
std::optional<std::size_t> proxy_on_the_way(const Manifest& manifest, const DeliveryRequest& request,
                                            const StepLink& link);
/// Memory that a scale leaves for textures, bytes.
double texture_memory(PackageReader& package, const DeliveryRequest& request, int scale);

/// The list that a plan of this package is about.
FragmentList list_of(PackageReader& package, const DeliveryRequest& request, const DeliveryPlan& plan);

}  // namespace texmesh
