#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "delivery/cpp/http_store.h"
#include "delivery/cpp/package_transport.h"
#include "delivery/cpp/texture_loader.h"
#include "pipeline/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/delivery_options.h"
#include "pipeline/cli/units.h"
#include "pipeline/inspect/text_table.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
using Bytes = std::vector<std::uint8_t>;
using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

struct FetchArguments {
  DeliveryArguments delivery;
  std::vector<std::string> mirrors;
  std::string refine = "0", output;
  bool whole_rungs = false, json = false;
};

volatile std::sig_atomic_t interrupted = 0;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// What the transfer came to.
struct Fetched {
  int scale = 0;
  double rtt_s = 0, mesh_s = 0, end_s = 0;
  std::uint64_t mesh_bytes = 0, texture_bytes = 0;
  LoadReport load;
  std::optional<LoadReport> refined;
  double texture_dssim = 0, ssim = 0;
};

/// Time of a request for one byte over a connection that is open: what a round trip takes, the server's own
/// time included.
double measured_rtt_s(const std::string& url, const HttpOptions& http) {
  HttpClient client(http);
  const std::string file = url.ends_with('/') ? url + kManifestPath : url;
  double least_s = 1e3;
  for (int i = 0; i < 3; ++i) {
    const auto start = Clock::now();
    client.get(file, HttpRange{0, 1}, "", 1);
    if (i > 0) least_s = std::min(least_s, seconds_since(start));
  }
  return least_s;
}

/// Files as `unpack --fragments files` names them, the best rung of each fragment.
class FragmentWriter {
 public:
  FragmentWriter(PackageReader& package, const std::string& folder) : package_(package), folder_(folder) {}
  void take(const LoadedFragment& f) {
    if (folder_.empty()) return;
    auto& streams = streams_[{f.plane, f.fragment}];
    const Codec codec = package_.textures()[f.plane].codec;
    if (!codec_traits(codec).incremental) streams.clear();
    streams.insert(streams.end(), f.streams.begin(), f.streams.end());
    rungs_[{f.plane, f.fragment}] = f.rung;
  }
  void write() {
    for (const auto& [where, streams] : streams_) {
      const auto [plane, fragment] = where;
      const Codec codec = package_.textures()[plane].codec;
      const CodecTraits& traits = codec_traits(codec);
      const auto rung = static_cast<std::uint32_t>(rungs_[where]);
      const Bytes file =
          join_fragment(codec, package_.table_stream(plane, traits.incremental ? 0 : rung),
                        std::vector<std::span<const std::uint8_t>>(streams.begin(), streams.end()));
      write_entry(fragment_file_path(plane, rung, fragment, traits.extension), file);
    }
  }
  void write_entry(const std::string& path, const Bytes& bytes) {
    if (folder_.empty()) return;
    const fs::path file = fs::path(folder_) / path;
    fs::create_directories(file.parent_path());
    write_file_atomically(file.string(), bytes);
  }

 private:
  PackageReader& package_;
  std::string folder_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Bytes>> streams_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> rungs_;
};

Fetched fetch(const FetchArguments& a) {
  const DeliveryRequest request = delivery_request(a.delivery);
  if (!is_url(a.delivery.package))
    throw InputError(a.delivery.package, "", "an http or https URL", "another text");
  TransportOptions options;
  options.connections = a.delivery.connections;
  Fetched f;
  f.rtt_s =
      request.network.rtt_s > 0 ? request.network.rtt_s : measured_rtt_s(a.delivery.package, options.http);

  const auto start = Clock::now();
  PackageReader package(open_url(a.delivery.package, options.http));
  const Manifest& m = package.manifest();
  f.scale = wanted_scale(package, request);
  FragmentWriter writer(package, a.output);
  const auto mesh_start = Clock::now();
  const Bytes mesh = package.scale_glb(f.scale);
  package.tables();
  f.mesh_s = seconds_since(start);
  f.mesh_bytes = mesh.size() + m.index.bytes + m.tables.bytes + m.textures.bytes;
  writer.write_entry(mesh_path(f.scale), mesh);

  std::vector<std::string> mirrors{a.delivery.package};
  mirrors.insert(mirrors.end(), a.mirrors.begin(), a.mirrors.end());
  const auto transport = open_transport(mirrors, options);
  TextureLoader loader(package, *transport, a.whole_rungs);
  LoadOptions load;
  load.list.scale = f.scale;
  load.htc = request.htc;
  load.htc.rtt_s = f.rtt_s;
  load.htc.time_limit_s = std::max(1e-3, request.time_limit_s - f.mesh_s);
  const double mesh_rate = static_cast<double>(f.mesh_bytes) / std::max(1e-6, seconds_since(mesh_start));
  load.htc.throughput.initial_bytes_s = request.beta0_bytes_s > 0 ? request.beta0_bytes_s : mesh_rate;
  const auto budget_bytes =
      static_cast<std::uint64_t>(load.htc.time_limit_s * load.htc.throughput.initial_bytes_s);
  const std::vector<PlaneChoice> planes =
      texture_for_budget(package, request.displayed_px, load.list, budget_bytes).planes;
  load.cancelled = [] { return interrupted != 0; };
  load.on_fragment = [&](const LoadedFragment& fragment) { writer.take(fragment); };
  f.load = loader.load(planes, load);
  f.end_s = seconds_since(start);
  if (const double seconds = parse_duration(a.refine, "--refine"); seconds > 0 && !f.load.cancelled)
    f.refined = loader.refine(planes, load, {seconds, ~0ull});
  f.texture_bytes = loader.bytes();
  writer.write();

  const FragmentList list = fragment_list(package, planes, load.list);
  double loss = 0;
  for (std::size_t i = 0; i < list.offers.size(); ++i)
    loss += list.offers[i].loss[static_cast<std::size_t>(
        loader.held(list.fragments[i].plane, list.fragments[i].fragment) + 1)];
  const double shown = list.total_weight > 0 ? 1 - loss / list.total_weight : 1;
  f.texture_dssim = 1 - shown * (1 - mip_loss(package, planes, request.displayed_px));
  f.ssim = predicted_ssim(package, request.displayed_px, f.scale, f.texture_dssim);
  return f;
}

Json fetch_json(const Fetched& f, double limit_s) {
  Json j{{"version", 1},
         {"scale", f.scale},
         {"rtt_s", f.rtt_s},
         {"mesh_s", f.mesh_s},
         {"end_s", f.end_s},
         {"deviation_percent", 100 * (limit_s - f.end_s) / limit_s},
         {"mesh_bytes", f.mesh_bytes},
         {"texture_bytes", f.texture_bytes},
         {"fragments", f.load.transfer.rungs.size()},
         {"skipped", f.load.transfer.skipped},
         {"given_up", f.load.given_up},
         {"cancelled", f.load.cancelled},
         {"texture_ssim", 1 - f.texture_dssim},
         {"ssim", f.ssim}};
  if (f.refined)
    j["refined"] = {{"seconds", f.refined->transfer.end_s}, {"bytes", f.refined->transfer.bytes}};
  return j;
}

void print(const Fetched& f, double limit_s) {
  std::cout << fmt::format(
      "S_{} and tables after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
      "textures after {:.3f} s: {:+.2f} % of the limit of {:.2f} s, {} bytes in {} fragments, {} skipped, {} "
      "given up\n",
      f.scale, f.mesh_s, grouped(f.mesh_bytes), 1000 * f.rtt_s, f.end_s, 100 * (limit_s - f.end_s) / limit_s,
      limit_s, grouped(f.load.transfer.bytes), f.load.transfer.rungs.size(), f.load.transfer.skipped,
      f.load.given_up);
  if (f.refined)
    std::cout << fmt::format("refined for {:.3f} s with {} bytes{}\n", f.refined->transfer.end_s,
                             grouped(f.refined->transfer.bytes),
                             f.refined->cancelled ? ", until its time was over" : "");
  std::cout << fmt::format(
      "surface-weighted SSIM of the textures {:.4f}, predicted SSIM of the object {:.4f}{}\n",
      1 - f.texture_dssim, f.ssim, f.load.cancelled ? "; cancelled" : "");
}

}  // namespace

void add_fetch_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<FetchArguments>();
  CLI::App* c = app.add_subcommand("fetch", "Fetch from web servers what a viewer would get within a time");
  DeliveryArguments& d = args->delivery;
  c->add_option("url", d.package, "http(s) URL of a .texmesh file, or of its tree (ending in a slash)")
      ->required();
  c->add_option("--time", d.time, "Time limit from the first request on: 4, 1.5s, 800ms")
      ->capture_default_str();
  c->add_option("--display", d.display_px, "Displayed height of the object, device pixels")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  c->add_option("--mirror", args->mirrors, "URL of the same package on another server; may be given again");
  c->add_option("--policy", d.policy, "htca, guard, price, proportional or static, see simulate")
      ->check(CLI::IsMember({"htca", "guard", "price", "proportional", "static", "htca-guard", "htca-price"}))
      ->capture_default_str();
  c->add_option("--scale", d.scale, "This scale instead of the one that suits the display")
      ->check(CLI::Range(0, 99));
  c->add_option("--rtt", d.rtt, "Round trip, 40 are milliseconds; 0 = measured first")->capture_default_str();
  c->add_option("--window", d.window, "Requests in flight; 0 = by throughput and round trip")
      ->check(CLI::Range(0, 64));
  c->add_option("--connections", d.connections, "Connections per server")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  c->add_option("--refine", args->refine, "Go on for so long after the limit, best upgrades first")
      ->capture_default_str();
  c->add_flag("--whole-rungs", args->whole_rungs,
              "All fragments of a texture at once: for trees on servers without ranges");
  c->add_option("-o,--output", args->output,
                "Folder for the scale's GLB and the fragments as complete image files");
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Every fragment is checked against its digest; what a server fails to deliver is asked of another "
      "one.\n"
      "Examples:\n"
      "  texmesh fetch https://host/bust.texmesh --time 4 --display 800\n"
      "  texmesh fetch https://a/bust.texmesh --mirror https://b/bust.texmesh --time 2 --refine 10 -o got\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when fragments were given up, 130 when "
      "interrupted.");
  c->callback([args, &exit_code] {
    std::signal(SIGINT, [](int) { interrupted = 1; });
    args->delivery.needs_link = false;
    const double limit_s = parse_duration(args->delivery.time, "--time");
    const Fetched f = fetch(*args);
    if (args->json)
      std::cout << fetch_json(f, limit_s).dump() << '\n';
    else
      print(f, limit_s);
    exit_code = f.load.cancelled ? 130 : f.load.given_up > 0 ? kExitDifferent : kExitOk;
  });
}

}  // namespace texmesh
