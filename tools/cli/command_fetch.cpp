#include <chrono>
#include <csignal>
#include <iostream>
#include <memory>
#include <optional>

#include "delivery/cpp/client/texture_loader.h"
#include "delivery/cpp/package/http_store.h"
#include "delivery/cpp/transfer/package_transport.h"
#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "format/rules/proxy_choice.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/fetch/fetched.h"
#include "tools/cli/fetch/fetched_files.h"
#include "tools/cli/fetch/link_watch.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/cli/options/probe_options.h"
#include "tools/cli/options/units.h"
#include "tools/extract/glb/scale_file.h"

namespace texmesh {
namespace {

using Clock = std::chrono::steady_clock;

struct FetchArguments {
  DeliveryArguments delivery;
  ProbeArguments probe;
  std::vector<std::string> mirrors;
  std::string refine = "0", output, record, history;
  bool whole_rungs = false, json = false;
};

volatile std::sig_atomic_t interrupted = 0;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// What has moved so far and in which time, without the round trips.
struct Moved {
  // What comes in one burst with an answer's first byte says little of the link.
  static constexpr double kLeastShare = 0.2;
  static constexpr double kMost_bytes_s = 1e9;
  std::uint64_t bytes = 0;
  double seconds = 0;
  void add(std::uint64_t n, double s, double rtt_s) {
    bytes += n;
    seconds += std::max({1e-4, kLeastShare * s, s - rtt_s});
  }
  /// `first`: what the first answer alone shows, when nothing else was asked for.
  double bytes_s(double first) const {
    return std::clamp(bytes > 0 ? static_cast<double>(bytes) / seconds : first, 100.0, kMost_bytes_s);
  }
};

/// The proxy, checked; the smallest one mostly comes with the first answer.
void fetch_proxy(PackageReader& package, std::uint32_t proxy, FetchedFiles& writer, Fetched& f,
                 Moved& moved) {
  const EntryRef& entry = package.manifest().proxies[proxy].glb;
  const auto start = Clock::now();
  if (entry.offset + entry.bytes > kStartBytes || package.store().is_folder()) {
    package.store().prefetch({entry});
    moved.add(entry.bytes, seconds_since(start), f.rtt_s);
  }
  writer.write_entry(proxy_path(proxy), package.proxy_glb(proxy));
  f.mesh_bytes += entry.bytes;
}

/// Everything that is needed to decide: one round trip, with what the first answer lacks of the coarsest
/// mesh.
void fetch_documents(PackageReader& package, bool table_streams, Fetched& f, Moved& moved) {
  const Manifest& m = package.manifest();
  const auto start = Clock::now();
  std::vector<EntryRef> wanted{m.scales.back().glb, m.index, m.tables, m.textures, m.quality};
  std::uint64_t bytes = 0;
  for (const EntryRef& e : wanted) f.mesh_bytes += e.bytes, bytes += e.bytes;
  if (!package.store().is_folder()) {
    // From the index to the end of the tables, the table streams between them; behind a proxy the coarsest
    // mesh stands there, too.
    const EntryRef& last = m.proxies.empty() ? m.tables : m.scales.back().glb;
    const std::uint64_t end = last.offset + last.bytes;
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

/// What looks best in the time, as a plan over such a link says.
void choose_in_time(PackageReader& package, DeliveryRequest request, double bytes_s, Fetched& f) {
  request.network.rtt_s = f.rtt_s;
  request.network.link = BandwidthTrace::constant(bytes_s);
  f.scale = request.scale;
  if (request.scale >= 0) return;
  const DeliveryPlan plan = plan_delivery(package, request);
  f.scale = plan.scale;
  f.proxy = plan.proxy;
}

/// A larger proxy on the way to a scale, where it pays.
void fetch_step(PackageReader& package, const DeliveryRequest& request, double bytes_s,
                Clock::time_point start, FetchedFiles& writer, Fetched& f, Moved& moved) {
  const std::optional<std::size_t> step = proxy_on_the_way(
      package.manifest(), request, {bytes_s, f.rtt_s, request.time_limit_s - seconds_since(start)});
  if (!step) return;
  fetch_proxy(package, static_cast<std::uint32_t>(*step), writer, f, moved);
  f.step = {static_cast<std::uint32_t>(*step), seconds_since(start)};
}

/// A proxy instead of a scale: nothing else is needed.
void end_with_proxy(PackageReader& package, double displayed_px, Clock::time_point start,
                    FetchedFiles& writer, Fetched& f, Moved& moved) {
  if (*f.proxy > 0 && !(f.step && f.step->proxy == *f.proxy))
    fetch_proxy(package, *f.proxy, writer, f, moved);
  f.scale = package.manifest().scales.back().scale;
  f.mesh_s = f.end_s = seconds_since(start);
  f.flip = f.texture_flip = proxy_loss(package.manifest(), *f.proxy, displayed_px).flip;
  f.gpu = gpu_proxy(package.manifest().proxies[*f.proxy]);
}

Bytes fetch_mesh(PackageReader& package, Fetched& f, Moved& moved) {
  const Manifest& m = package.manifest();
  EntryRef entry = package.scale_entry(f.scale);
  // A container gives the prefix that the scale takes. A tree has the stream as one file.
  if (entry.path == kSplitStreamPath && m.stream && package.store().is_folder())
    entry = {kSplitStreamPath, m.stream->offset, m.stream->bytes, {}};
  if (f.scale != m.scales.back().scale) {
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

std::vector<std::string> all_urls(const FetchArguments& a) {
  std::vector<std::string> urls{a.delivery.package};
  urls.insert(urls.end(), a.mirrors.begin(), a.mirrors.end());
  return urls;
}

/// From where the package is, and its mirrors.
std::unique_ptr<Transport> fragment_transport(const FetchArguments& a, const HttpOptions& http,
                                              PackageStore& store, Fetched& f) {
  const HttpPlace& place = f.place;
  f.urls = {place.url};
  if (place.in_memory) return open_transport(store);
  TransportOptions options;
  options.http = http;
  options.connections = a.delivery.connections;
  const std::vector<std::string> all = all_urls(a);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (i != place.mirror) f.urls.push_back(all[i]);
  if (!place.etag.empty()) options.etags[place.url] = place.etag;
  return open_transport(f.urls, options);
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

/// The textures for the time, and in `load.list` how they are listed.
std::vector<PlaneChoice> choose_textures(PackageReader& package, double memory_bytes, LoadOptions& load) {
  const double budget_bytes = load.htc.time_limit_s * load.htc.throughput.initial_bytes_s;
  TextureLoss loss(package, load.list.displayed_px);
  if (load.htc.policy == Policy::kThesis) {
    ThesisTextures as_printed = thesis_textures(loss, load.list, budget_bytes);
    load.list = as_printed.options;
    load.group_bytes = 0;  // fragment by fragment
    return std::move(as_printed.planes);
  }
  const TextureBudget budget =
      texture_for_budget(loss, load.list, static_cast<std::uint64_t>(budget_bytes), memory_bytes);
  load.list.group_weights = budget.list.group_weights;
  return budget.planes;
}

void fetch_textures(const FetchArguments& a, const DeliveryRequest& request, const HttpOptions& http,
                    PackageReader& package, Clock::time_point start, double bytes_s, FetchedFiles& writer,
                    LinkWatch& watch, Fetched& f) {
  f.whole_rungs = a.whole_rungs || !f.place.ranges;
  const auto transport = fragment_transport(a, http, package.store(), f);
  const bool network = !f.place.in_memory && f.place.ranges;
  TextureLoader loader(package, watch.monitored(*transport, package, network, f.rtt_s), f.whole_rungs);
  LoadOptions load;
  load.list.scale = f.scale;
  load.list.displayed_px = request.displayed_px;
  load.htc = request.htc;
  load.htc.rtt_s = f.rtt_s;
  load.htc.time_limit_s = std::max(1e-3, request.time_limit_s - f.mesh_s);
  load.htc.throughput.initial_bytes_s = bytes_s;
  load.group_bytes = group_bytes(load.htc.throughput.initial_bytes_s, f.rtt_s, load.htc.time_limit_s);
  const std::vector<PlaneChoice> planes =
      choose_textures(package, texture_memory(package, request, f.scale), load);
  f.gpu = gpu_scale(package, f.scale, planes);
  load.cancelled = http.cancelled;
  load.on_fragment = [&](const LoadedFragment& fragment) { writer.add(fragment); };
  f.load = loader.load(planes, load);
  f.end_s = seconds_since(start);
  if (const double seconds = parse_duration(a.refine, "--refine"); seconds > 0 && !f.load.cancelled)
    f.refined = loader.refine(planes, load, {seconds, ~0ull});
  f.texture_bytes = loader.bytes();
  writer.write();
  predict(package, loader, planes, load.list, f);
}

/// Bytes per second of all that was fetched.
double mean_bytes_s(const Fetched& f, Moved moved) {
  if (f.place.in_memory) return f.place.bytes_s;
  const double textures_s = f.end_s - f.mesh_s;
  if (f.load.transfer.bytes > 0 && textures_s > 0) moved.add(f.load.transfer.bytes, textures_s, f.rtt_s);
  return moved.bytes_s(f.place.bytes_s);
}

Fetched fetch(const FetchArguments& a, LinkWatch& watch) {
  const DeliveryRequest request = delivery_request(a.delivery);
  const HttpOptions http = watch.watched(http_options(request.time_limit_s));
  Fetched f;
  Moved moved;
  const auto start = Clock::now();
  auto opened = open_urls(all_urls(a), http);
  const HttpStore& server = *opened;
  PackageReader package(std::move(opened));
  f.place = server.place();
  f.rtt_s = request.network.rtt_s > 0 ? request.network.rtt_s : f.place.rtt_s;
  const auto bytes_s = [&] {
    if (f.place.in_memory) return Moved::kMost_bytes_s;  // all of it is here
    return request.beta0_bytes_s > 0 ? request.beta0_bytes_s
                                     : watch.beta0(f.place.url, moved.bytes_s(f.place.bytes_s));
  };
  FetchedFiles writer(package, a.output);
  const bool proxies =
      !package.manifest().proxies.empty() && request.scale < 0 && request.htc.policy != Policy::kThesis;
  if (proxies) {
    fetch_proxy(package, 0, writer, f, moved);
    f.first_picture_s = seconds_since(start);
    f.proxy = proxy_instead(package.manifest(), request);
  }
  if (!f.proxy) {
    if (proxies) fetch_step(package, request, bytes_s(), start, writer, f, moved);
    fetch_documents(package, !a.output.empty(), f, moved);
    if (!proxies) f.first_picture_s = seconds_since(start);
    choose_in_time(package, request, bytes_s(), f);
  }
  if (f.proxy) {
    end_with_proxy(package, request.displayed_px, start, writer, f, moved);
    watch.finish({f.place.url}, f.load, f.rtt_s, mean_bytes_s(f, moved));
    return f;
  }
  writer.write_entry(mesh_path(f.scale), fetch_mesh(package, f, moved));
  f.mesh_s = seconds_since(start);
  f.place = server.place();
  fetch_textures(a, request, http, package, start, bytes_s(), writer, watch, f);
  watch.finish(f.urls, f.load, f.rtt_s, mean_bytes_s(f, moved));
  return f;
}

int run_fetch(FetchArguments& args) {
  std::signal(SIGINT, [](int) {
    interrupted = 1;
    std::signal(SIGINT, SIG_DFL);  // a second one ends the process
  });
  args.delivery.needs_link = false;
  const double limit_s = parse_duration(args.delivery.time, "--time");
  LinkWatch watch(args.record, args.history, probe_options(args.probe));
  if (!watch.problem().empty()) std::cerr << "warning: no historic average: " << watch.problem() << '\n';
  Fetched f;
  try {
    f = fetch(args, watch);
  } catch (const InputError&) {
    if (interrupted == 0) throw;
    std::cerr << "interrupted\n";
    return 130;
  }
  if (static_cast<double>(f.gpu.all()) > delivery_request(args.delivery).memory_bytes)
    std::cerr << "warning: even the least takes " << f.gpu.all() << " bytes on the GPU\n";
  std::cout << (args.json ? fetched_json(f, watch, limit_s) : fetched_text(f, watch, limit_s));
  return f.load.cancelled ? 130 : f.load.given_up > 0 ? kExitDifferent : kExitOk;
}

void add_fetch_options(Command& c, FetchArguments& args) {
  DeliveryArguments& d = args.delivery;
  c.option("URL", d.package, "http(s) URL of a .texmesh file, or of its tree (which ends in a slash)")
      .required();
  add_time_option(c, d);
  add_display_option(c, d);
  add_scale_option(c, d);
  add_memory_option(c, d);
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
  c.option("--record", args.record, "Write the link's throughput as a trace for simulate --trace")
      .value_name("FILE")
      .rare();
  c.option(
       "--history", args.history,
       "File that keeps each host's average throughput from run to run, the first guess of the next; state "
       "= links.json in the user's state folder (default: none is kept)")
      .value_name("FILE")
      .rare();
  add_probe_options(c, args.probe);
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
      "  texmesh fetch https://host/bust.texmesh --time 4 --memory 64MB\n"
      "  texmesh fetch https://a/bust.texmesh --mirror https://b/bust.texmesh --time 2 --refine 10 -o got");
  c.notes(
      "fetch checks every fragment against its digest. The fragments of a texture are dealt to the servers by "
      "their speed. A server whose bytes are wrong is dropped; what a server fails to deliver, fetch asks of "
      "another one. A folder (URL with a slash) may lack some of the files. The package is read from the first server that answers. A server that knows no "
      "ranges is asked for whole rungs of the tree beside the container.\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when fragments were given up, 130 when "
      "interrupted.");
  c.on_run([args] { return run_fetch(*args); });
}

}  // namespace texmesh
