#include <fmt/format.h>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "delivery/cpp/client/texture_loader.h"
#include "delivery/cpp/package/http_store.h"
#include "delivery/cpp/transfer/package_transport.h"
#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/cli/options/delivery_options.h"
#include "pipeline/cli/options/units.h"
#include "pipeline/extract/glb/scale_file.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
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
  double rtt_s = 0, first_picture_s = 0, mesh_s = 0, end_s = 0;
  std::uint64_t mesh_bytes = 0, texture_bytes = 0;  // mesh: the documents and the first picture, too
  HttpPlace place;
  bool whole_rungs = false;
  LoadReport load;
  std::optional<LoadReport> refined;
  double texture_flip = 0, flip = 0;  // predicted of what has come
};

/// Files as `unpack --fragments files` names them, the best rung of each fragment.
class FragmentWriter {
 public:
  FragmentWriter(PackageReader& package, const std::string& folder) : package_(package), folder_(folder) {}
  void add(const LoadedFragment& f) {
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

/// What has moved so far and in which time, without the round trips.
struct Moved {
  // What comes in one burst with an answer's first byte says little of the link.
  static constexpr double kLeastShare = 0.2;
  std::uint64_t bytes = 0;
  double seconds = 0;
  void add(std::uint64_t n, double s, double rtt_s) {
    bytes += n;
    seconds += std::max({1e-4, kLeastShare * s, s - rtt_s});
  }
  /// `first`: what the first answer alone shows, when nothing else was asked for.
  double bytes_s(double first) const {
    return std::clamp(bytes > 0 ? static_cast<double>(bytes) / seconds : first, 100.0, 1e9);
  }
};

/// Everything that is needed to decide: one round trip, with what the first answer lacks of the coarsest
/// mesh.
void fetch_documents(PackageReader& package, bool table_streams, Fetched& f, Moved& moved) {
  const Manifest& m = package.manifest();
  const auto start = Clock::now();
  std::vector<EntryRef> wanted{m.scales.back().glb, m.index, m.tables, m.textures, m.quality};
  std::uint64_t bytes = 0;
  for (const EntryRef& e : wanted) f.mesh_bytes += e.bytes, bytes += e.bytes;
  if (!package.store().is_folder()) {
    // From the index to the end of the tables, the table streams between them.
    const std::uint64_t end = m.tables.offset + m.tables.bytes;
    wanted.push_back({"", m.index.offset, end - m.index.offset, {}});
    bytes = end - std::min(end, kStartBytes);
  }
  package.store().prefetch(wanted);
  if (bytes > 0) moved.add(bytes, seconds_since(start), f.rtt_s);
  package.tables();
  if (table_streams && package.store().is_folder()) {
    std::vector<EntryRef> streams;
    for (const TextureInfo& t : package.textures()) streams.push_back(t.tables);
    package.store().prefetch(streams);
  }
  package.quality();
  package.scale_glb(m.scales.back().scale);
}

/// The scale that looks best in the time, as a plan over such a link says.
int scale_in_time(PackageReader& package, DeliveryRequest request, double rtt_s, double bytes_s) {
  request.network.rtt_s = rtt_s;
  request.network.link = BandwidthTrace::constant(bytes_s);
  if (request.scale >= 0) return request.scale;
  return plan_delivery(package, request).scale;
}

Bytes fetch_mesh(PackageReader& package, Fetched& f, Moved& moved) {
  const EntryRef& entry = package.scale_entry(f.scale);
  if (f.scale != package.manifest().scales.back().scale) {
    const auto start = Clock::now();
    package.store().prefetch({entry});
    moved.add(entry.bytes, seconds_since(start), f.rtt_s);
    f.mesh_bytes += entry.bytes;
  }
  return scale_file(package, f.scale, {}, StreamedNormals::kStreamed).finish();
}

HttpOptions http_options(double time_limit_s) {
  HttpOptions http;
  http.cancelled = [] { return interrupted != 0; };
  http.stall_timeout_s = http.connect_timeout_s = std::clamp(time_limit_s, 2.0, 8.0);
  return http;
}

/// From where the package is, and its mirrors.
std::unique_ptr<Transport> fragment_transport(const FetchArguments& a, const HttpPlace& place,
                                              const HttpOptions& http, PackageStore& store) {
  if (place.in_memory) return open_transport(store);
  TransportOptions options;
  options.http = http;
  options.connections = a.delivery.connections;
  std::vector<std::string> all{a.delivery.package};
  all.insert(all.end(), a.mirrors.begin(), a.mirrors.end());
  std::vector<std::string> mirrors{place.url};
  for (std::size_t i = 0; i < all.size(); ++i)
    if (i != place.mirror) mirrors.push_back(all[i]);
  if (!place.etag.empty()) options.etags[place.url] = place.etag;
  return open_transport(mirrors, options);
}

void predict(PackageReader& package, const TextureLoader& loader, const std::vector<PlaneChoice>& planes,
             const ListOptions& options, Fetched& f) {
  const FragmentList list = fragment_list(package, planes, options);
  std::vector<std::int32_t> rungs;
  for (const ListedFragment& listed : list.fragments)
    rungs.push_back(loader.held(listed.plane, listed.fragment));
  const PerGroup losses = losses_of(list, rungs);
  f.texture_flip = texture_flip(package.quality(), losses);
  f.flip = picture_flip(package.quality(), options.displayed_px, f.scale, losses);
}

Fetched fetch(const FetchArguments& a) {
  const DeliveryRequest request = delivery_request(a.delivery);
  const HttpOptions http = http_options(request.time_limit_s);
  std::vector<std::string> mirrors{a.delivery.package};
  mirrors.insert(mirrors.end(), a.mirrors.begin(), a.mirrors.end());
  Fetched f;
  Moved moved;
  const auto start = Clock::now();
  auto opened = open_urls(mirrors, http);
  const HttpStore& server = *opened;
  PackageReader package(std::move(opened));
  f.place = server.place();
  f.rtt_s = request.network.rtt_s > 0 ? request.network.rtt_s : f.place.rtt_s;
  fetch_documents(package, !a.output.empty(), f, moved);
  f.first_picture_s = seconds_since(start);
  f.scale = scale_in_time(package, request, f.rtt_s,
                          request.beta0_bytes_s > 0 ? request.beta0_bytes_s : moved.bytes_s(f.place.bytes_s));
  FragmentWriter writer(package, a.output);
  writer.write_entry(mesh_path(f.scale), fetch_mesh(package, f, moved));
  f.mesh_s = seconds_since(start);
  f.place = server.place();

  f.whole_rungs = a.whole_rungs || !f.place.ranges;
  const auto transport = fragment_transport(a, f.place, http, package.store());
  TextureLoader loader(package, *transport, f.whole_rungs);
  LoadOptions load;
  load.list.scale = f.scale;
  load.list.displayed_px = request.displayed_px;
  load.htc = request.htc;
  load.htc.rtt_s = f.rtt_s;
  load.htc.time_limit_s = std::max(1e-3, request.time_limit_s - f.mesh_s);
  load.htc.throughput.initial_bytes_s =
      request.beta0_bytes_s > 0 ? request.beta0_bytes_s : moved.bytes_s(f.place.bytes_s);
  load.group_bytes = group_bytes(load.htc.throughput.initial_bytes_s, f.rtt_s, load.htc.time_limit_s);
  const auto budget_bytes =
      static_cast<std::uint64_t>(load.htc.time_limit_s * load.htc.throughput.initial_bytes_s);
  const TextureBudget budget = texture_for_budget(package, load.list, budget_bytes);
  const std::vector<PlaneChoice>& planes = budget.planes;
  load.list.group_weights = budget.list.group_weights;
  load.cancelled = http.cancelled;
  load.on_fragment = [&](const LoadedFragment& fragment) { writer.add(fragment); };
  f.load = loader.load(planes, load);
  f.end_s = seconds_since(start);
  if (const double seconds = parse_duration(a.refine, "--refine"); seconds > 0 && !f.load.cancelled)
    f.refined = loader.refine(planes, load, {seconds, ~0ull});
  f.texture_bytes = loader.bytes();
  writer.write();
  predict(package, loader, planes, load.list, f);
  return f;
}

Json fetch_json(const Fetched& f, double limit_s) {
  Json j{{"version", 1},
         {"scale", f.scale},
         {"rtt_s", f.rtt_s},
         {"url", shown_url(f.place.url)},
         {"whole_rungs", f.whole_rungs},
         {"first_picture_s", f.first_picture_s},
         {"mesh_s", f.mesh_s},
         {"end_s", f.end_s},
         {"deviation_percent", 100 * (limit_s - f.end_s) / limit_s},
         {"mesh_bytes", f.mesh_bytes},
         {"texture_bytes", f.texture_bytes},
         {"requests", f.load.transfer.steps.size()},
         {"fragments", f.load.fragments},
         {"skipped", f.load.skipped},
         {"given_up", f.load.given_up},
         {"problems", f.load.problems},
         {"cancelled", f.load.cancelled},
         {"texture_flip", f.texture_flip},
         {"flip", f.flip}};
  if (f.refined)
    j["refined"] = {{"seconds", f.refined->transfer.end_s}, {"bytes", f.refined->transfer.bytes}};
  return j;
}

void print_fetched(const Fetched& f, double limit_s) {
  std::cout << fmt::format(
      "{}: first picture and tables after {:.3f} s, S_{} after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
      "textures after {:.3f} s: {:+.2f} % of the limit of {:.2f} s, {} bytes in {} fragments, {} skipped, {} "
      "given up\n",
      shown_url(f.place.url), f.first_picture_s, f.scale, f.mesh_s, grouped(f.mesh_bytes), 1000 * f.rtt_s,
      f.end_s, 100 * (limit_s - f.end_s) / limit_s, limit_s, grouped(f.load.transfer.bytes), f.load.fragments,
      f.load.skipped, f.load.given_up);
  if (f.place.in_memory)
    std::cout << "the server knows no ranges and has no tree: the whole container was fetched\n";
  else if (f.whole_rungs)
    std::cout << "whole rungs: all fragments of a texture at once\n";
  for (const auto& [why, count] : f.load.problems) std::cout << fmt::format("  {} x {}\n", count, why);
  if (f.refined)
    std::cout << fmt::format("refined for {:.3f} s with {} bytes{}\n", f.refined->transfer.end_s,
                             grouped(f.refined->transfer.bytes),
                             f.refined->out_of_time ? ", until its time was over" : "");
  std::cout << fmt::format(
      "predicted FLIP {:.4f} (0 = equal to the source), {:.4f} by the textures alone{}\n", f.flip,
      f.texture_flip, f.load.cancelled ? "; cancelled" : "");
}

int run_fetch(FetchArguments& args) {
  std::signal(SIGINT, [](int) {
    interrupted = 1;
    std::signal(SIGINT, SIG_DFL);  // a second one ends the process
  });
  args.delivery.needs_link = false;
  const double limit_s = parse_duration(args.delivery.time, "--time");
  Fetched f;
  try {
    f = fetch(args);
  } catch (const InputError&) {
    if (interrupted == 0) throw;
    std::cerr << "interrupted\n";
    return 130;
  }
  if (args.json)
    std::cout << fetch_json(f, limit_s).dump() << '\n';
  else
    print_fetched(f, limit_s);
  return f.load.cancelled ? 130 : f.load.given_up > 0 ? kExitDifferent : kExitOk;
}

void add_fetch_options(Command& c, FetchArguments& args) {
  DeliveryArguments& d = args.delivery;
  c.option("URL", d.package, "http(s) URL of a .texmesh file, or of its tree (which ends in a slash)")
      .required();
  add_time_option(c, d);
  add_display_option(c, d);
  add_scale_option(c, d);
  c.option("--mirror", args.mirrors, "URL of the same package on another server; may be given again")
      .value_name("URL");
  c.option("--refine", args.refine, "Go on for so long after the limit, best upgrades first")
      .value_name("TIME")
      .shows_default();
  c.option("-o,--output", args.output,
           "Folder for the scale's GLB and for the fragments as complete image files")
      .value_name("DIR");
  c.flag("--json", args.json, "Print one JSON object (schemas/fetch.v1.schema.json)");
  c.option("--rtt", d.rtt, "Round trip, 40 are milliseconds; 0 = as the first answer shows it")
      .value_name("TIME")
      .shows_default()
      .rare();
  add_policy_option(c, d).rare();
  add_window_option(c, d).rare();
  c.option("--connections", d.connections, "Connections per server").integer_in(1, 64).shows_default().rare();
  c.flag("--whole-rungs", args.whole_rungs,
         "Ask for all fragments of a texture at once, as of servers without ranges")
      .rare();
}

}  // namespace

void add_fetch_command(Command& app) {
  auto args = std::make_shared<FetchArguments>();
  Command c = app.add("fetch", "Fetch from web servers what a viewer would get within a time");
  add_fetch_options(c, *args);
  c.examples(
      "  texmesh fetch https://host/bust.texmesh --time 4 --display 800\n"
      "  texmesh fetch https://a/bust.texmesh --mirror https://b/bust.texmesh --time 2 --refine 10 -o got");
  c.notes(
      "fetch checks every fragment against its digest. What a server fails to deliver, fetch asks of "
      "another server. The package is read from the first server that answers. A server that knows no "
      "ranges is asked for whole rungs of the tree beside the container.\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when fragments were given up, 130 when "
      "interrupted.");
  c.on_run([args] { return run_fetch(*args); });
}

}  // namespace texmesh
