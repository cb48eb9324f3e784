// texmesh-lab study fragments: the sum of a texture's fragments against one file.
#include <fmt/format.h>
#include <time.h>

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "lab/cli/commands.h"
#include "lab/study/fragment_study.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/table.h"
#include "stages/image/decode_image.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMaxImageBytes = 1ull << 30;

/// The share that `part` is more than `whole`, shown as "+12.3" percent.
Cell more_than(std::uint64_t part, std::uint64_t whole) {
  const double more = static_cast<double>(part) / static_cast<double>(whole) - 1;
  return Cell(more, fmt::format("{:+.1f}", 100 * more));
}

struct FragmentArguments {
  std::vector<std::string> images;
  std::vector<int> grids = FragmentStudyOptions{}.grids, qualities = FragmentStudyOptions{}.qualities;
  std::string subsampling = "420", csv;
  int jobs = 0;
  bool decode = false, json = false;
};

/// CPU time of this thread, s: a busy machine says less of it than of the wall's.
double thread_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct StudiedImage {
  std::string path;
  std::uint32_t width_px = 0, height_px = 0;
  bool alpha = false;  // there is an alpha channel, which is left out
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

/// The figures of some images; people see one image at a time.
Table fragment_table(std::span<const StudiedImage> images) {
  constexpr NumberForm kMilliseconds{NumberForm::Kind::kFixed, 1, 1000};
  Table table{"",
              {Column::data("image"),
               Column::data("width_px"),
               Column::data("height_px"),
               {"n", 0, "grid"},
               Column::data("columns"),
               Column::data("rows"),
               {"fragments"},
               Column::data("fragment_width_px"),
               Column::data("fragment_height_px"),
               {"fragment px"},
               {"quality", 0, "quality"},
               {"file std kB", kKilobytes, "file_standard"},
               {"file opt kB", kKilobytes, "file_optimised"},
               {"sum std kB", kKilobytes, "sum_standard"},
               {"over std %"},
               {"sum opt kB", kKilobytes, "sum_optimised"},
               {"over opt %"},
               {"shared kB", kKilobytes, "sum_shared"},
               {"over std %"},
               {"over opt %"},
               {"file ms", kMilliseconds, "file_decode_s"},
               {"fragments ms", kMilliseconds, "fragments_decode_s"}}};
  for (const StudiedImage& i : images)
    for (const FragmentStudyRow& r : i.rows) {
      const auto timed = [&](double seconds) { return r.file_decode_s > 0 ? Cell(seconds) : Cell(); };
      table.row({i.path,
                 i.width_px,
                 i.height_px,
                 Cell(r.grid, fmt::format("{}^2", r.grid)),
                 r.columns,
                 r.rows,
                 fmt::format("{}x{}", r.columns, r.rows),
                 r.fragment_width_px,
                 r.fragment_height_px,
                 fmt::format("{}x{}", r.fragment_width_px, r.fragment_height_px),
                 r.quality,
                 r.file_standard,
                 r.file_optimised,
                 r.sum_standard,
                 more_than(r.sum_standard, r.file_standard),
                 r.sum_optimised,
                 more_than(r.sum_optimised, r.file_optimised),
                 r.sum_shared,
                 more_than(r.sum_shared, r.file_standard),
                 more_than(r.sum_shared, r.file_optimised),
                 timed(r.file_decode_s),
                 timed(r.fragments_decode_s)});
    }
  return table;
}

std::string fragment_text(const StudiedImage& image) {
  std::size_t within = 0, large = 0, large_within = 0;
  for (const FragmentStudyRow& r : image.rows) {
    const bool good = r.sum_shared <= r.file_standard;
    const bool is_large = std::min(r.fragment_width_px, r.fragment_height_px) >= 128;
    within += good, large += is_large, large_within += good && is_large;
  }
  return fmt::format(
      "{}: {} x {} px{}\n"
      "{}  with shared tables the fragments are no larger than one standard file in {} of {} rows; of "
      "those with fragments of 128 px and more in {} of {}\n",
      image.path, image.width_px, image.height_px,
      image.alpha ? "; its alpha channel, which packages hold as a texture of its own, is left out" : "",
      fragment_table({&image, 1}).text(), within, image.rows.size(), large_within, large);
}

void run_fragments(const FragmentArguments& args) {
  FragmentStudyOptions options;
  options.grids = args.grids, options.qualities = args.qualities;
  options.subsampling = args.subsampling == "444" ? Subsampling::k444 : Subsampling::k420;
  if (args.decode) options.clock_s = thread_s;
  if (!args.csv.empty()) check_output_file(args.csv);  // not after the study
  std::vector<StudiedImage> studied;
  Json list = Json::array();
  for (const std::string& path : args.images) {
    bool alpha = false;
    const Pixels pixels = read_pixels(path, alpha);
    studied.push_back({path, pixels.width_px, pixels.height_px, alpha,
                       study_fragments(pixels, options, context_of(args.jobs))});
    if (!args.json) std::cout << fragment_text(studied.back()) << std::flush;
    list.push_back({{"image", path},
                    {"width_px", pixels.width_px},
                    {"height_px", pixels.height_px},
                    {"rows", fragment_table({&studied.back(), 1}).json()}});
    if (alpha) list.back()["alpha_left_out"] = true;
  }
  if (args.json)
    std::cout << Json{{"fragments", list}}.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n';
  if (!args.csv.empty()) {
    const std::string csv = fragment_table(studied).csv();
    write_output_file(args.csv, text_bytes(csv));
  }
}

int study_fragments_of(const FragmentArguments& args) {
  for (std::size_t k = 1; k < args.qualities.size(); ++k)
    if (args.qualities[k] <= args.qualities[k - 1] || args.qualities.size() > 16)
      throw UsageError("study fragments: --qualities", "", "at most 16, strictly rising",
                       fmt::format("{}", fmt::join(args.qualities, ",")));
  run_fragments(args);
  return kExitOk;
}

}  // namespace

void add_fragments_study(Command& study) {
  auto [c, args] =
      study.add("fragments",
                "Does cutting a texture cost bytes? The sum of its fragments against one file (Table "
                "3.1, Figs. 3.5-3.8)",
                study_fragments_of);
  c.option("IMAGES", args.images, "JPEG, PNG, TIFF, WebP or EXR images").required();
  c.option("--grids", args.grids, "Fragments in a row and a column: 16 cuts into 16 x 16")
      .separated_by(',')
      .integer_in(1, 64)
      .shows_default();
  c.option("--qualities", args.qualities, "JPEG qualities, rising, at most 16")
      .separated_by(',')
      .integer_in(1, 100)
      .shows_default();
  c.option("--subsampling", args.subsampling, "Chroma resolution", "NAME")
      .one_of({"420", "444"})
      .shows_default();
  c.flag(
      "--decode", args.decode,
      "Time decoding, too, in CPU time of one thread: one file against all fragments, each made a whole file again");
  c.option("--csv", args.csv, "Write the figures, in bytes, to this file as well", "FILE");
  add_jobs_and_json_options(c, args.jobs, args.json);
  c.examples(
      "  texmesh-lab study fragments atlas.jpg\n"
      "  texmesh-lab study fragments *.jpg --grids 4,8,16 --qualities 20,60,90 --csv figures.csv");
  c.notes(
      "Columns: one file with the standard's Huffman tables (std) and with tables of its own (opt); the "
      "sum of the fragments as such files; and the fragments as packages hold them, abbreviated streams "
      "behind one shared table stream, which is counted. \"over std %\" is how much more a sum takes than "
      "one such file; less is negative. Of quality 100 all of them have their channels apart, as packages have.\n"
      "Sides of fragments are multiples of 16: the image's edges are repeated to fill the last fragments, "
      "and small images are cut into fewer than n x n.\n"
      "Exit code: 0, 1 when an image cannot be read, 2 usage, 3 internal error.");
}

}  // namespace texmesh
