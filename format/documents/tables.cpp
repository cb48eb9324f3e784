#include "format/documents/tables.h"

#include <algorithm>
#include <cmath>

#include "format/base/bytes.h"
#include "format/base/number16.h"
#include "format/base/rule_error.h"
#include "format/container/format_version.h"
#include "format/container/layout.h"
#include "format/documents/check_tables.h"

namespace texmesh {
namespace {

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
  bool vqp = false;
  int size_width = 1, feature_width = 1;
  std::uint64_t bytes() const {
    const auto size_bytes = static_cast<std::uint64_t>(size_width),
               feature_bytes = static_cast<std::uint64_t>(feature_width);
    return kSectionFixed + listed * 2 + rungs * 5 + knots * 3 + rungs * listed * (size_bytes + 8 + 2 + 2) +
           listed * (2 + 4 + 4) + scales * listed * feature_bytes + scales * 4 + (vqp ? listed * 2 : 0);
  }
};

/// Runs `put` with the index in an array [lines * F] of what is stored, in the file's sequence.
template <class Put>
void for_each_listed(const PlaneTables& t, std::uint64_t lines, Put put) {
  for (std::uint64_t line = 0; line < lines; ++line)
    for (const std::uint16_t f : t.order) put(static_cast<std::size_t>(line * t.fragment_count() + f));
}

Bytes write_section(const PlaneTables& t) {
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

std::vector<std::uint8_t> write_tables(const PackageTables& tables) {
  BytesOut head, sections;
  write_entry_start(head, kTablesMagic);
  head.u32(tables.planes.size());
  head.u32(0);
  std::uint64_t cells = 0;
  for (std::size_t p = 0; p < tables.planes.size(); ++p) {
    check_plane(tables.planes[p], kRounding, plane_place(p));
    add_cells(tables.planes[p], cells);
    const Bytes section = write_section(tables.planes[p]);
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
