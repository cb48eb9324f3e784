// The commands that write pages, files and folders for browsers and other viewers, and the server for a look
// at once.
#include <pthread.h>
#include <signal.h>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/extract/usdz/usdz.h"
#include "tools/publish/export/export.h"
#include "tools/publish/report/report.h"
#include "tools/publish/site/site_words.h"
#include "tools/publish/view/view_server.h"

namespace texmesh {
namespace {

struct ViewArguments {
  std::string package, viewer, host = "127.0.0.1";
  int port = 0;
  bool open = false, json = false;
};

/// What view --json prints.
struct AnnouncedPackages {
  std::string url;
  std::vector<std::string> packages;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("url", s.url, "");
    v("packages", s.packages, "");
  }
};

std::string url_host(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
}

void announce(const ViewArguments& args, const ServedFiles& files, const std::string& base) {
  const std::vector<std::string> packages = files.packages();
  // The package's path is encoded twice: the page decodes the query before it takes the value for a URL.
  const std::string page = packages.size() == 1 ? base + "?pkg=" + percent_encoded(packages[0]) : base;
  if (args.json) {
    AnnouncedPackages announced{page, packages};
    for (std::string& p : announced.packages) p = base + p;
    std::cout << to_json_line(announced) << std::endl;
  } else {
    std::cout << page << "\nserving " << counted(packages.size(), "package") << "; Ctrl-C ends it"
              << std::endl;
  }
  if (!args.open) return;
  if (::fork() == 0) {
    ::execlp("xdg-open", "xdg-open", page.c_str(), nullptr);
    ::_exit(127);
  }
}

[[noreturn]] int run_view(const ViewArguments& args) {
  if (!std::filesystem::is_directory(args.package)) {
    PackageReader package(open_store(args.package));
    package.store().list();  // its end is there
  }
  if (const std::string links = links_left_out(find_packages(args.package)); !links.empty())
    std::cerr << "note: " << printable(links) << '\n';
  const ServedFiles files(args.package, viewer_folder(args.viewer));
  ViewServer server(files);
  const int port = server.bind(args.host, args.port);
  sigset_t ends;
  sigemptyset(&ends);
  for (const int s : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ends, s);
  ::pthread_sigmask(SIG_BLOCK, &ends, nullptr);  // before there are threads, so that none of them takes it
  std::thread serving([&server] { server.serve(); });
  announce(args, files, "http://" + url_host(args.host) + ":" + std::to_string(port) + "/");
  int signal = 0;
  ::sigwait(&ends, &signal);
  // Without a stop: connections that browsers keep open would hold the library's threads for seconds. Nothing
  // here needs an end.
  ::_exit(kExitOk);
}

struct ReportArguments {
  std::string package, folder;
  ReportOptions options;
  int jobs = 0;
  bool json = false;
};

int run_report(const ReportArguments& args) {
  check_folder_name(args.folder);
  NewFolder(args.folder, report_folder_rule());  // not after the work
  PackageReader package(open_store(args.package));
  PercentLine progress("report");
  const Report report = make_report(package, args.options, context_of(args.jobs));
  progress.end();
  write_report(report, args.folder);
  if (args.json)
    std::cout << to_json_line(report) << '\n';
  else
    std::cout << report.verdict << '\n'
              << printable((std::filesystem::path(args.folder) / "index.html").string()) << '\n';
  return report.holds ? kExitOk : kExitDifferent;
}

struct ExportArguments {
  std::string package, folder, viewer;
  ExportOptions options;
  int width_px = 640, height_px = 480, jobs = 0;
  bool json = false, draco = false;
};

/// Options that mean nothing for the target are a mistake of the user's.
void check_for_target(const ExportOptions& o) {
  const auto refuse = [&](const char* option, const char* instead) {
    throw UsageError(option, "", instead, "--to " + std::string(enum_name(o.target)));
  };
  const bool one_glb = o.target == ExportTarget::kGltfLod || o.target == ExportTarget::kModelViewer;
  if (o.bytes > 0 && !one_glb) refuse("--bytes", "--to gltf-lod or model-viewer");
  if (o.plain && (o.target == ExportTarget::kGltfLod || o.target == ExportTarget::kOembed))
    refuse("--plain", "--to 3dtiles or model-viewer");
  if (o.plain && o.bytes > 0) throw UsageError("--plain", "", "no --bytes", std::to_string(o.bytes));
  for (const auto& [option, given] :
       {std::pair{"--display", o.display_px > 0}, {"--keep-units", o.keep_units}})
    if (given && o.target == ExportTarget::kOembed) refuse(option, "a target that holds a model");
  if (o.target == ExportTarget::kOembed) {
    if (!is_web_url(o.url))
      throw UsageError("--url", "", "the http or https URL of the folder, for --to oembed", o.url);
  } else if (!o.url.empty() || !o.provider.empty()) {
    refuse(o.url.empty() ? "--provider" : "--url", "--to oembed");
  }
  if (!o.script.empty() && o.target != ExportTarget::kModelViewer) refuse("--script", "--to model-viewer");
}

void check_plain(bool plain, ExtractImages images) {
  if (plain && (images == ExtractImages::kWebp || images == ExtractImages::kAvif))
    throw UsageError("--plain", "", "--image-format jpeg or png", std::string(enum_name(images)));
}

ExportOptions export_options_of(const ExportArguments& a) {
  ExportOptions o = a.options;
  o.width_px = static_cast<std::uint32_t>(a.width_px);
  o.height_px = static_cast<std::uint32_t>(a.height_px);
  check_for_target(o);
  check_plain(o.plain, o.images);
  const bool is_page = o.target == ExportTarget::kModelViewer;
  if (a.draco && (!is_page || o.plain))
    throw UsageError("--draco", "", is_page ? "no --plain" : "--to model-viewer",
                     std::string(enum_name(o.target)));
  // A page of a museum asks no foreign host for a decoder unless somebody wants that.
  if (is_page && !a.draco && o.bytes == 0 && o.images != ExtractImages::kWebp &&
      o.images != ExtractImages::kAvif)
    o.plain = true;
  if (!o.url.empty() && !o.url.ends_with("/")) o.url += "/";
  if (o.target == ExportTarget::kOembed) o.viewer = viewer_folder(a.viewer);
  if (is_page && o.script.empty()) o.viewer = model_viewer_folder(a.viewer);
  return o;
}

int run_export(const ExportArguments& args) {
  const ExportOptions options = export_options_of(args);
  check_folder_name(args.folder);
  NewFolder(args.folder, export_folder_rule());  // not after the work
  PackageReader package(open_store(args.package));
  PercentLine progress("export");
  RunContext context = context_of(args.jobs);
  context.progress = [&](double fraction) { progress.show(fraction); };
  const Export made = make_export(package, args.package, options, context);
  progress.end();
  write_export(made, args.folder);
  if (args.json) {
    std::cout << export_list(made);
  } else {
    std::cout << printable((std::filesystem::path(args.folder) / made.open).string()) << '\n';
    for (const std::string& note : made.notes) std::cout << "note: " << printable(note) << '\n';
  }
  return kExitOk;
}

/// What extract and export say of lengths.
void add_keep_units_flag(Command& c, bool& keep_units) {
  c.flag(
      "--keep-units", keep_units,
      "Lengths in the source's unit; default: in metres, as glTF has them, where the package knows the unit");
}

void add_image_format_option(Command& c, ExtractImages& images) {
  c.choice(
       "--image-format", images,
       "auto = with --bytes the format that looks better, otherwise jpeg. png is without loss. Images with "
       "alpha are png where jpeg is asked for. avif looks as good in two thirds of WebP's bytes, but few "
       "viewers read it: three.js and <model-viewer>, Babylon.js, glTF-Transform; not Blender",
       "FORMAT")
      .lists_words()
      .shows_default();
}

void add_target_options(Command& c, ExportArguments& args) {
  c.choice(
       "--to", args.options.target,
       "The form: 3dtiles = a tileset of 3D Tiles 1.1 for CesiumJS and its like; gltf-lod = one GLB with "
       "levels of detail (MSFT_lod); model-viewer = a page with <model-viewer>, with USDZ for AR on iPhones; oembed = a frame for "
       "other pages and the oEmbed answer that tells of it",
       "TARGET")
      .required();
  c.option(
       "-o,--output", args.folder,
       "The folder to make. An earlier export is replaced, and files of yours in it stay; any other folder with "
       "files is refused",
       "DIR")
      .required();
  c.option("--display", args.options.display_px,
           "Nothing finer than what this displayed height of the object needs, device px; default: "
           "everything, for model-viewer 1000",
           "PX")
      .number_in(1, 1e6);
  c.option("--bytes", args.options.bytes, parse_some_bytes,
           "gltf-lod, model-viewer: the best-looking GLB of at most so many bytes: 2MB", "SIZE");
  c.flag(
      "--plain", args.options.plain,
      "3dtiles: meshes as floats, for viewers without a decoder of Draco; model-viewer has them so by itself");
  c.flag(
      "--draco", args.draco,
      "model-viewer: meshes by Draco, some 5 % fewer bytes; its script then fetches a decoder from gstatic.com");
  add_image_format_option(c, args.options.images);
  c.option("--screen-error", args.options.screen_error_px,
           "3dtiles: the error at which the viewer takes the next level, its maximumScreenSpaceError or "
           "errorTarget, px",
           "PX")
      .number_in(0.1, 1000)
      .shows_default();
  add_keep_units_flag(c, args.options.keep_units);
  c.option("--script", args.options.script,
           "model-viewer: URL of its script, as the page names it; default: a copy stands beside the page",
           "URL");
}

void add_oembed_options(Command& c, ExportArguments& args) {
  c.option("--url", args.options.url, "oembed: where the folder will stand on the web", "URL");
  c.option("--provider", args.options.provider, "oembed: name of the publisher; default: the host of --url",
           "NAME");
  c.option("--width", args.width_px, "oembed: width of the frame, px").integer_in(64, 8192).shows_default();
  c.option("--height", args.height_px, "oembed: height of the frame, px")
      .integer_in(64, 8192)
      .shows_default();
  c.option(
      "--viewer", args.viewer,
      "oembed: folder with the built viewer, model-viewer: with model-viewer.min.js; default: this build's",
      "DIR");
}

constexpr std::uint64_t kMostSiteTextBytes = 1'000'000;  // of a style sheet, and of words

struct SiteArguments {
  std::string packages, folder, viewer, style;
  SiteOptions options;
  bool json = false;
};

int run_site(SiteArguments& args) {
  SiteOptions& options = args.options;
  if (!options.packages_url.empty() && !is_web_url(options.packages_url))
    throw UsageError("--packages-url", "", "an http or https URL", options.packages_url);
  if (!options.packages_url.empty() && !options.packages_url.ends_with("/")) options.packages_url += "/";
  if (!options.url.empty() && !is_web_url(options.url))
    throw UsageError("--url", "", "an http or https URL", options.url);
  if (!options.url.empty() && !options.url.ends_with("/")) options.url += "/";
  const auto text_of = [](const std::string& file) {
    const Bytes bytes = file.empty() ? Bytes() : read_input_file(file, kMostSiteTextBytes);
    return std::string(bytes.begin(), bytes.end());
  };
  options.style = text_of(args.style);
  options.words = text_of(options.words_file);
  if (!options.words.empty()) SiteWords(options.words, options.words_file);  // wrong words, before the work
  options.viewer = viewer_folder(args.viewer);
  check_folder_name(args.folder);
  NewFolder(args.folder, site_folder_rule());  // not after the work
  const Site site = read_site(args.packages, options);
  for (const SiteFault& f : site.faults) std::cerr << "texmesh: " << printable(f.message) << '\n';
  for (const std::string& path : site.stale)
    std::cerr << "note: " << printable(path)
              << " is left out: no model makes this package any more (compile --remove-stale removes it)\n";
  for (const std::string& note : {site.links, unknown_units(site)})
    if (!note.empty()) std::cerr << "note: " << printable(note) << '\n';
  write_site(site, args.folder);
  const std::string page = (std::filesystem::path(args.folder) / "index.html").string();
  if (args.json)
    std::cout << to_json_line(SiteReport{page, site.objects, site.faults, site.stale}) << '\n';
  else
    std::cout << printable(page) << ", " << counted(site.objects.size(), "object") << '\n';
  return site.faults.empty() ? kExitOk : kExitModelFailed;
}

/// A number of bytes, as the user wrote it.
struct AskedBytes {
  std::string text;
  std::uint64_t bytes = 0;
};

struct ExtractArguments {
  std::string package, output;
  std::vector<AskedBytes> bytes;
  std::uint32_t rung = kBestRung;
  ExtractImages images = ExtractImages::kAuto;
  std::optional<int> scale, proxy;
  double display_px = 0;
  int jobs = 0;
  bool recentre = false, keep_units = false, levels = false, plain = false, best = false, fast = false,
       json = false;
};

std::uint32_t rung_of(const std::string& text, const std::string& flag) {
  if (text == "max") return kBestRung;
  if (text.empty() || text.size() > 3 || text.find_first_not_of("0123456789") != std::string::npos)
    throw UsageError(flag, "", "a rung's number (texmesh dump PKG ladder lists them) or max", text);
  return static_cast<std::uint32_t>(std::stoul(text));
}

std::vector<AskedBytes> asked_bytes(const std::string& list, const std::string& flag) {
  std::vector<AskedBytes> out;
  if (list.empty()) return out;
  for (const std::string_view piece : pieces_of(list, ',')) {
    const std::string text(piece);
    if (std::ranges::find(out, text, &AskedBytes::text) != out.end())
      throw UsageError(flag, "", "every number once", list);
    out.push_back({text, parse_some_bytes(text, flag)});
  }
  return out;
}

/// bust.glb becomes bust-50kB.glb.
std::string output_for(const std::string& output, const AskedBytes& asked) {
  std::filesystem::path path(output);
  const std::string ending = path.extension().string();
  path.replace_extension();
  return path.string() + "-" + asked.text + ending;
}

ExtractRequest request_of(const ExtractArguments& a) {
  check_plain(a.plain, a.images);
  if (a.proxy) return {ExtractProxy{static_cast<std::uint32_t>(*a.proxy), a.plain}, a.recentre, a.keep_units};
  if (a.bytes.empty()) {
    if (a.best || a.fast) throw UsageError(a.best ? "--best" : "--fast", "", "--bytes beside it", "none");
    const auto form = a.plain    ? ExtractScale::Form::kPlain
                      : a.levels ? ExtractScale::Form::kLevels
                                 : ExtractScale::Form::kCoded;
    return {ExtractScale{a.scale, a.rung, a.display_px, a.images, form}, a.recentre, a.keep_units};
  }
  ExtractBudget budget;
  for (const AskedBytes& one : a.bytes) budget.bytes.push_back(one.bytes);
  budget.scale = a.scale;
  if (a.display_px > 0) budget.display_px = a.display_px;
  budget.images = a.images;
  budget.levels = a.levels;
  budget.effort = a.best ? ExtractEffort::kBest : a.fast ? ExtractEffort::kFast : ExtractEffort::kUsual;
  return {budget, a.recentre, a.keep_units};
}

void write_extracted(const ExtractArguments& args, Extracted& extracted, const std::string& output) {
  write_output_file(output, extracted.glb);
  extracted.name = std::filesystem::path(output).filename().string();
  std::cout << (args.json ? to_json_line(extracted) + "\n" : extract_text(extracted));
}

bool is_usdz(const std::string& output) { return lower_ending(output) == ".usdz"; }

int run_extract(const ExtractArguments& args) {
  const ExtractRequest request = request_of(args);
  std::vector<std::string> outputs;
  for (const AskedBytes& one : args.bytes)
    outputs.push_back(args.bytes.size() > 1 ? output_for(args.output, one) : args.output);
  if (outputs.empty()) outputs.push_back(args.output);
  for (const std::string& output : outputs) {  // not after the search
    if (const std::string ending = lower_ending(output);
        ending != ".glb" && ending != ".usdz" && !ending.empty())
      throw UsageError("--output", "", "the name of a GLB or a USDZ, NAME.glb or NAME.usdz", output);
    check_output_file(output);
  }
  PackageReader package(open_store(args.package));
  PercentLine progress("extract");
  RunContext context = context_of(args.jobs);
  context.progress = [&](double fraction) { progress.show(fraction); };
  std::vector<Extracted> files = is_usdz(args.output) ? extract_usdz(package, request, context)
                                                      : extract_files(package, request, context);
  progress.end();
  bool within = true;
  for (std::size_t k = 0; k < files.size(); ++k) {
    write_extracted(args, files[k], outputs[k]);
    within = within && files[k].within;
  }
  return within ? kExitOk : kExitDifferent;
}

void add_extract_options(Command& c, ExtractArguments& args) {
  add_package_argument(c, args.package, true);
  c.option("-o,--output", args.output, "The GLB to write; a name that ends in .usdz gives USDZ, for iPhones",
           "FILE")
      .required();
  const Option bytes = c.option(
      "--bytes", args.bytes, asked_bytes,
      "The best-looking file of at most so many bytes, and at least 98 % of them if the package has as much: "
      "500kB, 2MB. "
      "Several (50kB,500kB) give a file each, bust-50kB.glb and bust-500kB.glb for -o bust.glb, and "
      "share the search",
      "SIZE[,SIZE...]");
  const Option scale =
      c.option("--scale", args.scale,
               "This scale (texmesh dump lists the scales); default: the scale that suits --display")
          .integer_in(0, 99);
  c.option("--proxy", args.proxy,
           "This proxy, the whole object in a small file (texmesh dump lists them), as it is: 0 = the "
           "smallest")
      .integer_in(0, kMaxPackageProxies - 1)
      .excludes(bytes)
      .excludes(scale);
  c.option("--rung", args.rung, rung_of, "Quality of the textures: a rung's number, 0 = lowest, or max",
           "RUNG")
      .shows_default("max")
      .excludes(bytes);
  c.option(
       "--display", args.display_px,
       "Displayed height of the object, device pixels. It chooses the scale and the size of the textures; "
       "with --bytes files are compared at it (default 512)",
       "PX")
      .number_in(1, 1e6);
  const Option best = c.flag("--best", args.best,
                             "With --bytes: compare many whole files. It takes three to eight times as long, "
                             "and the file looks up to 7 % nearer");
  c.flag("--fast", args.fast,
         "With --bytes: decide by the package's tables and take no picture, for servers that make files on "
         "request. Bytes may be left over")
      .excludes(best);
  add_image_format_option(c, args.images);
  const Option lods =
      c.flag("--lods", args.levels,
             "The chosen scale and all coarser ones of the step function as levels of detail of one file "
             "(MSFT_lod), which share textures");
  c.flag(
       "--plain", args.plain,
       "Meshes as floats and images as JPEG or PNG, without extensions that compress: for programs that read "
       "glTF 2.0 alone, such as Debian 12's Blender and F3D")
      .excludes(bytes)
      .excludes(lods);
  c.flag("--recentre", args.recentre, "Leave the model near 0; default: where the source has it");
  add_keep_units_flag(c, args.keep_units);
  add_jobs_option(c, args.jobs);
  c.flag(
      "--json", args.json,
      "Print what was chosen as one JSON object for each file, a line each (schemas/extract.v1.schema.json)");
}

}  // namespace

void add_view_command(Command& app) {
  auto [c, args] =
      app.add("view", "Look at packages in a browser: serves the packages and the viewer", run_view);
  c.option("PACKAGE", args.package,
           "A .texmesh file, a folder that unpack made, or a folder of packages to choose from")
      .required();
  c.option("--host", args.host,
           "Address to listen on; an address other than this machine's own lets other machines in", "ADDRESS")
      .shows_default();
  c.option("--port", args.port, "Port; 0 = any free port").integer_in(0, 65535).shows_default();
  c.option("--viewer", args.viewer, "Folder with the built viewer, instead of the viewer of this build",
           "DIR");
  c.flag("--open", args.open, "Open the page with xdg-open");
  c.flag("--json", args.json, "Print one JSON object with the URLs");
  c.examples(
      "  texmesh view bust.texmesh\n"
      "  texmesh view packages/ --port 8080 --open");
  c.notes(
      "view prints the page's URL and serves until Ctrl-C. Only the viewer's files and packages can be "
      "reached.\n"
      "Exit code: 0, 1 when the package or the viewer is missing or the port is taken, 2 usage.");
}

void add_report_command(Command& app) {
  auto [c, args] = app.add("report", "Write a page that shows what viewers of a package see", run_report);
  add_package_argument(c, args.package, true).required();
  c.option(
       "-o,--output", args.folder,
       "The folder to make, with index.html in it. An earlier report is replaced, and files of yours in it stay; "
       "any other folder with files is refused",
       "DIR")
      .required();
  c.option("--against", args.options.against,
           "The model file behind the package: S_0 at the highest rung is rendered beside it", "SOURCE");
  c.option("--views", args.options.views, "Directions from which every switch size is rendered")
      .integer_in(1, 64)
      .shows_default();
  c.option("--max-flip", args.options.limits.mean,
           "Mean FLIP of a view up to which a scale cannot be told from S_0")
      .number_in(0, 1)
      .shows_default();
  c.option("--max-flip-p95", args.options.limits.p95, "The same for the 95th percentile of a view's pixels")
      .number_in(0, 1)
      .shows_default();
  add_jobs_and_json_options(c, args.jobs, args.json, "schemas/report.v1.schema.json");
  c.examples(
      "  texmesh report bust.texmesh -o report/\n"
      "  texmesh report bust.texmesh -o report/ --against bust.glb\n"
      "  texmesh report bust.texmesh -o report/ --views 32 --max-flip 0.03 --json");
  c.notes(
      "The page has a verdict, pictures of each scale at its switch size beside S_0 with maps of FLIP, curves of "
      "quality against bytes, bytes by kind, maps of the fragments and the step function. The page needs no "
      "script and no network, and prints well.\n"
      "The same package gives the same files on every machine.\n"
      "Exit code: 0 every switch size holds, 4 one does not, 1 when the package or the source cannot be read "
      "or DIR not be written, 2 usage. With 4 the report is written, too.");
}

void add_export_command(Command& app) {
  auto [c, args] = app.add(
      "export", "Write a package in the form of another viewer: 3D Tiles, MSFT_lod, model-viewer, oEmbed",
      run_export);
  add_package_argument(c, args.package, true).required();
  add_target_options(c, args);
  add_oembed_options(c, args);
  add_jobs_and_json_options(c, args.jobs, args.json, "schemas/export.v1.schema.json");
  c.examples(
      "  texmesh export bust.texmesh --to 3dtiles -o tiles/\n"
      "  texmesh export bust.texmesh --to gltf-lod --bytes 2MB -o bust-lod/\n"
      "  texmesh export bust.texmesh --to model-viewer --display 800 -o page/\n"
      "  texmesh export bust.texmesh --to oembed --url https://museum.example/bust/ -o bust/");
  c.notes(
      "3dtiles: each level is the output of texmesh extract --display for 4096, 2048, ... 32 px. The "
      "coarsest level is outermost. Levels that save less than a quarter of the bytes are left out. A "
      "viewer whose limit is --screen-error takes the next level at that height. The object stands where "
      "its source has it; nothing puts it on the globe.\n"
      "gltf-lod: S_0 and all scales of the step function; levels share materials and textures.\n"
      "model-viewer: index.html, model.glb and the poster, which stands there, too, where the script is blocked. The "
      "script stands beside it, unless --script names another; with --draco or --bytes it fetches a decoder "
      "from gstatic.com.\n"
      "oembed: a copy of the package, the viewer and oembed.json, to be put at --url. If a URL names "
      "the package, the package stays there.\n"
      "export.json in the folder lists what was written. The same package gives the same files.\n"
      "Exit code: 0, 1 when the package is damaged, the target cannot hold it (the message says why) or DIR "
      "cannot be written, 2 usage.");
}

void add_site_command(Command& app) {
  auto [c, args] =
      app.add("site", "Write a static site of a collection: posters, search, licences, a viewer", run_site);
  c.option("PACKAGES", args.packages, "A folder of packages, whose folders are looked into; or one package")
      .required();
  c.option(
       "-o,--output", args.folder,
       "The folder to make, with index.html in it. An earlier site is replaced, and files of yours in it stay; "
       "any other folder with files is refused",
       "DIR")
      .required();
  c.option("--title", args.options.title, "Title of the collection", "TEXT").shows_default();
  c.option("--packages-url", args.options.packages_url,
           "URL of a folder on the web that has the same packages as PACKAGES (default: site copies them)",
           "URL");
  c.option(
      "--url", args.options.url,
      "URL where the site will stand: pages then say it to search engines, social networks and citations, "
      "and have code to embed; sitemap.xml",
      "URL");
  c.option("--style", args.style, "Style sheet of your own, which the pages have behind theirs", "FILE");
  c.option("--words", args.options.words_file,
           "Words of the pages in another language, as JSON; names that it has not are English", "FILE");
  c.text_option(
      "--print-words", [] { return std::string(english_site_words()); },
      "Print the English words, to translate");
  c.option("--downloads", args.options.downloads_px,
           "Each object as GLB and USDZ, too: what extract --recentre --display PX writes", "PX")
      .number_in(1, 1e6);
  c.option("--viewer", args.viewer, "Folder with the built viewer, instead of the viewer of this build",
           "DIR");
  c.flag("--json", args.json, "Print one JSON object (schemas/site.v1.schema.json)");
  c.examples(
      "  texmesh site packages/ -o www/\n"
      "  texmesh site packages/ -o www/ --title \"Casts\" --packages-url https://files.museum.example/casts/");
  c.notes(
      "The site has a list with posters, creators, licences and sizes, which visitors can search. Each object "
      "has a page, which loads the viewer when somebody asks for it. The files are static: any web server "
      "can serve them from any folder. They ask other servers for packages at --packages-url alone. That "
      "server must allow pages of others to read ranges (CORS). If you open the files without a server, "
      "browsers show the list but no object in 3D.\n"
      "If a package cannot be read, site leaves it out and says so, as with one that no model makes any more.\n"
      "Exit code: 0, 1 when a package could not be read (the site has the others) or DIR not be written, "
      "2 usage.");
}

void add_extract_command(Command& app) {
  auto [c, args] = app.add(
      "extract", "Write one GLB or USDZ that any viewer opens: a scale with whole textures", run_extract);
  add_extract_options(c, args);
  c.examples(
      "  texmesh extract bust.texmesh --bytes 500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --bytes 50kB,100kB,500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --scale 0 --rung max --image-format png -o master.glb\n"
      "  texmesh extract https://host/bust.texmesh --display 800 -o bust.glb\n"
      "  texmesh extract bust.texmesh --lods --bytes 2MB -o bust.glb\n"
      "  texmesh extract bust.texmesh --bytes 4MB -o bust.usdz");
  c.notes(
      "--bytes chooses the scale and the size and quality of the textures together. It renders candidates "
      "lit, as texmesh render does, and compares them with the package's best (FLIP). Maps that change the "
      "picture more get more bytes, and the file is filled up to the last 2 %. If a proxy looks better, "
      "extract takes it, and makes it smaller if needed. Many triangles with a small texture nearly always "
      "look better than the reverse.\n"
      "Meshes of scales stay coded by Draco (KHR_draco_mesh_compression), those of whole proxies by meshopt "
      "(EXT_meshopt_compression). WebP needs EXT_texture_webp, AVIF EXT_texture_avif. For programs without these use --plain.\n"
      "A USDZ has plain meshes, JPEG and PNG, and materials as UsdPreviewSurface. extract refuses what that cannot "
      "say. Of --bytes a USDZ keeps the upper bound alone; its difference is that of the GLB it is made of.\n"
      "Exit code: 0, 1 when the package is damaged or the GLB cannot be written, 2 usage, 4 when the "
      "package gives no file of at most --bytes: extract then writes its smallest. A file that holds all "
      "there is and stays below 98 % of --bytes is no failure, and a note tells it.");
}

}  // namespace texmesh
