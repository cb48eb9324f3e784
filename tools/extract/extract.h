#pragma once
#include <variant>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/io/record.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// What kind of images a standalone file gets. kAuto: for a number of bytes what looks best, otherwise JPEG;
/// images with alpha become PNG where JPEG would be taken.
enum class ExtractImages : std::uint8_t { kAuto, kJpeg, kWebp, kAvif, kPng };
template <>
struct EnumNames<ExtractImages> {
  static constexpr std::array<std::string_view, 5> names{"auto", "jpeg", "webp", "avif", "png"};
};

/// A scale with whole textures.
struct ExtractScale {
  /// kCoded: meshes as the package codes them. kPlain: without extensions that compress (plain_file()).
  /// kLevels: the chosen scale and all coarser ones of the step function, as levels of detail (MSFT_lod).
  enum class Form : std::uint8_t { kCoded, kPlain, kLevels };
  std::optional<int> scale;        // else the one that suits `display_px`
  std::uint32_t rung = kBestRung;  // of full-size planes
  double display_px = 0;           // displayed height, device px; 0 = not said
  ExtractImages images = ExtractImages::kAuto;
  Form form = Form::kCoded;
};

/// How long the search for a file of a number of bytes may take.
enum class ExtractEffort : std::uint8_t {
  kFast,   // decides by the package's tables alone, takes no picture
  kUsual,  // decides by parts of pictures, then by whole pictures of few files
  kBest,   // looks at many whole files: two to eight times as long, for 0 to 7 % less difference
};

/// The best-looking files of at most so many bytes.
struct ExtractBudget {
  std::vector<std::uint64_t> bytes;  // a file for each; above 0
  std::optional<int> scale;          // else what looks best
  double display_px = 512;           // displayed height at which files are compared, device px
  ExtractImages images = ExtractImages::kAuto;
  bool levels = false;  // as ExtractScale::Form::kLevels
  ExtractEffort effort = ExtractEffort::kUsual;
  bool fast() const { return effort == ExtractEffort::kFast; }
  bool best() const { return effort == ExtractEffort::kBest; }
};

/// A proxy as the package has it.
struct ExtractProxy {
  std::uint32_t proxy = 0;
  bool plain = false;  // as ExtractScale::Form::kPlain
};

struct ExtractRequest {
  std::variant<ExtractScale, ExtractBudget, ExtractProxy> file;
  bool recentre = false;    // near 0 instead of the source's coordinates
  bool keep_units = false;  // lengths in object units, also where their metres are known
};

inline constexpr double kMostGlbBytes = 4294967295;

enum class FileImage : std::uint8_t { kJpeg, kWebp, kAvif, kPng };
template <>
struct EnumNames<FileImage> {
  static constexpr std::array<std::string_view, 4> names{"jpeg", "webp", "avif", "png"};
};

struct ExtractedImage {
  std::uint32_t image = 0;
  std::string role;
  FileImage format = FileImage::kJpeg;
  std::uint32_t width_px = 0, height_px = 0;
  double quality = 0;
  std::uint64_t bytes = 0;
  static void fields(auto& s, auto&& v) {
    v("image", s.image, "Number of the source image: texture/<image>.");
    v("role", s.role, "As in textures.json.");
    v("format", s.format, "");
    v("width_px", s.width_px, Range{1, 65536}, "");
    v("height_px", s.height_px, Range{1, 65536}, "");
    v("quality", s.quality, Range{0, 100}, "Of the coder; 100 for png.");
    v("bytes", s.bytes, Range{1, kMostGlbBytes}, "");
  }
};

/// Processor time of the whole program that parts of a search took, seconds.
struct ExtractSpent {
  double reference_cpu_s = 0, images_cpu_s = 0, mesh_cpu_s = 0, file_cpu_s = 0, proxies_cpu_s = 0;
  static void fields(auto& s, auto&& v) {
    v("reference_cpu_s", s.reference_cpu_s, Range{0, 1e9},
      "The package's best in pictures; of several files that share it, in the first.");
    v("images_cpu_s", s.images_cpu_s, Range{0, 1e9}, "What every image gives for its bytes.");
    v("mesh_cpu_s", s.mesh_cpu_s, Range{0, 1e9}, "The choice of the mesh.");
    v("file_cpu_s", s.file_cpu_s, Range{0, 1e9}, "Filling the bytes, and looking at the file.");
    v("proxies_cpu_s", s.proxies_cpu_s, Range{0, 1e9}, "Files of proxies.");
  }
};

struct Extracted {
  std::vector<std::uint8_t> glb;                // or USDZ, of extract_usdz()
  std::string name;                             // of the file; who writes it says so
  int scale = 0;                                // the finest in the file; of a proxy the package's coarsest
  std::optional<std::uint32_t> proxy;           // the file is this proxy, or made of it
  std::vector<int> levels;                      // of levels of detail: all, finest first
  std::uint64_t triangles = 0, mesh_bytes = 0;  // mesh_bytes: everything but images; all of a whole proxy
  std::vector<ExtractedImage> images;
  std::vector<std::string> notes;

  // Of a file for a number of bytes:
  std::uint64_t asked_bytes = 0;  // 0 for other files
  /// Whether the file has at most `asked_bytes`. If not, it is the smallest that the package can give. Less
  /// than 98 % of them where the package has no more to put in, which a note tells, or where a proxy looks
  /// better.
  bool within = true;
  /// FLIP of the file's lit pictures against those of the package's best, 0 = equal, measured from `views`
  /// directions at `side_px`; -1 for other files.
  double difference = -1;
  double mesh_difference = -1;  // the same with the best textures instead: what the mesh alone costs
  int views = 0;                // 0 = differences are what the package's tables tell
  std::uint32_t side_px = 0;
  ExtractSpent spent;

  /// `value`, of a file for a number of bytes.
  template <class T>
  std::optional<T> asked(T value) const {
    return asked_bytes > 0 ? std::optional(value) : std::nullopt;
  }
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("file", s.name, "Name of the file, without its folder.");
    v("bytes", s.glb.size(), Range{20, kMostGlbBytes}, "");
    v("scale", s.scale, Range{0, 99},
      "Number of the finest scale in the file; with `proxy` the package's coarsest one.");
    v("levels", s.levels, FieldRule{.range = Range{0, 99}, .count = Range{1, 100}},
      "Scales of the file, finest first; more than one with --lods.");
    v("triangles", s.triangles, Range{1, kMostGlbBytes}, "Of the finest scale.");
    v("mesh_bytes", s.mesh_bytes, "Everything but the images; of a whole proxy the whole file.");
    v("images", s.images, "");
    v("proxy", s.proxy, Range{0, kMaxPackageProxies - 1},
      "The file is this proxy of the package, or made of it: its mesh coded coarser, its pictures smaller, maps "
      "left out; 0 = the smallest.");
    v("asked_bytes", s.asked(s.asked_bytes), "--bytes.");
    v("within", s.asked(s.within),
      "bytes is at most asked_bytes, and at least 98 % of it unless the package has no more to put in; "
      "otherwise the file is the smallest possible one.");
    v("difference", s.asked(s.difference), Range{0, 1},
      "Mean FLIP of the file's lit pictures against those of the package's best, over the object's pixels; 0 = "
      "equal. Of large pictures a quarter of the rows counts; all of them with --best.");
    v("mesh_difference", s.asked(s.mesh_difference), Range{0, 1},
      "The same with the best textures instead: what the mesh alone costs.");
    v("views", s.asked(s.views), Range{0, 1000},
      "Directions from which it was measured; 0 with --fast: the package's tables tell the differences; 0 also for S_0 "
      "with all of the source's own images.");
    v("side_px", s.asked(s.side_px), Range{1, 65536}, "Side of those pictures.");
    v("spent", s.asked(s.spent), "Processor time of the search, seconds; it differs from run to run.");
    v("notes", s.notes, "");
  }
};

/// glTF files that any viewer opens alone: one for each number of bytes of an ExtractBudget, one for other
/// requests. Files for several numbers of bytes share one search, and are those that each number alone gives.
/// Deterministic for any number of threads. InputError for a scale, rung or proxy that is not there;
/// FormatError when the package is damaged.
std::vector<Extracted> extract_files(PackageReader& package, const ExtractRequest& request,
                                     const RunContext& context);
/// The first of these files.
Extracted extract_model(PackageReader& package, const ExtractRequest& request, const RunContext& context);

DocumentSchema extract_schema();
/// For people.
std::string extract_text(const Extracted& extracted);

}  // namespace texmesh
