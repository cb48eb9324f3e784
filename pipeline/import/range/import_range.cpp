#include "pipeline/import/range/import_range.h"

#include <nlohmann/json.hpp>

#include "format/base/portable_math.h"
#include "format/base/text_bytes.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxJsonBytes = 1 << 20, kMaxGridHeaderBytes = 1 << 16;

// The KEY=VALUE lines of a Cyberware file.
struct CyberwareHeader {
  std::map<std::string, std::string> values;
  std::size_t data_offset = 0;
};

CyberwareHeader read_cyberware_header(const std::string& file, std::span<const std::uint8_t> bytes) {
  CyberwareHeader header;
  const std::string_view text = text_of(bytes).substr(0, kMaxGridHeaderBytes);
  std::size_t at = 0, line = 0;
  for (;;) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos)
      throw InputError(file, "line " + std::to_string(line + 1), "DATA=", "the end of the header");
    const std::string_view words = trim(text.substr(at, end - at));
    at = end + 1;
    ++line;
    if (line == 1) {
      if (words != "Cyberware Digitizer Data")
        throw InputError(file, "line 1", "\"Cyberware Digitizer Data\"", quote(words));
      continue;
    }
    if (words == "DATA=") break;
    const std::size_t equals = words.find('=');
    if (equals != std::string_view::npos)
      header.values.try_emplace(std::string(words.substr(0, equals)), trim(words.substr(equals + 1)));
  }
  header.data_offset = at;
  return header;
}

std::int64_t integer(const std::string& file, const CyberwareHeader& header, const char* key, std::int64_t lo,
                     std::int64_t hi) {
  const auto it = header.values.find(key);
  std::int64_t value = 0;
  if (it == header.values.end() || !parse_integer(it->second, value) || value < lo || value > hi)
    throw InputError(file, key, "a whole number from " + std::to_string(lo) + " to " + std::to_string(hi),
                     it == header.values.end() ? "none" : quote(it->second));
  return value;
}

// ---- the grid's values

struct Values {
  std::uint32_t columns = 0, rows = 0;
  std::vector<float> data;
};

// Binary PGM ("P5"), 8 or 16 bits, big-endian; comments run from # to the end of the line.
class PgmReader {
 public:
  PgmReader(const std::string& file, std::span<const std::uint8_t> bytes) : file_(file), bytes_(bytes) {}

  Values read(const ImportOptions& options) {
    at_ = 2;  // "P5"
    Values v;
    v.columns = number("width");
    v.rows = number("height");
    const std::uint32_t most = number("largest value");
    if (most < 1 || most > 65535)
      throw InputError(file_, "PGM header", "a largest value from 1 to 65535", std::to_string(most));
    ++at_;  // the one blank behind the header
    const std::uint64_t samples = std::uint64_t{v.columns} * v.rows, size = samples * (most > 255 ? 2 : 1);
    if (static_cast<double>(samples) > options.max_image_pixels)
      throw InputError(file_, "PGM header", "a grid within max_image_pixels", std::to_string(samples));
    if (at_ > bytes_.size() || bytes_.size() - at_ < size)
      throw InputError(file_, "PGM data", std::to_string(size) + " bytes",
                       std::to_string(bytes_.size() - std::min(at_, bytes_.size())));
    v.data.resize(samples);
    const std::uint8_t* p = bytes_.data() + at_;
    for (std::uint64_t i = 0; i < samples; ++i)
      v.data[i] = most > 255 ? static_cast<float>(p[2 * i] << 8 | p[2 * i + 1]) : static_cast<float>(p[i]);
    return v;
  }

 private:
  std::uint32_t number(const char* what) {
    skip_blanks();
    std::uint32_t n = 0;
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && bytes_[at_] >= '0' && bytes_[at_] <= '9' && at_ - begin < 6)
      n = n * 10 + (bytes_[at_++] - '0');
    if (at_ == begin || n > 99999)
      throw InputError(file_, "PGM header", std::string("a ") + what + " up to 99999", "none");
    return n;
  }
  void skip_blanks() {
    while (at_ < bytes_.size()) {
      const char c = static_cast<char>(bytes_[at_]);
      if (c == '#') {
        while (at_ < bytes_.size() && bytes_[at_] != '\n') ++at_;
      } else if (!is_blank(c) && c != '\n') {
        return;
      } else {
        ++at_;
      }
    }
  }
  const std::string& file_;
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

Values read_values(const std::string& name, std::vector<std::uint8_t> bytes, const ImportOptions& options) {
  if (bytes.size() >= 3 && bytes[0] == 'P' && bytes[1] == '5') return PgmReader(name, bytes).read(options);
  ImageLimits limits;
  limits.max_pixels = static_cast<std::uint64_t>(options.max_image_pixels);
  const std::optional<ImageFormat> format = sniff_image_format(bytes);
  if (format == ImageFormat::kJpeg || format == ImageFormat::kWebp || !format)
    throw InputError(name, "first bytes", "EXR, TIFF, PNG or PGM (P5)",
                     format ? image_format_name(*format) : "another format");
  const Image image = probe_image(name, std::move(bytes), limits);
  if (image.channels != 1)
    throw InputError(name, "image header", "one channel", std::to_string(image.channels));
  FloatPixels pixels = decode_float(image);
  return {pixels.width_px, pixels.height_px, std::move(pixels.data)};
}

// ---- from the JSON

bool is_full_turn(double alpha_step_rad, std::uint32_t columns) {
  return std::fabs(alpha_step_rad * columns - 2 * portable::kPi) < 0.5 * alpha_step_rad;
}

RangeScan scan_from_json(const std::string& file, const RangeScanDescription& d, Resolver& resolver,
                         const ImportOptions& options, Notes& notes) {
  NamedFile grid = find_file({d.grid, "", false}, resolver,
                             static_cast<std::uint64_t>(options.max_file_bytes), notes, "/grid");
  if (!grid.bytes) throw InputError(file, "/grid", "the file " + quote(d.grid), "none: " + grid.looked_for);
  if (const std::string foreign = foreign_file(*grid.bytes); !foreign.empty())
    throw InputError(file, "/grid", "a picture or a table of radii", quote(grid.name) + " is " + foreign);
  const Values values = read_values(grid.name, std::move(*grid.bytes), options);
  RangeScan scan;
  scan.columns = values.columns;
  scan.rows = values.rows;
  const double turn = 2 * portable::kPi, degree = portable::kPi / 180;
  scan.alpha_step_rad = d.alpha_step_deg ? *d.alpha_step_deg * degree : turn / std::max(1u, values.columns);
  scan.alpha_start_rad = d.alpha_start_deg * degree;
  scan.clockwise = d.direction == ScanDirection::kClockwise;
  scan.y_step = d.y_step;
  scan.y_top = d.y_top.value_or(d.y_step * (std::max(1u, values.rows) - 1));
  scan.max_radius_step = d.max_radius_step.value_or(0);
  scan.radius.resize(values.data.size());
  for (std::size_t i = 0; i < values.data.size(); ++i) {
    const double x = values.data[i], r = d.radius_scale.value_or(1) * x + d.radius_offset;
    const bool valid = std::isfinite(r) && r > 0 && r < 1e15 && (!d.valid_min || x >= *d.valid_min) &&
                       (!d.valid_max || x <= *d.valid_max);
    scan.radius[i] = valid ? static_cast<float>(r) : 0;
  }
  return scan;
}

void check_scan(const std::string& file, RangeScan& scan, const ImportOptions& options) {
  scan.full_turn = is_full_turn(scan.alpha_step_rad, scan.columns);
  const std::uint64_t samples = std::uint64_t{scan.columns} * scan.rows;
  if (scan.columns < (scan.full_turn ? 3u : 2u) || scan.rows < 2)
    throw InputError(file, "grid", "at least 2 x 2 samples, 3 columns for a full turn",
                     std::to_string(scan.columns) + " x " + std::to_string(scan.rows));
  if (samples > static_cast<std::uint64_t>(options.max_vertices))
    throw InputError(file, "grid", "at most " + std::to_string(options.max_vertices) + " samples",
                     std::to_string(samples));
  if (scan.alpha_step_rad * (scan.columns - 1) > 2 * portable::kPi)
    throw InputError(file, "grid", "columns that stay within one turn",
                     std::to_string(scan.alpha_step_rad * scan.columns * 180 / portable::kPi) + " degrees");
}

// ---- the mesh

class GridMesher {
 public:
  GridMesher(const RangeScan& scan, Model& model) : scan_(scan), model_(model) {}

  void run() {
    add_positions();
    add_wedges();
    const std::uint32_t cells = scan_.full_turn ? scan_.columns : scan_.columns - 1;
    for (std::uint32_t j = 0; j + 1 < scan_.rows; ++j)
      for (std::uint32_t i = 0; i < cells; ++i) add_cell(i, j);
    fill_range();
  }

 private:
  std::size_t sample(std::uint32_t i, std::uint32_t j) const {
    return std::size_t{j} * scan_.columns + i % scan_.columns;
  }

  void add_positions() {
    position_.assign(scan_.radius.size(), kNoIndex);
    std::vector<double> sine(scan_.columns), cosine(scan_.columns);
    for (std::uint32_t i = 0; i < scan_.columns; ++i) {
      const double turned = scan_.alpha_step_rad * i,
                   alpha = scan_.alpha_start_rad + (scan_.clockwise ? -turned : turned);
      sine[i] = portable::sin(alpha);
      cosine[i] = portable::cos(alpha);
    }
    for (std::uint32_t j = 0; j < scan_.rows; ++j)
      for (std::uint32_t i = 0; i < scan_.columns; ++i) {
        const double r = scan_.radius[sample(i, j)];
        if (!(r > 0)) continue;
        position_[sample(i, j)] = static_cast<std::uint32_t>(points_.size());
        points_.push_back({r * sine[i], scan_.y_top - scan_.y_step * j, r * cosine[i]});
      }
    set_positions(model_.mesh, points_);
  }

  // A wedge per position, and behind them one more for each sample of column 0 of a full turn: the seam,
  // where u goes on past 1 (the texture repeats), so that the last cells are not squeezed backwards over
  // the whole picture.
  void add_wedges() {
    Mesh& mesh = model_.mesh;
    seam_.assign(scan_.rows, kNoIndex);
    for (std::uint32_t j = 0; j < scan_.rows; ++j)
      for (std::uint32_t i = 0; i < scan_.columns; ++i)
        if (position_[sample(i, j)] != kNoIndex) add_wedge(position_[sample(i, j)], i, j);
    for (std::uint32_t j = 0; scan_.full_turn && j < scan_.rows; ++j) {
      if (position_[sample(0, j)] == kNoIndex) continue;
      seam_[j] = static_cast<std::uint32_t>(mesh.wedge_count());
      add_wedge(position_[sample(0, j)], scan_.columns, j);
    }
  }

  // Texel centres of a picture of the grid's own resolution lie on the samples.
  void add_wedge(std::uint32_t position, std::uint32_t i, std::uint32_t j) {
    model_.mesh.wedge_position.push_back(position);
    model_.mesh.uv0.push_back(
        {static_cast<float>((i + 0.5) / scan_.columns), static_cast<float>((j + 0.5) / scan_.rows)});
  }

  std::uint32_t wedge(std::uint32_t i, std::uint32_t j) const {
    return i == scan_.columns ? seam_[j] : position_[sample(i, j)];
  }

  void add_triangle(std::array<std::uint32_t, 2> a, std::array<std::uint32_t, 2> b,
                    std::array<std::uint32_t, 2> c) {
    const std::array<std::array<std::uint32_t, 2>, 3> corners{a, b, c};
    Triangle t;
    float lo = INFINITY, hi = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      t[k] = wedge(corners[k][0], corners[k][1]);
      if (t[k] == kNoIndex) return;
      const float r = scan_.radius[sample(corners[k][0], corners[k][1])];
      lo = std::min(lo, r);
      hi = std::max(hi, r);
    }
    if (scan_.max_radius_step > 0 && hi - lo > scan_.max_radius_step) return;
    if (scan_.clockwise) std::swap(t[1], t[2]);
    model_.mesh.triangles.push_back(t);
  }

  // Seen from outside, columns run to the right (to the left when clockwise, which swaps the winding) and
  // rows down. The shorter diagonal splits a cell; a cell that lacks one sample gives one triangle.
  void add_cell(std::uint32_t i, std::uint32_t j) {
    const std::array<std::uint32_t, 2> a{i, j}, b{i + 1, j}, c{i + 1, j + 1}, d{i, j + 1};
    if (falling_diagonal(a, b, c, d)) {
      add_triangle(a, d, c);
      add_triangle(a, c, b);
    } else {
      add_triangle(a, d, b);
      add_triangle(b, d, c);
    }
  }

  bool falling_diagonal(std::array<std::uint32_t, 2> a, std::array<std::uint32_t, 2> b,
                        std::array<std::uint32_t, 2> c, std::array<std::uint32_t, 2> d) const {
    const auto at = [this](const std::array<std::uint32_t, 2>& s) { return position_[sample(s[0], s[1])]; };
    if (at(b) == kNoIndex || at(d) == kNoIndex) return true;
    if (at(a) == kNoIndex || at(c) == kNoIndex) return false;
    const Vec3d ac = points_[at(c)] - points_[at(a)], bd = points_[at(d)] - points_[at(b)];
    return dot(ac, ac) <= dot(bd, bd);
  }

  void fill_range() {
    RangeGrid& range = model_.range;
    range.columns = scan_.columns;
    range.rows = scan_.rows;
    range.radius = scan_.radius;
    range.alpha_step_rad = static_cast<float>(scan_.alpha_step_rad);
    range.y_step = static_cast<float>(scan_.y_step);
    range.full_turn = scan_.full_turn;
    range.position = position_;
  }

  const RangeScan& scan_;
  Model& model_;
  std::vector<Vec3d> points_;
  std::vector<std::uint32_t> position_, seam_;
};

void add_material(const std::string& file, const std::optional<std::string>& texture, Resolver& resolver,
                  const ImportOptions& options, Model& model) {
  Material material = scan_material(texture ? *texture : "untextured");
  if (texture) {
    material.base_colour_texture.image =
        add_image(model, {*texture, "", false}, resolver, file, "/texture", options);
    material.base_colour_texture.wrap_t = Wrap::kClamp;
  }
  model.materials.push_back(std::move(material));
}

}  // namespace

RangeScanDescription read_range_scan_description(const std::string& file,
                                                 std::span<const std::uint8_t> json) {
  const Json document = parse_document(json, kMaxJsonBytes, 16, file);
  auto d = from_json<RangeScanDescription>(document, file, true);
  for (const auto& [name, step] : {std::pair("alpha_step_deg", d.alpha_step_deg),
                                   {"y_step", d.y_step},
                                   {"radius_scale", d.radius_scale},
                                   {"max_radius_step", d.max_radius_step}})
    if (step == 0) throw InputError(file, std::string("/") + name, "a number above 0", "0");
  return d;
}

RangeScan read_cyberware(const std::string& file, std::span<const std::uint8_t> bytes,
                         const ImportOptions& options, Notes& notes) {
  const CyberwareHeader header = read_cyberware_header(file, bytes);
  if (const auto space = header.values.find("SPACE");
      space != header.values.end() && space->second != "CYLINDRICAL")
    throw InputError(file, "SPACE", "CYLINDRICAL", quote(space->second));
  RangeScan scan;
  scan.columns = static_cast<std::uint32_t>(integer(file, header, "NLG", 2, 65535));
  scan.rows = static_cast<std::uint32_t>(integer(file, header, "NLT", 2, 65535));
  scan.alpha_step_rad = static_cast<double>(integer(file, header, "LGINCR", 1, 3'000'000)) * 1e-6;
  scan.y_step = static_cast<double>(integer(file, header, "LTINCR", 1, 1'000'000'000)) * 1e-3;
  const auto shift = integer(file, header, "RSHIFT", 0, 15);
  scan.y_top = scan.y_step * (scan.rows - 1);
  const auto right = header.values.find("THETA_RIGHTHAND");
  scan.clockwise = right == header.values.end() || !same_word(right->second, "TRUE");
  if (header.values.count("COLOR"))
    add_info(notes, "colour-not-read", "COLOR",
             "the colours of a Cyberware scan stand in another file, which is not read");
  const std::uint64_t samples = std::uint64_t{scan.columns} * scan.rows;
  if (samples > static_cast<std::uint64_t>(options.max_vertices))
    throw InputError(file, "NLG x NLT", "at most " + std::to_string(options.max_vertices),
                     std::to_string(samples));
  if (bytes.size() - header.data_offset < samples * 2)
    throw InputError(file, "DATA", std::to_string(samples * 2) + " bytes",
                     std::to_string(bytes.size() - header.data_offset));
  scan.radius.resize(samples);
  const std::uint8_t* data = bytes.data() + header.data_offset;
  for (std::uint32_t i = 0; i < scan.columns; ++i)
    for (std::uint32_t j = 0; j < scan.rows; ++j, data += 2) {
      const auto value = static_cast<std::int16_t>(data[0] << 8 | data[1]);
      // Latitude 0 is at the bottom.
      scan.radius[std::size_t{scan.rows - 1 - j} * scan.columns + i] =
          value > 0 ? static_cast<float>(static_cast<double>(std::int32_t{value} << shift) * 1e-3) : 0.0f;
    }
  return scan;
}

ImportedModel import_range_scan(const std::string& file_name, std::span<const std::uint8_t> bytes,
                                Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  ImportedModel out;
  out.format = "range";
  RangeScan scan;
  std::optional<std::string> texture;
  if (text_of(bytes).substr(0, 9) == "Cyberware") {
    scan = read_cyberware(file_name, bytes, options, out.model.notes);
    for (const Note& n : out.model.notes)
      if (n.code == "colour-not-read") out.lost["colour files"] = 1;
  } else {
    const SourceText text(text_of(bytes), file_name, out.model.notes);
    const RangeScanDescription description = read_range_scan_description(file_name, text_bytes(text.text()));
    scan = scan_from_json(file_name, description, resolver, options, out.model.notes);
    texture = description.texture;
  }
  check_scan(file_name, scan, options);
  context.check_cancelled();
  GridMesher(scan, out.model).run();
  add_material(file_name, texture, resolver, options, out.model);
  finish_scan(out.model, file_name, options, context);
  return out;
}

}  // namespace texmesh
