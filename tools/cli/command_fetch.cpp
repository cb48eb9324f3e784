// texmesh fetch: what a client would get within a time, fetched from web servers. The first answer says how
// the server can be read and how far away it is. Then come a proxy, the documents, the mesh and the textures,
// each chosen by what the link has shown until then (fetch() below is the course of it).
#include <fmt/format.h>
#include <chrono>
#include <csignal>
#include <filesystem>

#include "delivery/cpp/client/texture_loader.h"
#include "delivery/cpp/decide/request_groups.h"
#include "delivery/cpp/package/http_store.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {
namespace {

using Clock = std::chrono::steady_clock;

struct FetchArguments {
  DeliveryArguments delivery;
  std::vector<std::string> mirrors;
  double refine_s = 0;
  std::string output;
};

struct FetchedServer {
  std::string url;
  MirrorShare share;
  static void fields(auto& s, auto&& v) {
    v("url", s.url, "");
    RecordFields<MirrorShare>::fields(s.share, v);
  }
};

struct Refined {
  LoadReport load;
  static void fields(auto& s, auto&& v) {
    v("seconds", s.load.transfer.end_s, kSeconds, "");
    v("bytes", s.load.transfer.bytes, "");
  }
};

/// What the transfer came to, as --json prints it.
struct Fetched {
  int scale = 0;
  std::optional<std::uint32_t> proxy;  // shown instead of the scale
  std::optional<ShownStep> step;
  double limit_s = 1, rtt_s = 0, first_picture_s = 0, mesh_s = 0, end_s = 0;
  std::uint64_t mesh_bytes = 0, texture_bytes = 0;  // mesh: the documents and the first picture, too
  HttpPlace place;
  bool whole_rungs = false;
  LoadReport load;
  std::optional<Refined> refined;
  double texture_flip = 0, flip = 0;  // predicted of what has come
  GpuBytes gpu;
  std::vector<std::string> urls;  // in the order of load.mirrors
  double deviation_percent() const { return 100 * (limit_s - end_s) / limit_s; }
  /// What each has brought, where there are several.
  std::vector<FetchedServer> servers() const {
    std::vector<FetchedServer> out;
    for (std::size_t i = 0; load.mirrors.size() > 1 && i < load.mirrors.size(); ++i)
      out.push_back({shown_url(urls[i]), load.mirrors[i]});
    return out;
  }
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("scale", s.scale, kScaleNumbers, "");
    v("rtt_s", s.rtt_s, kSeconds, "");
    v("url", shown_url(s.place.url), "Where the package was read, without secrets.");
    v("whole_rungs", s.whole_rungs, "The server knows no ranges: all fragments of a texture at one rung.");
    v("first_picture_s", s.first_picture_s, kSeconds, "");
    v("mesh_s", s.mesh_s, kSeconds, "");
    v("end_s", s.end_s, kSeconds, "");
    v("deviation_percent", s.deviation_percent(), kDeviations, "(limit - end) / limit; negative when late.");
    v("mesh_bytes", s.mesh_bytes, "");
    v("texture_bytes", s.texture_bytes, "");
    v("requests", s.load.transfer.steps.size(), "For fragments.");
    v("fragments", s.load.fragments, "That were wanted.");
    v("skipped", s.load.skipped, "By decision.");
    v("given_up", s.load.given_up, "Asked for in vain.");
    v("problems", s.load.problems, Range{1, 4294967295.0},
      "Why requests failed, and how many, tries included.");
    v("cancelled", s.load.cancelled, "");
    v("texture_flip", s.texture_flip, kFlips, "");
    v("flip", s.flip, kFlips, kFlipMeans);
    v("gpu_bytes", s.gpu, "What was chosen takes at most so much on the GPU.");
    v("proxy", s.proxy, kProxyNumbers,
      "The proxy that was fetched instead of a scale; 0 = the smallest. `scale` is the coarsest one then.");
    v("step", s.step, "The larger proxy that was fetched before documents and mesh, and when it was there.");
    v("servers", s.servers(), FieldRule{.count = Range{2, 1000}, .may_miss = true},
      "With --mirror: what each server has brought of the fragments.");
    v("refined", s.refined, "With --refine.");
  }
};

/// What `fetch` writes into its folder: files as `unpack --fragments files` names them, of each fragment the
/// best rung. Without a folder nothing is written.
class FetchedFiles {
 public:
  FetchedFiles(PackageReader& package, const std::string& folder) : package_(package), folder_(folder) {}
  /// Keeps a fragment for write().
  void add(const LoadedFragment& f) {
    if (folder_.empty()) return;
    auto& streams = streams_[{f.plane, f.fragment}];
    if (!codec_traits(package_.textures()[f.plane].codec).incremental) streams.clear();
    streams.insert(streams.end(), f.streams.begin(), f.streams.end());
    rungs_[{f.plane, f.fragment}] = f.rung;
  }
  /// Writes the fragments.
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
  /// Writes an entry at once.
  void write_entry(const std::string& path, const Bytes& bytes) {
    if (folder_.empty()) return;
    const std::filesystem::path file = std::filesystem::path(folder_) / path;
    std::error_code failed;
    std::filesystem::create_directories(file.parent_path(), failed);
    if (failed) throw InputError(file.parent_path().string(), "", "", "cannot be made: " + failed.message());
    write_file_atomically(file.string(), bytes);
  }

 private:
  PackageReader& package_;
  std::string folder_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Bytes>> streams_;  // by plane and fragment
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> rungs_;
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
  options.connections = a.delivery.request.network.connections;
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
  const double budget_bytes = load.htc.time_limit_s * load.htc.initial_bytes_s;
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
                    Fetched& f) {
  f.whole_rungs = !f.place.ranges;
  const auto transport = fragment_transport(a, http, package.store(), f);
  TextureLoader loader(package, *transport, f.whole_rungs);
  LoadOptions load;
  load.list.scale = f.scale;
  load.list.displayed_px = request.displayed_px;
  load.htc = request.htc;
  load.htc.rtt_s = f.rtt_s;
  load.htc.time_limit_s = std::max(1e-3, request.time_limit_s - f.mesh_s);
  load.htc.initial_bytes_s = bytes_s;
  load.group_bytes = group_bytes(load.htc.initial_bytes_s, f.rtt_s, load.htc.time_limit_s);
  const std::vector<PlaneChoice> planes =
      choose_textures(package, texture_memory(package, request, f.scale), load);
  f.gpu = gpu_scale(package, f.scale, planes);
  load.cancelled = http.cancelled;
  load.on_fragment = [&](const LoadedFragment& fragment) { writer.add(fragment); };
  f.load = loader.load(planes, load);
  f.end_s = seconds_since(start);
  if (a.refine_s > 0 && !f.load.cancelled) f.refined = {loader.refine(planes, load, {a.refine_s, ~0ull})};
  f.texture_bytes = loader.bytes();
  writer.write();
  predict(package, loader, planes, load.list, f);
}

Fetched fetch(const FetchArguments& a) {
  const DeliveryRequest request = delivery_request(a.delivery);
  const HttpOptions http = http_options(request.time_limit_s);
  Fetched f;
  f.limit_s = request.time_limit_s;
  Moved moved;
  const auto start = Clock::now();
  auto opened = open_urls(all_urls(a), http);
  const HttpStore& server = *opened;
  PackageReader package(std::move(opened));
  f.place = server.place();
  f.rtt_s = request.network.rtt_s > 0 ? request.network.rtt_s : f.place.rtt_s;
  const auto bytes_s = [&] {
    if (f.place.in_memory) return Moved::kMost_bytes_s;  // all of it is here
    return moved.bytes_s(f.place.bytes_s);
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
    return f;
  }
  writer.write_entry(mesh_path(f.scale), fetch_mesh(package, f, moved));
  f.mesh_s = seconds_since(start);
  f.place = server.place();
  fetch_textures(a, request, http, package, start, bytes_s(), writer, f);
  return f;
}

std::string load_text(const Fetched& f) {
  std::string text;
  if (f.proxy) {
    text += fmt::format(
        "{}: first picture after {:.3f} s, {} after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
        "predicted FLIP {:.4f} (0 = equal to the source): nothing else is needed\n",
        shown_url(f.place.url), f.first_picture_s, proxy_path(*f.proxy), f.mesh_s, grouped(f.mesh_bytes),
        1000 * f.rtt_s, f.flip);
    return text + gpu_text(f.gpu);
  }
  if (f.step) text += fmt::format("on the way: {} after {:.3f} s\n", proxy_path(f.step->proxy), f.step->at_s);
  text += fmt::format(
      "{}: first picture and tables after {:.3f} s, S_{} after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
      "textures after {:.3f} s: {:+.2f} % of the limit of {:.2f} s, {} bytes in {} fragments, {} skipped, {} "
      "given up\n",
      shown_url(f.place.url), f.first_picture_s, f.scale, f.mesh_s, grouped(f.mesh_bytes), 1000 * f.rtt_s,
      f.end_s, f.deviation_percent(), f.limit_s, grouped(f.load.transfer.bytes), f.load.fragments,
      f.load.skipped, f.load.given_up);
  if (f.place.in_memory)
    text += "the server knows no ranges and has no tree: the whole container was fetched\n";
  else if (f.whole_rungs)
    text += "whole rungs: all fragments of a texture at once\n";
  for (const auto& [why, count] : f.load.problems) text += fmt::format("  {} x {}\n", count, why);
  if (f.refined)
    text += fmt::format("refined for {:.3f} s with {} bytes{}\n", f.refined->load.transfer.end_s,
                        grouped(f.refined->load.transfer.bytes),
                        f.refined->load.out_of_time ? ", until its time was over" : "");
  text += fmt::format("predicted FLIP {:.4f} (0 = equal to the source), {:.4f} by the textures alone{}\n",
                      f.flip, f.texture_flip, f.load.cancelled ? "; cancelled" : "");
  return text + gpu_text(f.gpu);
}

std::string servers_text(const Fetched& f) {
  std::string text;
  for (const FetchedServer& server : f.servers()) text += server_text(server.url, server.share);
  return text;
}

int run_fetch(FetchArguments& args) {
  std::signal(SIGINT, [](int) {
    interrupted = 1;
    std::signal(SIGINT, SIG_DFL);  // a second one ends the process
  });
  args.delivery.needs_link = false;
  Fetched f;
  try {
    f = fetch(args);
  } catch (const InputError&) {
    if (interrupted == 0) throw;
    std::cerr << "interrupted\n";
    return 130;
  }
  if (static_cast<double>(f.gpu.all()) > args.delivery.request.memory_bytes)
    std::cerr << "warning: even the least takes " << f.gpu.all() << " bytes on the GPU\n";
  std::cout << (args.delivery.json ? to_json_line(f) + '\n' : load_text(f) + servers_text(f));
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
  c.option("--mirror", args.mirrors, "URL of the same package on another server; may be given again", "URL");
  c.option("--refine", args.refine_s, parse_duration,
           "Go on for so long after the limit, best upgrades first", "TIME")
      .shows_default("0");
  c.option("-o,--output", args.output,
           "Folder for the scale's GLB and for the fragments as complete image files", "DIR");
  c.flag("--json", d.json, "Print one JSON object (schemas/fetch.v1.schema.json)");
  add_rtt_option(c, d, "Round trip, 40 are milliseconds; 0 = as the first answer shows it").rare();
  add_policy_option(c, d).rare();
  add_jnd_option(c, d).rare();
  c.option("--connections", d.request.network.connections, "Connections per server")
      .integer_in(1, 64)
      .shows_default()
      .rare();
}

}  // namespace

DocumentSchema fetch_schema() {
  return document_schema("fetch.v1", "texmesh fetch, version 1",
                         "Output of `texmesh fetch URL --json`: what a real transfer brought within its "
                         "time. Times in seconds from the first request on.",
                         schema_of<Fetched>());
}

void add_fetch_command(Command& app) {
  auto [c, args] =
      app.add("fetch", "Fetch from web servers what a viewer would get within a time", run_fetch);
  add_fetch_options(c, args);
  c.examples(
      "  texmesh fetch https://host/bust.texmesh --time 4 --display 800\n"
      "  texmesh fetch https://host/bust.texmesh --time 4 --memory 64MB\n"
      "  texmesh fetch https://a/bust.texmesh --mirror https://b/bust.texmesh --time 2 --refine 10 -o got");
  c.notes(
      "fetch checks every fragment against its digest. It shares the fragments among the servers by their "
      "speed. It drops a server that sends wrong bytes, and asks another server for what one fails to "
      "deliver. A folder (URL with a slash) may lack some of the files. The package is read from the first "
      "server that answers. If a server does not support ranges, fetch reads whole rungs from the unpacked "
      "folder beside the package.\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when fragments were given up, 130 when "
      "interrupted.");
}

}  // namespace texmesh
