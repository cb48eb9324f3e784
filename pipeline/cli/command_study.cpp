#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "pipeline/cache/disk_store.h"
#include "pipeline/cli/commands.h"
#include "pipeline/compile/artefacts.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/make_stage.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/text_table.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/study/allocation_study.h"
#include "stages/study/fragment_study.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMaxImageBytes = 1ull << 30;

RunContext context_of(int jobs) {
  RunContext context;
  context.threads = std::max(1, jobs > 0 ? jobs : static_cast<int>(std::thread::hardware_concurrency()));
  return context;
}

std::string kilobytes(std::uint64_t bytes) { return fixed(static_cast<double>(bytes) / 1e3, 1); }

/// "+12.3" percent that `part` is more than `whole`.
std::string more_than(std::uint64_t part, std::uint64_t whole) {
  return fmt::format("{:+.1f}", 100 * (static_cast<double>(part) / static_cast<double>(whole) - 1));
}

// ---- study fragments

struct FragmentArguments {
  std::vector<std::string> images;
  std::vector<int> grids = FragmentStudyOptions{}.grids, qualities = FragmentStudyOptions{}.qualities;
  std::string subsampling = "420", csv;
  int jobs = 0;
  bool json = false;
};

struct StudiedImage {
  std::string path;
  std::uint32_t width_px = 0, height_px = 0;
  bool alpha = false;  // there is one, which is left out
  std::vector<FragmentStudyRow> rows;
};

/// Colours of an image; its alpha channel is left out, and `alpha` says whether there is one.
Pixels read_pixels(const std::string& path, bool& alpha) {
  const Image image = probe_image(path, read_input_file(path, kMaxImageBytes), {});
  Pixels all = decode_image(image, FloatEncoding::kSrgb);
  const std::uint32_t channels = all.channels < 3 ? 1 : 3;
  alpha = channels != all.channels;
  if (channels == all.channels) return all;
  Pixels out{all.width_px, all.height_px, channels, {}};
  for (std::size_t k = 0; k < std::size_t{all.width_px} * all.height_px; ++k)
    out.data.insert(out.data.end(), all.data.begin() + static_cast<std::ptrdiff_t>(k * all.channels),
                    all.data.begin() + static_cast<std::ptrdiff_t>(k * all.channels + channels));
  return out;
}

std::string fragment_text(const StudiedImage& image) {
  TextTable table;
  for (const char* header :
       {"n", "fragments", "fragment px", "quality", "file std kB", "file opt kB", "sum std kB", "over std %",
        "sum opt kB", "over opt %", "shared kB", "over std %", "over opt %"})
    table.column(header);
  std::size_t within = 0, large = 0, large_within = 0;
  for (const FragmentStudyRow& r : image.rows) {
    table.row({fmt::format("{}^2", r.grid), fmt::format("{}x{}", r.columns, r.rows),
               fmt::format("{}x{}", r.fragment_width_px, r.fragment_height_px), std::to_string(r.quality),
               kilobytes(r.file_standard), kilobytes(r.file_optimised), kilobytes(r.sum_standard),
               more_than(r.sum_standard, r.file_standard), kilobytes(r.sum_optimised),
               more_than(r.sum_optimised, r.file_optimised), kilobytes(r.sum_shared),
               more_than(r.sum_shared, r.file_standard), more_than(r.sum_shared, r.file_optimised)});
    const bool good = r.sum_shared <= r.file_standard;
    const bool is_large = std::min(r.fragment_width_px, r.fragment_height_px) >= 128;
    within += good, large += is_large, large_within += good && is_large;
  }
  return fmt::format(
      "{}: {} x {} px{}\n{}  with shared tables the fragments are no larger than one standard file in {} of "
      "{} "
      "rows; of those "
      "with fragments of 128 px and more in {} of {}\n",
      image.path, image.width_px, image.height_px,
      image.alpha ? "; its alpha channel, which packages hold as a texture of its own, is left out" : "",
      table.text(), within, image.rows.size(), large_within, large);
}

Json fragment_json(const FragmentStudyRow& r) {
  return {{"grid", r.grid},
          {"columns", r.columns},
          {"rows", r.rows},
          {"fragment_width_px", r.fragment_width_px},
          {"fragment_height_px", r.fragment_height_px},
          {"quality", r.quality},
          {"file_standard", r.file_standard},
          {"file_optimised", r.file_optimised},
          {"sum_standard", r.sum_standard},
          {"sum_optimised", r.sum_optimised},
          {"sum_shared", r.sum_shared}};
}

/// RFC 4180: names in quotes where they need them.
std::string csv_name(const std::string& name) {
  if (name.find_first_of(",\"\r\n") == std::string::npos) return name;
  std::string out = "\"";
  for (const char c : name) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

std::string fragment_csv(const std::vector<StudiedImage>& images) {
  std::string out =
      "image,width_px,height_px,grid,fragments,fragment_width_px,fragment_height_px,quality,file_standard_"
      "bytes,"
      "file_optimised_bytes,sum_standard_bytes,sum_optimised_bytes,sum_shared_bytes\n";
  for (const StudiedImage& i : images)
    for (const FragmentStudyRow& r : i.rows)
      out +=
          fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", csv_name(i.path), i.width_px, i.height_px,
                      r.grid, r.columns * r.rows, r.fragment_width_px, r.fragment_height_px, r.quality,
                      r.file_standard, r.file_optimised, r.sum_standard, r.sum_optimised, r.sum_shared);
  return out;
}

void run_fragments(const FragmentArguments& args) {
  FragmentStudyOptions options{args.grids, args.qualities,
                               args.subsampling == "444" ? Subsampling::k444 : Subsampling::k420};
  if (!args.csv.empty()) check_output_file(args.csv);  // not after the study
  std::vector<StudiedImage> studied;
  Json list = Json::array();
  for (const std::string& path : args.images) {
    bool alpha = false;
    const Pixels pixels = read_pixels(path, alpha);
    studied.push_back({path, pixels.width_px, pixels.height_px, alpha,
                       study_fragments(pixels, options, context_of(args.jobs))});
    if (!args.json) std::cout << fragment_text(studied.back()) << std::flush;
    Json rows = Json::array();
    for (const FragmentStudyRow& r : studied.back().rows) rows.push_back(fragment_json(r));
    list.push_back(
        {{"image", path}, {"width_px", pixels.width_px}, {"height_px", pixels.height_px}, {"rows", rows}});
    if (alpha) list.back()["alpha_left_out"] = true;
  }
  if (args.json)
    std::cout << Json{{"fragments", list}}.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n';
  if (!args.csv.empty()) {
    const std::string csv = fragment_csv(studied);
    write_output_file(args.csv, {reinterpret_cast<const std::uint8_t*>(csv.data()), csv.size()});
  }
}

void add_fragments(CLI::App& study, int& exit_code) {
  auto args = std::make_shared<FragmentArguments>();
  CLI::App* c = study.add_subcommand("fragments",
                                     "Does cutting a texture cost bytes? The sum of its fragments against "
                                     "one file (Table 3.1, Figs. 3.5-3.8)");
  c->add_option("IMAGE", args->images, "JPEG, PNG, TIFF, WebP or EXR images")->required();
  c->add_option("--grids", args->grids, "Fragments in a row and a column: 16 cuts into 16 x 16")
      ->delimiter(',')
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  c->add_option("--qualities", args->qualities, "JPEG qualities, rising, at most 16")
      ->delimiter(',')
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  c->add_option("--subsampling", args->subsampling, "Chroma resolution")
      ->check(CLI::IsMember({"420", "444"}))
      ->capture_default_str();
  c->add_option("--csv", args->csv, "Write the figures, in bytes, to this file as well");
  c->add_option("-j,--jobs", args->jobs, "Processors to use (default: all)")->check(CLI::Range(1, 1024));
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Columns: one file with the standard's Huffman tables (std) and with tables of its own (opt); the sum "
      "of the\n"
      "fragments as such files; and the fragments as packages hold them, abbreviated streams behind one "
      "shared table\n"
      "stream, which is counted. \"over std %\" is how much more a sum takes than one such file; less is "
      "negative.\n"
      "Fragments have sides that are multiples of 16: the image's edges are repeated to fill the last ones, "
      "and "
      "small\n"
      "images are cut into fewer than n x n.\n"
      "Examples:\n"
      "  texmesh study fragments atlas.jpg\n"
      "  texmesh study fragments *.jpg --grids 4,8,16 --qualities 20,60,90 --csv figures.csv\n"
      "Exit code: 0, 1 when an image cannot be read, 2 usage, 3 internal error.");
  c->callback([args, &exit_code] {
    for (std::size_t k = 1; k < args->qualities.size(); ++k)
      if (args->qualities[k] <= args->qualities[k - 1] || args->qualities.size() > 16) {
        std::cerr << "texmesh study fragments: --qualities: expected at most 16, strictly rising\n";
        exit_code = kExitUsage;
        return;
      }
    run_fragments(*args);
    exit_code = kExitOk;
  });
}

// ---- study quality

struct QualityArguments {
  std::string model, output, cache;
  AllocationStudyOptions options;
  int jobs = 0;
  bool no_cache = false, json = false;
};

using Choices = std::vector<StudiedChoice>;

/// Runs the graph as far as the tables, through compile's cache, and the study behind it.
Choices study_model(const QualityArguments& args) {
  const auto study = [&args](const ConditionedMesh& mesh, const std::vector<Material>& materials,
                             const Fragments& fragments, const std::vector<Pixels>& planes,
                             const Ladder& ladder, const Previews& previews, const PackageTables& tables,
                             const RunContext& context) {
    return study_allocation(mesh, materials, fragments, planes, ladder, previews, tables, args.options,
                            context);
  };
  constexpr Artefact<Choices> kStudy{"study"};
  Stage stage =
      make_stage({kStudy.name, 1, "fragments, rungs -> what choices of rungs look like"},
                 inputs(kConditionedMesh, kMaterials, kFragments, kFilledPlanes, kLadder, kPreviews, kTables),
                 derived(kStudy), options(), {}, study);
  CompileRequest request;
  request.input = args.model;
  const std::unique_ptr<Store> store =
      args.no_cache ? std::make_unique<NullStore>() : open_disk_store(default_cache_folder(args.cache));
  Notes notes;
  return *run_towards(request, std::move(stage), kStudy, *store, context_of(args.jobs), {}, notes);
}

/// Uniform and what is compared with it, side by side, the source last.
std::vector<std::uint8_t> side_by_side(const Choices& choices) {
  std::vector<const Pixels*> pictures;
  for (std::size_t k = 1; k < choices.size(); ++k) pictures.push_back(&choices[k].picture);
  pictures.push_back(&choices[0].picture);
  const std::uint32_t side = pictures[0]->width_px;
  Pixels out{side * static_cast<std::uint32_t>(pictures.size()), side, 3, {}};
  for (std::uint32_t y = 0; y < side; ++y)
    for (const Pixels* p : pictures)
      out.data.insert(out.data.end(), p->at(0, y), p->at(0, y) + std::size_t{side} * 3);
  return write_png(out);
}

std::string quality_text(const Choices& choices) {
  TextTable table;
  table.column("choice", Align::kLeft);
  const std::uint64_t budget = choices.size() > 1 ? choices[1].bytes : 0;  // uniform's
  for (const char* header : {"kB", "of budget %", "fragments", "skipped", "lowest q", "highest q",
                             "surface SSIM", "rendered SSIM", "rendered difference"})
    table.column(header);
  for (const StudiedChoice& c : choices)
    if (c.fragments > 0)
      table.row(
          {c.name, kilobytes(c.bytes),
           fixed(100 * static_cast<double>(c.bytes) / static_cast<double>(std::max<std::uint64_t>(budget, 1)),
                 1),
           std::to_string(c.fragments), std::to_string(c.skipped), std::to_string(c.lowest_quality),
           std::to_string(c.highest_quality), fixed(c.surface_ssim, 4), fixed(c.ssim, 4),
           fixed(c.difference, 4)});
  return table.text();
}

Json quality_json(const Choices& choices) {
  Json list = Json::array();
  for (const StudiedChoice& c : choices)
    if (c.fragments > 0)
      list.push_back({{"choice", c.name},
                      {"bytes", c.bytes},
                      {"fragments", c.fragments},
                      {"skipped", c.skipped},
                      {"lowest_quality", c.lowest_quality},
                      {"highest_quality", c.highest_quality},
                      {"surface_ssim", c.surface_ssim},
                      {"rendered_ssim", c.ssim},
                      {"rendered_difference", c.difference}});
  return {{"quality", list}};
}

void add_quality(CLI::App& study, int& exit_code) {
  auto args = std::make_shared<QualityArguments>();
  CLI::App* c = study.add_subcommand(
      "quality",
      "Is variable texture quality better than one for all, within the same bytes? Rendered and scored (Fig. "
      "3.9)");
  c->add_option("MODEL", args->model, "A textured model; runs the stages that are needed, through the cache")
      ->required();
  c->add_option("-o,--output", args->output,
                "Pictures side by side, x.png: uniform, variable (3.2), variable (log), "
                "rate-distortion, source");
  c->add_option("--quality", args->options.quality,
                "Quality of the uniform choice, whose bytes are the budget")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  c->add_option("--width", args->options.width,
                "dQ of equation 3.2: how far feature density moves the quality")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  c->add_option("--views", args->options.views, "Directions from which the scores are taken")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  c->add_option("--view", args->options.picture_view, "The one that the picture shows, from 0")
      ->check(CLI::Range(0, 63))
      ->capture_default_str();
  c->add_option("--size", args->options.size_px, "Side of a view, px")
      ->check(CLI::Range(32, 4096))
      ->capture_default_str();
  c->add_option("-j,--jobs", args->jobs, "Processors to use (default: all)")->check(CLI::Range(1, 1024));
  c->add_option("--cache", args->cache, "Cache folder, as for compile");
  c->add_flag("--no-cache", args->no_cache, "Compute everything, keep nothing");
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "variable (3.2) and (log): quality by feature density eta, around the highest Q_i whose bytes fit; "
      "the "
      "rest goes\n"
      "to one rung more where eta is highest. \"of budget %\" is what whole rungs come to.\n"
      "rate-distortion: bytes where they save most surface-weighted (1 - SSIM); fragments may be skipped, "
      "which show the\n"
      "preview. Surface SSIM is that of the tables; rendered SSIM and difference (FLIP-like) compare S_0 "
      "with these\n"
      "textures with S_0 and the source's.\n"
      "Examples:\n"
      "  texmesh study quality turtle.glb -o turtle.png\n"
      "  texmesh study quality bust.obj --quality 30 --views 12 --json\n"
      "Exit code: 0, 1 when the model cannot be compiled, 2 usage, 3 internal error.");
  c->callback([args, &exit_code] {
    if ((!args->output.empty() && !args->output.ends_with(".png")) ||
        args->options.picture_view >= args->options.views) {
      std::cerr << "texmesh study quality: expected an output x.png and a --view below --views\n";
      exit_code = kExitUsage;
      return;
    }
    if (!args->output.empty()) check_output_file(args->output);
    const Choices choices = study_model(*args);
    if (!args->output.empty()) write_output_file(args->output, side_by_side(choices));
    std::cout << (args->json ? quality_json(choices).dump() + "\n" : quality_text(choices));
    exit_code = kExitOk;
  });
}

}  // namespace

void add_study_command(CLI::App& app, int& exit_code) {
  CLI::App* c = app.add_subcommand("study", "Measure on your own data what the method promises");
  c->require_subcommand(1);
  add_fragments(*c, exit_code);
  add_quality(*c, exit_code);
}

}  // namespace texmesh
