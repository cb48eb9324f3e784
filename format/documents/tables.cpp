#include "format/documents/tables.h"

#include <algorithm>
#include <cmath>

#include "format/base/bytes.h"
#include "format/base/half.h"
#include "format/container/format_version.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

const std::string kTablesFile = kTablesPath;
constexpr std::string_view kTablesMagic = "TXMT";
constexpr std::size_t kDirectoryHead = 16, kDirectoryRecord = 36, kSectionFixed = 56;
constexpr std::uint32_t kMaxFragments = 65535, kMaxScaleCount = 100;
constexpr std::uint32_t kFeatureLimit = 1u << 24;
constexpr float kLargestMse = 65025, kLargestDssim = 2;
// How far rounding may carry a fraction out of 0..1 before the writer calls it an error.
constexpr float kRounding = 1e-4f;

[[noreturn]] void fail_tables(const std::string& place, const std::string& expected,
                              const std::string& found) {
  throw FormatError(kTablesFile, place, expected, found);
}

void require_tables(bool good, const std::string& place, const char* expected, const std::string& found) {
  if (!good) fail_tables(place, expected, found);
}

template <class T>
void require_count(const std::vector<T>& values, std::size_t count, const std::string& place) {
  if (values.size() != count)
    fail_tables(place, std::to_string(count) + " values", std::to_string(values.size()));
}

void require_range(const std::vector<float>& values, float lo, float hi, const std::string& place) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!(values[i] >= lo && values[i] <= hi))
      fail_tables(place + "[" + std::to_string(i) + "]", std::to_string(lo) + " to " + std::to_string(hi),
                  std::to_string(values[i]));
}

void check_counts(const PlaneTables& t, const std::string& place) {
  const std::size_t f = t.fragment_count(), r = t.rung_count(), n = t.scales + std::size_t{1};
  require_count(t.table_bytes, r, place + "/table_bytes");
  require_count(t.size_bytes, r * f, place + "/size_bytes");
  require_count(t.digest, r * f, place + "/digest");
  require_count(t.mse, r * f, place + "/mse");
  require_count(t.dssim, r * f, place + "/dssim");
  require_count(t.covered_texels, f, place + "/covered_texels");
  require_count(t.surface_fraction, f, place + "/surface_fraction");
  for (const auto* v : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp}) require_count(*v, f, place + "/predictors");
  if (!t.skip_dssim.empty()) require_count(t.skip_dssim, f, place + "/skip_dssim");
  require_count(t.features, n * f, place + "/features");
  require_count(t.quality, n, place + "/quality");
  require_count(t.total_bytes, n * kGammaSteps, place + "/total_bytes");
}

void check_shape(const PlaneTables& t, const std::string& place) {
  require_tables(
      t.columns >= 1 && t.rows >= 1 && t.columns <= kMaxFragments && t.rows <= kMaxFragments / t.columns,
      place + "/columns,rows", "1 to 65535 fragments",
      std::to_string(t.columns) + " x " + std::to_string(t.rows));
  require_tables(t.scales < kMaxScaleCount, place + "/scales", "at most 99", std::to_string(t.scales));
  require_tables(!t.rung_quality.empty() && t.rung_quality.size() <= kMaxPackageRungs,
                 place + "/rung_quality", "1 to 100 rungs", std::to_string(t.rung_quality.size()));
  for (std::size_t r = 0; r < t.rung_count(); ++r)
    require_tables(t.rung_quality[r] >= 1 && t.rung_quality[r] <= 100 &&
                       (r == 0 || t.rung_quality[r] > t.rung_quality[r - 1]),
                   place + "/rung_quality", "1 to 100, strictly rising", std::to_string(t.rung_quality[r]));
}

void check_parameters(const PlaneTables& t, const std::string& place) {
  require_tables(t.allocation <= 2, place + "/allocation", "0, 1 or 2", std::to_string(t.allocation));
  require_range({t.quality_width}, 0, 100, place + "/quality_width");
  require_range({t.log_width}, 0, 4, place + "/log_width");
  require_range({t.quality_max}, 1, 100, place + "/quality_max");
  require_range({t.quality_min}, 1, t.quality_max, place + "/quality_min");
  require_range({t.model_a, t.model_b, t.model_r, t.model_correlation, t.model_error}, -1e30f, 1e30f,
                place + "/model");
}

/// Each stored fragment stands in the order once, and only stored fragments have sizes and digests.
void check_fragment_order(const PlaneTables& t, const std::string& place) {
  const std::size_t fragments = t.fragment_count();
  std::vector<bool> listed(fragments, false);
  for (const std::uint16_t f : t.order) {
    require_tables(f < fragments && !listed[f], place + "/order", "every stored fragment once",
                   std::to_string(f));
    listed[f] = true;
  }
  std::vector<bool> stored(fragments, false);
  for (std::size_t k = 0; k < t.size_bytes.size(); ++k) {
    if (t.size_bytes[k] > 0) stored[k % fragments] = true;
    require_tables(t.size_bytes[k] > 0 || t.digest[k] == 0, place + "/digest", "0 where nothing is stored",
                   "a digest");
  }
  for (std::size_t f = 0; f < fragments; ++f)
    require_tables(stored[f] == listed[f], place + "/order", "exactly the fragments that have a size",
                   "fragment " + std::to_string(f));
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
    require_tables(rises && above > 0 && above < t.rung_count() && t.rung_quality[above] != q,
                   place + "/knot_quality", "strictly rising, between rungs", std::to_string(q));
    require_tables(k == 0 || above != before || t.knot_position[k] >= t.knot_position[k - 1],
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
  check_knots(t, place);
  require_range(t.surface_fraction, 0, 1 + rounding, place + "/surface_fraction");
  for (const auto* v : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp})
    require_range(*v, -rounding, 1 + rounding, place + "/predictors");
  require_range(t.quality, 0, 100, place + "/quality");
  for (const std::uint32_t f : t.features)
    require_tables(f < kFeatureLimit, place + "/features", "less than 2^24", std::to_string(f));
  check_fragment_order(t, place);
}

/// The least number of bytes that holds every value, 1 to 4.
int width_of(const std::vector<std::uint32_t>& values) {
  const std::uint32_t largest = values.empty() ? 0 : *std::ranges::max_element(values);
  return largest < (1u << 8) ? 1 : largest < (1u << 16) ? 2 : largest < (1u << 24) ? 3 : 4;
}

std::uint16_t to_unit16(float v) {
  return static_cast<std::uint16_t>(std::floor(std::clamp(v, 0.0f, 1.0f) * 65535.0 + 0.5));
}
float from_unit16(std::uint16_t v) { return static_cast<float>(v / 65535.0); }

// What format 1.1 adds to the end of a section.
constexpr std::uint64_t kExtensionFixed = 4;
constexpr std::uint8_t kHasSkipDssim = 1;
constexpr std::uint8_t kIncremental = 2;
constexpr std::uint8_t kHasKnots = 4;
constexpr std::uint8_t kAllFlags = kHasSkipDssim | kIncremental | kHasKnots;

std::uint64_t section_bytes(std::uint64_t f, std::uint64_t r, std::uint64_t n, std::uint64_t order,
                            std::uint64_t size_width, std::uint64_t feature_width) {
  return kSectionFixed + r * 5 + r * f * (size_width + 8 + 2 + 2) + f * (4 + 4 + 5 * 2) + order * 2 +
         n * f * feature_width + n * 4 + n * kGammaSteps * 8;
}

Bytes write_section(const PlaneTables& t) {
  const int size_width = width_of(t.size_bytes), feature_width = width_of(t.features);
  BytesOut out;
  out.u32(t.columns);
  out.u32(t.rows);
  out.u8(t.scales);
  out.u8(t.rung_count());
  out.u8(static_cast<std::uint64_t>(size_width));
  out.u8(static_cast<std::uint64_t>(feature_width));
  out.u8(std::min<std::uint8_t>(t.allocation, 1));  // readers of format 1.0 know 0 and 1
  out.number(0, 3);
  for (const float v : {t.quality_width, t.log_width, t.quality_min, t.quality_max, t.model_a, t.model_b,
                        t.model_r, t.model_correlation, t.model_error})
    out.f32(v);
  out.u32(t.order.size());
  out.raw(t.rung_quality);
  for (const auto v : t.table_bytes) out.u32(v);
  for (const auto v : t.size_bytes) out.number(v, size_width);
  for (const auto v : t.digest)
    for (int i = 7; i >= 0; --i) out.u8(v >> (8 * i) & 0xff);  // as the digest's bytes stand
  for (const auto v : t.mse) out.u16(to_half(v));
  for (const auto v : t.dssim) out.u16(to_half(std::max(v, 0.0f)));
  for (const auto v : t.covered_texels) out.u32(v);
  for (const auto v : t.surface_fraction) out.f32(std::min(v, 1.0f));
  for (const auto* values : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp})
    for (const auto v : *values) out.u16(to_unit16(v));
  for (const auto v : t.order) out.u16(v);
  for (const auto v : t.features) out.number(v, feature_width);
  for (const auto v : t.quality) out.f32(v);
  for (const auto v : t.total_bytes) out.u64(v);
  out.u8(t.allocation);
  out.u8((t.skip_dssim.empty() ? 0u : kHasSkipDssim) | (t.incremental ? kIncremental : 0u) |
         (t.knot_quality.empty() ? 0u : kHasKnots));
  out.number(0, 2);
  for (const auto v : t.skip_dssim) out.u16(to_half(std::max(v, 0.0f)));
  if (!t.knot_quality.empty()) {
    out.u8(t.knot_quality.size());
    out.raw(t.knot_quality);
    for (const auto v : t.knot_position) out.u16(to_unit16(v));
  }
  return out.finish();
}

template <class T, class Get>
void fill(std::vector<T>& values, std::uint64_t count, Get get) {
  values.resize(static_cast<std::size_t>(count));
  for (T& v : values) v = get();
}

float read_half(BytesIn& in) {
  const std::uint16_t v = in.u16();
  if (v > kLargestHalf) in.fail("a finite binary16 >= 0", std::to_string(v));
  return from_half(v);
}

void read_arrays(BytesIn& in, PlaneTables& t, std::uint64_t r, std::uint64_t order, int size_width,
                 int feature_width) {
  const std::uint64_t f = t.fragment_count(), n = t.scales + std::uint64_t{1};
  const auto u32 = [&] { return in.u32(); };
  const auto half = [&] { return read_half(in); };
  fill(t.rung_quality, r, [&] { return in.u8(); });
  fill(t.table_bytes, r, u32);
  fill(t.size_bytes, r * f, [&] { return static_cast<std::uint32_t>(in.number(size_width)); });
  fill(t.digest, r * f, [&] {
    std::uint64_t v = 0;
    for (const std::uint8_t byte : in.raw(8)) v = v << 8 | byte;
    return v;
  });
  fill(t.mse, r * f, half);
  fill(t.dssim, r * f, half);
  fill(t.covered_texels, f, u32);
  fill(t.surface_fraction, f, [&] { return in.f32(); });
  for (auto* values : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp})
    fill(*values, f, [&] { return from_unit16(in.u16()); });
  fill(t.order, order, [&] { return in.u16(); });
  fill(t.features, n * f, [&] { return static_cast<std::uint32_t>(in.number(feature_width)); });
  fill(t.quality, n, [&] { return in.f32(); });
  fill(t.total_bytes, n * kGammaSteps, [&] { return in.u64(); });
}

/// What stands behind the fields of format 1.0: nothing in such a file.
void read_extension(BytesIn& in, PlaneTables& t, int minor) {
  if (minor < 1) return in.finish();
  const std::uint8_t allocation = in.u8(), flags = in.u8();
  if (std::min<std::uint8_t>(allocation, 1) != t.allocation)
    in.fail("the allocation of the section's head, or 2 where that is 1", std::to_string(allocation));
  t.allocation = allocation;
  if (minor <= kFormatMinor && (flags > kAllFlags || in.number(2) != 0))
    in.fail("flags 0 to 7 and 2 zero bytes", "others");
  t.incremental = (flags & kIncremental) != 0;
  if (minor > kFormatMinor) in.raw(2);
  if (flags & kHasSkipDssim) fill(t.skip_dssim, t.fragment_count(), [&] { return read_half(in); });
  if (flags & kHasKnots) {
    const std::uint8_t knots = in.u8();
    if (knots == 0) in.fail("at least one knot", "none");
    fill(t.knot_quality, knots, [&] { return in.u8(); });
    fill(t.knot_position, knots, [&] { return from_unit16(in.u16()); });
  }
  if (minor <= kFormatMinor) in.finish();
}

PlaneTables read_section(std::span<const std::uint8_t> bytes, int minor, const std::string& place) {
  BytesIn in(bytes, kTablesFile + ": " + place);
  PlaneTables t;
  t.columns = in.u32();
  t.rows = in.u32();
  t.scales = in.u8();
  const std::uint64_t rungs = in.u8();
  const int size_width = in.u8(), feature_width = in.u8();
  t.allocation = in.u8();
  if (in.number(3) != 0 && minor <= kFormatMinor) in.fail("3 zero bytes", "others");
  for (float* v : {&t.quality_width, &t.log_width, &t.quality_min, &t.quality_max, &t.model_a, &t.model_b,
                   &t.model_r, &t.model_correlation, &t.model_error})
    *v = in.f32();
  const std::uint64_t order = in.u32();
  if (t.columns == 0 || t.rows == 0 || t.columns > kMaxFragments || t.rows > kMaxFragments / t.columns)
    in.fail("1 to 65535 fragments", std::to_string(t.columns) + " x " + std::to_string(t.rows));
  if (t.scales >= kMaxScaleCount || rungs == 0 || rungs > kMaxPackageRungs || order > t.fragment_count())
    in.fail("at most 99 scales, 100 rungs and every fragment once", "more");
  if (size_width < 1 || size_width > 4 || feature_width < 1 || feature_width > 3)
    in.fail("widths of 1 to 4 and 1 to 3 bytes",
            std::to_string(size_width) + ", " + std::to_string(feature_width));
  // All counts are known to be small by now, so the sum cannot overflow; nothing is allocated before
  // it is checked.
  const std::uint64_t expected =
      section_bytes(t.fragment_count(), rungs, t.scales + std::uint64_t{1}, order,
                    static_cast<std::uint64_t>(size_width), static_cast<std::uint64_t>(feature_width));
  if (bytes.size() < expected + (minor < 1 ? 0 : kExtensionFixed))
    in.fail(std::to_string(expected) + " bytes", std::to_string(bytes.size()));
  read_arrays(in, t, rungs, order, size_width, feature_width);
  read_extension(in, t, minor);
  check_plane(t, 0, place);
  if (size_width != width_of(t.size_bytes) || feature_width != width_of(t.features))
    in.fail("the least width that holds the values", "another");
  return t;
}

std::string plane_place(std::size_t plane) { return "plane " + std::to_string(plane); }

}  // namespace

std::vector<std::uint8_t> write_tables(const PackageTables& tables) {
  BytesOut head, sections;
  head.text(kTablesMagic);
  head.u16(kFormatMajor);
  head.u16(kFormatMinor);
  head.u32(tables.planes.size());
  head.u32(0);
  for (std::size_t p = 0; p < tables.planes.size(); ++p) {
    check_plane(tables.planes[p], kRounding, plane_place(p));
    const Bytes section = write_section(tables.planes[p]);
    head.u32(section.size());
    head.raw(sha256(section));
    sections.raw(section);
  }
  head.raw(sections.finish());
  return head.finish();
}

TablesHead read_tables_head(std::span<const std::uint8_t> bytes) {
  BytesIn in(bytes, kTablesFile);
  in.expect("the magic TXMT", kTablesMagic);
  if (const auto major = in.u16(); major != kFormatMajor)
    in.fail("major version " + std::to_string(kFormatMajor), std::to_string(major));
  TablesHead head;
  head.minor = in.u16();
  const std::uint64_t planes = in.u32();
  if (in.u32() != 0 && head.minor <= kFormatMinor) in.fail("4 zero bytes", "others");
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

PlaneTables read_tables_section(const TablesHead& head, std::size_t plane,
                                std::span<const std::uint8_t> section) {
  const TablesSection& s = head.planes.at(plane);
  if (section.size() != s.bytes)
    fail_tables(plane_place(plane), std::to_string(s.bytes) + " bytes", std::to_string(section.size()));
  if (sha256(section) != s.digest)
    fail_tables(plane_place(plane), "SHA-256 " + to_hex(s.digest), to_hex(sha256(section)));
  return read_section(section, head.minor, plane_place(plane));
}

PackageTables read_tables(std::span<const std::uint8_t> bytes) {
  const TablesHead head = read_tables_head(bytes);
  const std::uint64_t end =
      head.planes.empty() ? head.bytes : head.planes.back().offset + head.planes.back().bytes;
  if (end != bytes.size()) fail_tables("", std::to_string(end) + " bytes", std::to_string(bytes.size()));
  PackageTables tables;
  for (std::size_t p = 0; p < head.planes.size(); ++p)
    tables.planes.push_back(
        read_tables_section(head, p, bytes.subspan(head.planes[p].offset, head.planes[p].bytes)));
  return tables;
}

}  // namespace texmesh
