#include "format/documents/tables.h"

#include "format/base/number16.h"
#include "format/container/layout.h"

namespace texmesh {

// tables.bin: what holds for the tables of a plane, for their writer and their reader, and its bytes.

namespace {

/// Throws RuleError for tables.bin.
[[noreturn]] void fail_tables(const char* rule, const std::string& place, const std::string& expected,
                              const std::string& found) {
  throw RuleError(rule, kTablesPath, place, expected, found);
}

void require_tables(bool good, const char* rule, const std::string& place, const char* expected,
                    const std::string& found) {
  if (!good) fail_tables(rule, place, expected, found);
}

// Few bytes of a file may tell of many fragments without any.
constexpr std::uint64_t kMaxPlaneCells = 1u << 24;
constexpr std::uint32_t kMaxFragments = 65535, kMaxScaleCount = 100;

/// Numbers that a plane's tables hold, about 4 bytes of memory each: F * (5 R + N).
std::uint64_t cells_of(std::uint64_t fragments, std::uint64_t rungs, std::uint64_t scales) {
  return fragments * (5 * rungs + scales);
}

std::uint64_t cells_of(const PlaneTables& t) {
  return cells_of(t.fragment_count(), t.rung_count(), t.scale_count());
}

constexpr std::uint32_t kFeatureLimit = 1u << 24;
constexpr float kLargestMse = 65025, kLargestDssim = 2;

template <class T>
void require_count(const std::vector<T>& values, std::size_t count, const std::string& place) {
  if (values.size() != count)
    fail_tables("T03", place, std::to_string(count) + " values", std::to_string(values.size()));
}

void require_range(const std::vector<float>& values, float lo, float hi, const std::string& place) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!(values[i] >= lo && values[i] <= hi))
      fail_tables("T04", place + "[" + std::to_string(i) + "]",
                  std::to_string(lo) + " to " + std::to_string(hi), std::to_string(values[i]));
}

void check_counts(const PlaneTables& t, const std::string& place) {
  const std::size_t f = t.fragment_count(), r = t.rung_count(), n = t.scale_count();
  require_count(t.table_bytes, r, place + "/table_bytes");
  require_count(t.size_bytes, r * f, place + "/size_bytes");
  require_count(t.digest, r * f, place + "/digest");
  require_count(t.mse, r * f, place + "/mse");
  require_count(t.dssim, r * f, place + "/dssim");
  require_count(t.skip_dssim, f, place + "/skip_dssim");
  require_count(t.covered_texels, f, place + "/covered_texels");
  require_count(t.surface_fraction, f, place + "/surface_fraction");
  require_count(t.features, n * f, place + "/features");
  require_count(t.vqp, t.allocation == kByVqp ? f : 0, place + "/vqp");
}

void check_shape(const PlaneTables& t, const std::string& place) {
  require_tables(
      t.columns >= 1 && t.rows >= 1 && t.columns <= kMaxFragments && t.rows <= kMaxFragments / t.columns,
      "T03", place + "/columns,rows", "1 to 65535 fragments",
      std::to_string(t.columns) + " x " + std::to_string(t.rows));
  require_tables(t.scale_count() >= 1 && t.scale_count() <= kMaxScaleCount, "T03", place + "/quality",
                 "1 to 100 scales", std::to_string(t.scale_count()));
  require_tables(!t.rung_quality.empty() && t.rung_quality.size() <= kMaxPackageRungs, "T03",
                 place + "/rung_quality", "1 to 100 rungs", std::to_string(t.rung_quality.size()));
  require_tables(cells_of(t) <= kMaxPlaneCells, "L02", place, "at most 2^24 cells",
                 std::to_string(cells_of(t)));
  for (std::size_t r = 0; r < t.rung_count(); ++r)
    require_tables(t.rung_quality[r] >= 1 && t.rung_quality[r] <= 100 &&
                       (r == 0 || t.rung_quality[r] > t.rung_quality[r - 1]),
                   "T08", place + "/rung_quality", "1 to 100, strictly rising",
                   std::to_string(t.rung_quality[r]));
}

void check_parameters(const PlaneTables& t, const std::string& place) {
  require_tables(t.allocation <= kByVqp, "T13", place + "/allocation", "0 to 3",
                 std::to_string(t.allocation));
  require_range({t.quality_width}, 0, 100, place + "/quality_width");
  require_range({t.log_width}, 0, 4, place + "/log_width");
  require_range({t.quality_max}, 1, 100, place + "/quality_max");
  require_range({t.quality_min}, 1, t.quality_max, place + "/quality_min");
}

/// Each stored fragment stands in the order once and has bytes at every rung; others have none, and no
/// covered texels. No message is put together for what is right: few bytes can claim 2^24 cells.
void check_fragment_order(const PlaneTables& t, const std::string& place) {
  const std::size_t fragments = t.fragment_count();
  std::vector<bool> listed(fragments, false);
  for (const std::uint16_t f : t.order) {
    if (f >= fragments || listed[f])
      fail_tables("T05", place + "/order", "every stored fragment once", std::to_string(f));
    listed[f] = true;
  }
  for (std::size_t k = 0; k < t.size_bytes.size(); ++k)
    if (listed[k % fragments] != (t.size_bytes[k] > 0))
      fail_tables("T06", place + "/size_bytes",
                  "bytes at every rung for the fragments in the order and for no others",
                  "fragment " + std::to_string(k % fragments) + " with " + std::to_string(t.size_bytes[k]));
  for (std::size_t f = 0; f < fragments; ++f)
    if (!listed[f] && t.covered_texels[f] != 0)
      fail_tables("T07", place + "/covered_texels", "0 where nothing is stored",
                  std::to_string(t.covered_texels[f]));
}

/// Each knot lies between two rungs, further on than the one before.
void check_knots(const PlaneTables& t, const std::string& place) {
  require_count(t.knot_position, t.knot_quality.size(), place + "/knot_position");
  require_range(t.knot_position, 0, 1, place + "/knot_position");
  std::size_t above = 0;  // rung
  for (std::size_t k = 0; k < t.knot_quality.size(); ++k) {
    const std::uint8_t q = t.knot_quality[k];
    const bool rises = k == 0 || q > t.knot_quality[k - 1];
    const std::size_t before = above;
    while (above < t.rung_count() && t.rung_quality[above] < q) ++above;
    require_tables(rises && above > 0 && above < t.rung_count() && t.rung_quality[above] != q, "T08",
                   place + "/knot_quality", "strictly rising, between rungs", std::to_string(q));
    require_tables(k == 0 || above != before || t.knot_position[k] >= t.knot_position[k - 1], "T08",
                   place + "/knot_position", "not falling between two rungs",
                   std::to_string(t.knot_position[k]));
  }
}

/// Everything that holds for the tables of a plane. `rounding` is how far fractions may be out of their
/// range: a writer tolerates what arithmetic does and clamps it, a reader nothing.
void check_plane(const PlaneTables& t, float rounding, const std::string& place) {
  check_shape(t, place);
  check_counts(t, place);
  check_parameters(t, place);
  require_range(t.mse, 0, kLargestMse, place + "/mse");
  require_range(t.dssim, -rounding, kLargestDssim, place + "/dssim");
  require_range(t.skip_dssim, -rounding, kLargestDssim, place + "/skip_dssim");
  require_tables(t.knot_quality.size() < 256, "T03", place + "/knot_quality", "at most 255 knots", "more");
  check_knots(t, place);
  require_range(t.surface_fraction, 0, 1 + rounding, place + "/surface_fraction");
  require_range(t.quality, 0, 100, place + "/quality");
  require_range(t.vqp, 0, 1, place + "/vqp");
  require_range({t.density_weight}, 0, t.allocation == kByVqp ? 1 : 0, place + "/density_weight");
  for (const std::uint32_t f : t.features)
    if (f >= kFeatureLimit) fail_tables("T03", place + "/features", "less than 2^24", std::to_string(f));
  check_fragment_order(t, place);
}

const std::string kTablesFile = kTablesPath;
constexpr std::string_view kTablesMagic = "TXMT";
constexpr std::size_t kDirectoryHead = 16, kDirectoryRecord = 36, kSectionFixed = 36;
constexpr std::uint64_t kMaxPackageCells = 1u << 27;
// How far rounding may carry a fraction out of 0..1 before the writer calls it an error.
constexpr float kRounding = 1e-4f;

/// The least number of bytes that holds every value, 1 to 4.
int width_of(const std::vector<std::uint32_t>& values) {
  const std::uint32_t largest = values.empty() ? 0 : *std::ranges::max_element(values);
  return largest < (1u << 8) ? 1 : largest < (1u << 16) ? 2 : largest < (1u << 24) ? 3 : 4;
}

constexpr std::uint8_t kIncremental = 1;  // flag

/// What a section's first fields say of the rest.
struct SectionCounts {
  std::uint64_t scales = 0, rungs = 0, knots = 0, listed = 0;
  bool vqp = false, density = false;
  int size_width = 1, feature_width = 1;
  std::uint64_t bytes() const {
    const auto size_bytes = static_cast<std::uint64_t>(size_width),
               feature_bytes = static_cast<std::uint64_t>(feature_width);
    return kSectionFixed + listed * 2 + rungs * 5 + knots * 3 + rungs * listed * (size_bytes + 8 + 2 + 2) +
           listed * (2 + 4 + 4) + scales * listed * feature_bytes + scales * 4 + (vqp ? listed * 2 : 0) +
           (density ? 4 : 0);
  }
};

/// Runs `put` with the index in an array [lines * F] of what is stored, in the file's sequence.
void for_each_listed(const PlaneTables& t, std::uint64_t lines, auto put) {
  for (std::uint64_t line = 0; line < lines; ++line)
    for (const std::uint16_t f : t.order) put(static_cast<std::size_t>(line * t.fragment_count() + f));
}

bool has_density(const PlaneTables& t, int minor) { return t.allocation == kByVqp && minor >= 1; }

Bytes write_section(const PlaneTables& t, int minor) {
  std::vector<std::uint32_t> features;
  for_each_listed(t, t.scale_count(), [&](std::size_t k) { features.push_back(t.features[k]); });
  const int size_width = width_of(t.size_bytes), feature_width = width_of(features);
  BytesOut out;
  out.u32(t.columns);
  out.u32(t.rows);
  out.u8(t.scale_count());
  out.u8(t.rung_count());
  out.u8(static_cast<std::uint64_t>(size_width));
  out.u8(static_cast<std::uint64_t>(feature_width));
  out.u8(t.allocation);
  out.u8(t.incremental ? kIncremental : 0u);
  out.u8(t.knot_quality.size());
  out.u8(0);
  for (const float v : {t.quality_width, t.log_width, t.quality_min, t.quality_max}) out.f32(v);
  out.u32(t.order.size());
  for (const auto v : t.order) out.u16(v);
  out.raw(t.rung_quality);
  for (const auto v : t.table_bytes) out.u32(v);
  out.raw(t.knot_quality);
  for (const auto v : t.knot_position) out.u16(to_unit16(v));
  const std::size_t r = t.rung_count();
  for_each_listed(t, r, [&](std::size_t k) { out.number(t.size_bytes[k], size_width); });
  for_each_listed(t, r, [&](std::size_t k) {
    for (int i = 7; i >= 0; --i) out.u8(t.digest[k] >> (8 * i) & 0xff);  // as the digest's bytes stand
  });
  for_each_listed(t, r, [&](std::size_t k) { out.u16(to_half(t.mse[k])); });
  for_each_listed(t, r, [&](std::size_t k) { out.u16(to_half(std::max(t.dssim[k], 0.0f))); });
  for_each_listed(t, 1, [&](std::size_t k) { out.u16(to_half(std::max(t.skip_dssim[k], 0.0f))); });
  for_each_listed(t, 1, [&](std::size_t k) { out.u32(t.covered_texels[k]); });
  for_each_listed(t, 1, [&](std::size_t k) { out.f32(std::min(t.surface_fraction[k], 1.0f)); });
  for (const auto v : features) out.number(v, feature_width);
  for (const auto v : t.quality) out.f32(v);
  if (t.allocation == kByVqp) for_each_listed(t, 1, [&](std::size_t k) { out.u16(to_unit16(t.vqp[k])); });
  if (has_density(t, minor)) out.f32(t.density_weight);
  return out.finish();
}

template <class T, class Get>
void fill(std::vector<T>& values, std::uint64_t count, Get get) {
  values.resize(static_cast<std::size_t>(count));
  for (T& v : values) v = get();
}

float read_half(BytesIn& in) {
  const std::uint16_t v = in.u16();
  if (v > kLargestHalf) fail_by("T04", in, "a finite binary16 >= 0", std::to_string(v));
  return from_half(v);
}

void read_order(BytesIn& in, PlaneTables& t, std::uint64_t listed) {
  fill(t.order, listed, [&] { return in.u16(); });
  std::vector<bool> seen(t.fragment_count());
  for (const std::uint16_t f : t.order) {
    if (f >= seen.size() || seen[f])
      fail_by("T05", in, "every stored fragment once in the order", std::to_string(f));
    seen[f] = true;
  }
}

void read_arrays(BytesIn& in, PlaneTables& t, const SectionCounts& counts) {
  read_order(in, t, counts.listed);
  fill(t.rung_quality, counts.rungs, [&] { return in.u8(); });
  fill(t.table_bytes, counts.rungs, [&] { return in.u32(); });
  fill(t.knot_quality, counts.knots, [&] { return in.u8(); });
  fill(t.knot_position, counts.knots, [&] { return from_unit16(in.u16()); });
  const auto fill_listed = [&](auto& values, std::uint64_t lines, auto get) {
    values.assign(static_cast<std::size_t>(lines * t.fragment_count()), {});
    for_each_listed(t, lines, [&](std::size_t k) { values[k] = get(); });
  };
  const auto half = [&] { return read_half(in); };
  fill_listed(t.size_bytes, counts.rungs,
              [&] { return static_cast<std::uint32_t>(in.number(counts.size_width)); });
  fill_listed(t.digest, counts.rungs, [&] {
    std::uint64_t v = 0;
    for (const std::uint8_t byte : in.raw(8)) v = v << 8 | byte;
    return v;
  });
  fill_listed(t.mse, counts.rungs, half);
  fill_listed(t.dssim, counts.rungs, half);
  fill_listed(t.skip_dssim, 1, half);
  fill_listed(t.covered_texels, 1, [&] { return in.u32(); });
  fill_listed(t.surface_fraction, 1, [&] { return in.f32(); });
  fill_listed(t.features, counts.scales,
              [&] { return static_cast<std::uint32_t>(in.number(counts.feature_width)); });
  fill(t.quality, counts.scales, [&] { return in.f32(); });
  if (counts.vqp) fill_listed(t.vqp, 1, [&] { return from_unit16(in.u16()); });
  if (counts.density) t.density_weight = in.f32();
}

/// The fields in front of a section's arrays. All counts are small afterwards, so that no product of them
/// overflows.
SectionCounts read_section_start(BytesIn& in, PlaneTables& t, int minor) {
  SectionCounts counts;
  t.columns = in.u32();
  t.rows = in.u32();
  counts.scales = in.u8();
  counts.rungs = in.u8();
  counts.size_width = in.u8(), counts.feature_width = in.u8();
  t.allocation = in.u8();
  counts.vqp = t.allocation == kByVqp;
  counts.density = has_density(t, minor);
  const std::uint8_t flags = in.u8();
  counts.knots = in.u8();
  if (const auto reserved = in.u8(); (flags > kIncremental || reserved != 0) && minor <= kFormatMinor)
    fail_by("W05", in, "flags 0 or 1 and a zero byte",
            std::to_string(flags) + ", " + std::to_string(reserved));
  t.incremental = (flags & kIncremental) != 0;
  for (float* v : {&t.quality_width, &t.log_width, &t.quality_min, &t.quality_max}) *v = in.f32();
  counts.listed = in.u32();
  if (t.columns == 0 || t.rows == 0 || t.columns > kMaxFragments || t.rows > kMaxFragments / t.columns)
    in.fail("1 to 65535 fragments", std::to_string(t.columns) + " x " + std::to_string(t.rows));
  if (counts.scales == 0 || counts.scales > kMaxScaleCount || counts.rungs == 0 ||
      counts.rungs > kMaxPackageRungs || counts.listed > t.fragment_count())
    in.fail("1 to 100 scales, 1 to 100 rungs and every fragment at most once", "others");
  if (const std::uint64_t cells = cells_of(t.fragment_count(), counts.rungs, counts.scales);
      cells > kMaxPlaneCells)
    fail_by("L02", in, "at most 2^24 cells", std::to_string(cells));
  if (counts.size_width < 1 || counts.size_width > 4 || counts.feature_width < 1 || counts.feature_width > 3)
    in.fail("widths of 1 to 4 and 1 to 3 bytes",
            std::to_string(counts.size_width) + ", " + std::to_string(counts.feature_width));
  return counts;
}

PlaneTables read_section(std::span<const std::uint8_t> bytes, int minor, const std::string& place) {
  BytesIn in(bytes, kTablesFile + ": " + place);
  PlaneTables t;
  const SectionCounts counts = read_section_start(in, t, minor);
  // Nothing is allocated before the bytes are known to be there.
  if (bytes.size() < counts.bytes())
    in.fail(std::to_string(counts.bytes()) + " bytes", std::to_string(bytes.size()));
  read_arrays(in, t, counts);
  if (minor <= kFormatMinor) in.finish();
  check_plane(t, 0, place);
  if (counts.size_width != width_of(t.size_bytes) || counts.feature_width != width_of(t.features))
    fail_by("T08", in, "the least width that holds the values", "another");
  return t;
}

void add_cells(const PlaneTables& t, std::uint64_t& cells) {
  cells += cells_of(t);
  require_tables(cells <= kMaxPackageCells, "L02", "", "at most 2^27 cells in all planes",
                 std::to_string(cells));
}

std::string plane_place(std::size_t plane) { return "plane " + std::to_string(plane); }

}  // namespace

PackageTables select_scales(const PackageTables& tables, const std::vector<std::size_t>& rows) {
  PackageTables out = tables;
  for (PlaneTables& t : out.planes) {
    const std::vector<std::uint32_t> features = std::move(t.features);
    const std::vector<float> quality = std::move(t.quality);
    t.features.clear(), t.quality.clear();
    for (const std::size_t row : rows) {
      t.quality.push_back(quality.at(row));  // refuses a row that is not there
      const auto begin = features.begin() + static_cast<std::ptrdiff_t>(row * t.fragment_count());
      t.features.insert(t.features.end(), begin, begin + static_cast<std::ptrdiff_t>(t.fragment_count()));
    }
  }
  return out;
}

int needed_minor(const PackageTables& tables) {
  return std::ranges::any_of(tables.planes, [](const PlaneTables& t) { return t.density_weight > 0; }) ? 1
                                                                                                       : 0;
}

std::vector<std::uint8_t> write_tables(const PackageTables& tables, int minor) {
  require_tables(minor >= needed_minor(tables), "W01", "", "a minor version that has density_weight",
                 std::to_string(minor));
  BytesOut head, sections;
  write_entry_start(head, kTablesMagic, minor);
  head.u32(tables.planes.size());
  head.u32(0);
  std::uint64_t cells = 0;
  for (std::size_t p = 0; p < tables.planes.size(); ++p) {
    check_plane(tables.planes[p], kRounding, plane_place(p));
    add_cells(tables.planes[p], cells);
    const Bytes section = write_section(tables.planes[p], minor);
    head.u32(section.size());
    head.raw(sha256(section));
    sections.raw(section);
  }
  head.raw(sections.finish());
  return head.finish();
}

static TablesHead read_directory(BytesIn& in) {
  TablesHead head;
  head.minor = read_entry_start(in, kTablesMagic, "T01");
  const std::uint64_t planes = in.u32();
  if (in.u32() != 0 && head.minor <= kFormatMinor) fail_by("T01", in, "4 zero bytes", "others");
  if (planes > in.left() / kDirectoryRecord)
    in.fail("a plane count that fits the file", std::to_string(planes));
  head.bytes = kDirectoryHead + planes * kDirectoryRecord;
  std::uint64_t offset = head.bytes;
  for (std::uint64_t p = 0; p < planes; ++p) {
    TablesSection section{offset, in.u32(), {}};
    const auto digest = in.raw(32);
    std::copy(digest.begin(), digest.end(), section.digest.begin());
    offset += section.bytes;
    head.planes.push_back(section);
  }
  return head;
}

TablesHead read_tables_head(std::span<const std::uint8_t> bytes) {
  BytesIn in(bytes, kTablesFile);
  return under_rule("T02", [&] { return read_directory(in); });
}

PlaneTables read_tables_section(const TablesHead& head, std::size_t plane,
                                std::span<const std::uint8_t> section) {
  const TablesSection& s = head.planes.at(plane);
  if (section.size() != s.bytes)
    fail_tables("T02", plane_place(plane), std::to_string(s.bytes) + " bytes",
                std::to_string(section.size()));
  if (sha256(section) != s.digest)
    fail_tables("T02", plane_place(plane), "SHA-256 " + to_hex(s.digest), to_hex(sha256(section)));
  return under_rule("T03", [&] { return read_section(section, head.minor, plane_place(plane)); });
}

PackageTables read_tables(std::span<const std::uint8_t> bytes) {
  const TablesHead head = read_tables_head(bytes);
  const std::uint64_t end =
      head.planes.empty() ? head.bytes : head.planes.back().offset + head.planes.back().bytes;
  if (end != bytes.size())
    fail_tables("T02", "", std::to_string(end) + " bytes", std::to_string(bytes.size()));
  PackageTables tables;
  std::uint64_t cells = 0;
  for (std::size_t p = 0; p < head.planes.size(); ++p) {
    tables.planes.push_back(
        read_tables_section(head, p, bytes.subspan(head.planes[p].offset, head.planes[p].bytes)));
    add_cells(tables.planes.back(), cells);
  }
  return tables;
}

}  // namespace texmesh
