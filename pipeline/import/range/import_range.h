#pragma once

#include "pipeline/import/import.h"
#include "pipeline/io/record.h"

namespace texmesh {

enum class ScanDirection : std::uint8_t { kCounterClockwise, kClockwise };
template <>
struct EnumNames<ScanDirection> {
  static constexpr std::array<std::string_view, 2> names{"counter-clockwise", "clockwise"};
};

/// The JSON of a cylindrical range scan (schemas/range-scan.v1.schema.json).
struct RangeScanDescription {
  std::optional<std::string> schema;
  std::string grid;  // EXR, TIFF, PNG or PGM: one column per angle, one row per height, top row first
  // Spread over the grid: its columns and rows are the grid's, at any resolution.
  std::optional<std::string> texture;
  std::optional<double> alpha_step_deg;  // between columns; without it the columns are a full turn
  double alpha_start_deg = 0;            // of the first column: 0 looks along +z, 90 along +x
  ScanDirection direction = {};          // how columns run as seen from above
  double y_step = 0;                     // between rows, object units, > 0
  std::optional<double> y_top;           // of the first row; without it the last row is at 0
  std::optional<double> radius_scale;    // r = scale * value + offset, object units; without it 1
  double radius_offset = 0;
  std::optional<double> valid_min, valid_max;  // values (of the grid, before scaling) outside are no samples
  // Triangles whose corners differ more in r are left out (the rim of what hides).
  std::optional<double> max_radius_step;
  static void fields(auto& s, auto&& v) {
    constexpr Range kAngles{-360, 360}, kLengths{-1e15, 1e15}, kFactors{0, 1e15}, kAll{-1e300, 1e300};
    v("$schema", s.schema, kNotEmpty, "");
    v("version", Constant{1}, "");
    v("type", Constant{"cylindrical-range-scan"}, "");
    v("grid", s.grid, kNotEmpty, "");
    v("texture", s.texture, kNotEmpty, "");
    v("alpha_step_deg", s.alpha_step_deg, Range{0, 120}, "");
    v("alpha_start_deg", s.alpha_start_deg, FieldRule{.range = kAngles, .may_miss = true}, "");
    v("direction", s.direction, kMayMiss, "");
    v("y_step", s.y_step, Range{0, 1e12}, "");
    v("y_top", s.y_top, kLengths, "");
    v("radius_scale", s.radius_scale, kFactors, "");
    v("radius_offset", s.radius_offset, FieldRule{.range = kLengths, .may_miss = true}, "");
    v("valid_min", s.valid_min, kAll, "");
    v("valid_max", s.valid_max, kAll, "");
    v("max_radius_step", s.max_radius_step, kFactors, "");
  }
};

/// Strict: an unknown field, a missing one or a value out of range is an InputError that names
/// its JSON pointer.
RangeScanDescription read_range_scan_description(const std::string& file, std::span<const std::uint8_t> json);

/// A scan before it is a mesh. Rows from the top; radius <= 0 = no sample.
struct RangeScan {
  std::uint32_t columns = 0, rows = 0;
  std::vector<float> radius;
  double alpha_start_rad = 0, alpha_step_rad = 0;  // step > 0
  bool clockwise = false, full_turn = true;
  double y_top = 0, y_step = 0;
  double max_radius_step = 0;  // 0 = any
};

/// "Cyberware Digitizer Data": lines KEY=VALUE up to "DATA=", then NLG x NLT big-endian 16-bit radii,
/// longitude by longitude, latitudes upwards. Read: SPACE (CYLINDRICAL only), NLG, NLT, LGINCR
/// (microradians), LTINCR (micrometres), RSHIFT (radius in micrometres = value << RSHIFT), THETA_RIGHTHAND
/// (longitudes run counter-clockwise seen from above; without it clockwise). -32768 and what is not above 0
/// is no sample. Object units are millimetres. LGSHIFT, the data windows and the colours of a separate file
/// are not read; the old binary header neither.
RangeScan read_cyberware(const std::string& file, std::span<const std::uint8_t> bytes,
                         const ImportOptions& options, Notes& notes);

}  // namespace texmesh
