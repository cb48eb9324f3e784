#include "format/documents/thesis_tables.h"

#include <tuple>

#include "format/base/number16.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

constexpr float kMostPerceptualValue = 1e30f;
constexpr std::size_t kBytesOfRow = 1 + 4 + 4 + 4 * 4, kBytesOfPair = 4 * 4;

using Values = std::vector<float> PerceptualTable::*;
constexpr std::array<Values, 4> kStepValues{&PerceptualTable::average, &PerceptualTable::largest,
                                            &PerceptualTable::least, &PerceptualTable::deviation};
constexpr std::array<Values, 4> kPairValues{&PerceptualTable::p95, &PerceptualTable::chain_average,
                                            &PerceptualTable::chain_largest, &PerceptualTable::chain_least};

[[noreturn]] void fail_perceptual(const std::string& expected, const std::string& found) {
  throw RuleError("O05", kThesisPath, "perceptual table", expected, found);
}

void check_perceptual_table(const PerceptualTable& t) {
  const std::size_t rows = t.scale.size();
  if (rows == 0 || rows > kMostChainScales || t.triangles.size() != rows || t.collapses.size() != rows)
    fail_perceptual("1 to 100 scales", std::to_string(rows));
  for (std::size_t k = 0; k < rows; ++k)
    if (k == 0 ? t.scale[0] != 0 || t.collapses[0] != 0 : t.scale[k] <= t.scale[k - 1])
      fail_perceptual("scale numbers rising from 0", std::to_string(t.scale[k]));
  if (t.scale.back() >= kMostChainScales) fail_perceptual("scale numbers below 100", "more");
  const auto require = [](const std::vector<float>& values, std::size_t count) {
    if (values.size() != count) fail_perceptual(std::to_string(count), std::to_string(values.size()));
    for (const float v : values)
      if (!(v >= 0 && v <= kMostPerceptualValue)) fail_perceptual("0 to 1e30", std::to_string(v));
  };
  for (const Values step : kStepValues) require(t.*step, rows);
  for (const Values pair : kPairValues) require(t.*pair, pair_count(rows));
}

const std::string kThesisFile = kThesisPath;
constexpr std::string_view kThesisMagic = "TXTH";
constexpr std::uint32_t kPredictorsId = 1, kSizeModelId = 2, kGammaTableId = 3, kPerceptualTableId = 4;
constexpr std::uint32_t kMostFragments = 65535, kWholePackage = 0xffffffff;
constexpr std::uint64_t kMostTotalBytes = std::uint64_t{1} << 53;
constexpr std::size_t kSectionRecord = 12, kModelBytes = 12;
constexpr float kLargestModelValue = 1e30f;
// How far rounding may carry a predictor out of 0..1 before the writer calls it an error.
constexpr float kPredictorRounding = 1e-4f;

struct ThesisSection {
  std::uint32_t id = 0, plane = 0;
  Bytes bytes;
};

[[noreturn]] void fail_thesis(const std::string& place, const std::string& expected,
                              const std::string& found) {
  throw RuleError("O05", kThesisFile, place, expected, found);
}

std::array<std::vector<float> PlaneThesis::*, 5> predictors() {
  return {&PlaneThesis::z, &PlaneThesis::i, &PlaneThesis::zeta, &PlaneThesis::m, &PlaneThesis::vqp};
}

void require_values(const std::vector<float>& values, float lo, float hi, const std::string& place) {
  for (const float v : values)
    if (!(v >= lo && v <= hi))
      fail_thesis(place, std::to_string(lo) + " to " + std::to_string(hi), std::to_string(v));
}

std::array<float SizeModel::*, 3> model_values() {
  return {&SizeModel::a, &SizeModel::b, &SizeModel::correlation};
}

void check_thesis_plane(const PlaneThesis& t, float rounding, const std::string& place) {
  for (const auto predictor : predictors()) {
    if ((t.*predictor).size() != t.z.size() || t.z.size() > kMostFragments)
      fail_thesis(place + "predictors", "five of each fragment", std::to_string((t.*predictor).size()));
    require_values(t.*predictor, -rounding, 1 + rounding, place + "predictors");
  }
  if (t.models.size() > kMostFragments)
    fail_thesis(place + "size models", "at most 65535", std::to_string(t.models.size()));
  for (const SizeModel& model : t.models)
    for (const auto value : model_values())
      require_values({model.*value}, -kLargestModelValue, kLargestModelValue, place + "size models");
  if (t.quality.size() > kMostChainScales || t.total_bytes.size() != t.quality.size() * kGammaSteps)
    fail_thesis(place + "Gamma table", "at most 100 scales of 21 sizes",
                std::to_string(t.total_bytes.size()) + " sizes");
  require_values(t.quality, 0, 100, place + "Gamma table");
  for (const std::uint64_t bytes : t.total_bytes)
    if (bytes > kMostTotalBytes) fail_thesis(place + "Gamma table", "at most 2^53", std::to_string(bytes));
}

int bytes_width(const std::vector<std::uint64_t>& values) {
  const std::uint64_t largest = values.empty() ? 0 : *std::ranges::max_element(values);
  int width = 1;
  while (width < 8 && largest >> (8 * width) != 0) ++width;
  return width;
}

Bytes predictors_section(const PlaneThesis& t) {
  BytesOut out;
  out.u32(t.z.size());
  for (const auto predictor : predictors())
    for (const float v : t.*predictor) out.u16(to_unit16(v));
  return out.finish();
}

Bytes size_model_section(const PlaneThesis& t) {
  BytesOut out;
  out.u32(t.models.size());
  for (const auto value : model_values())
    for (const SizeModel& model : t.models) out.f32(model.*value);
  return out.finish();
}

Bytes gamma_table_section(const PlaneThesis& t) {
  const int width = bytes_width(t.total_bytes);
  BytesOut out;
  out.u8(t.quality.size());
  out.u8(static_cast<std::uint64_t>(width));
  out.u16(0);
  for (const float q : t.quality) out.f32(q);
  for (const std::uint64_t v : t.total_bytes) out.number(v, width);
  return out.finish();
}

void read_predictors(BytesIn& in, PlaneThesis& t) {
  const std::uint32_t fragments = in.u32();
  if (fragments == 0 || fragments > kMostFragments || in.left() < std::uint64_t{fragments} * 10)
    in.fail("five predictors of 1 to 65535 fragments", std::to_string(fragments));
  for (const auto predictor : predictors())
    for (std::uint32_t f = 0; f < fragments; ++f) (t.*predictor).push_back(from_unit16(in.u16()));
}

void read_size_models(BytesIn& in, PlaneThesis& t) {
  const std::uint32_t fragments = in.u32();
  if (fragments == 0 || fragments > kMostFragments || in.left() < fragments * kModelBytes)
    in.fail("models of 1 to 65535 fragments", std::to_string(fragments));
  t.models.resize(fragments);
  for (const auto value : model_values())
    for (SizeModel& model : t.models) model.*value = in.f32();
}

void read_gamma_table(BytesIn& in, int minor, PlaneThesis& t) {
  const std::uint32_t scales = in.u8();
  const int width = in.u8();
  if (in.u16() != 0 && minor <= kFormatMinor) fail_by("W05", in, "2 zero bytes", "others");
  if (scales == 0 || scales > kMostChainScales || width < 1 || width > 8)
    in.fail("1 to 100 scales and a width of 1 to 8", std::to_string(scales) + ", " + std::to_string(width));
  for (std::uint32_t s = 0; s < scales; ++s) t.quality.push_back(in.f32());
  for (std::size_t k = 0; k < scales * kGammaSteps; ++k) t.total_bytes.push_back(in.number(width));
  if (width != bytes_width(t.total_bytes)) in.fail("the least width that holds the values", "another");
}

void read_package_section(const ThesisSection& section, int minor, ThesisTables& tables) {
  if (section.plane != kWholePackage)
    fail_thesis("perceptual table", "one of the package", "plane " + std::to_string(section.plane));
  BytesIn in(section.bytes, kThesisFile + ": perceptual table");
  tables.perceptual = read_perceptual_section(in, minor <= kFormatMinor);
  if (minor <= kFormatMinor) in.finish();
}

void read_plane_section(const ThesisSection& section, int minor, ThesisTables& tables) {
  const std::string place = "plane " + std::to_string(section.plane) + ", ";
  if (section.plane >= kMaxPackagePlanes)
    throw RuleError("R16", kThesisFile, "section " + std::to_string(section.id), "a plane",
                    std::to_string(section.plane));
  if (tables.planes.size() <= section.plane) tables.planes.resize(section.plane + std::size_t{1});
  PlaneThesis& plane = tables.planes[section.plane];
  BytesIn in(section.bytes, kThesisFile + ": " + place + "section " + std::to_string(section.id));
  if (section.id == kPredictorsId) read_predictors(in, plane);
  if (section.id == kSizeModelId) read_size_models(in, plane);
  if (section.id == kGammaTableId) read_gamma_table(in, minor, plane);
  if (minor <= kFormatMinor) in.finish();
}

}  // namespace

Bytes write_perceptual_section(const PerceptualTable& t) {
  check_perceptual_table(t);
  BytesOut out;
  out.u8(t.scale.size());
  out.u8(0);
  out.u16(0);
  out.raw(t.scale);
  for (const std::uint32_t v : t.triangles) out.u32(v);
  for (const std::uint32_t v : t.collapses) out.u32(v);
  for (const auto& group : {kStepValues, kPairValues})
    for (const Values values : group)
      for (const float v : t.*values) out.f32(v);
  return out.finish();
}

PerceptualTable read_perceptual_section(BytesIn& in, bool reserved_is_zero) {
  PerceptualTable t;
  const std::size_t rows = in.u8(), pairs = pair_count(rows);
  if (in.number(3) != 0 && reserved_is_zero) fail_by("W05", in, "3 zero bytes", "others");
  if (rows == 0 || rows > kMostChainScales || in.left() < rows * kBytesOfRow + pairs * kBytesOfPair)
    in.fail("a table of 1 to 100 scales", std::to_string(rows));
  const ByteSpan scale = in.raw(rows);
  t.scale.assign(scale.begin(), scale.end());
  for (std::size_t k = 0; k < rows; ++k) t.triangles.push_back(in.u32());
  for (std::size_t k = 0; k < rows; ++k) t.collapses.push_back(in.u32());
  for (const Values values : kStepValues)
    for (std::size_t k = 0; k < rows; ++k) (t.*values).push_back(in.f32());
  for (const Values values : kPairValues)
    for (std::size_t k = 0; k < pairs; ++k) (t.*values).push_back(in.f32());
  check_perceptual_table(t);
  return t;
}

std::vector<std::uint8_t> write_thesis(const ThesisTables& tables, int minor) {
  std::vector<ThesisSection> sections;
  for (std::uint32_t p = 0; p < tables.planes.size(); ++p) {
    const PlaneThesis& t = tables.planes[p];
    check_thesis_plane(t, kPredictorRounding, "plane " + std::to_string(p) + ", ");
    if (!t.z.empty()) sections.push_back({kPredictorsId, p, predictors_section(t)});
    if (!t.models.empty()) sections.push_back({kSizeModelId, p, size_model_section(t)});
    if (!t.quality.empty()) sections.push_back({kGammaTableId, p, gamma_table_section(t)});
  }
  if (!tables.perceptual.empty())
    sections.push_back({kPerceptualTableId, kWholePackage, write_perceptual_section(tables.perceptual)});
  std::ranges::sort(sections, {}, [](const ThesisSection& s) { return std::tuple(s.id, s.plane); });
  BytesOut head, data;
  write_entry_start(head, kThesisMagic, minor);
  head.u32(sections.size());
  head.u32(0);
  for (const ThesisSection& s : sections) {
    head.u32(s.id);
    head.u32(s.plane);
    head.u32(s.bytes.size());
    data.raw(s.bytes);
  }
  head.raw(data.finish());
  return head.finish();
}

static ThesisFile read_sections(ByteSpan bytes) {
  BytesIn in(bytes, kThesisFile);
  ThesisFile file;
  file.minor = read_entry_start(in, kThesisMagic, "O04");
  const std::uint64_t count = in.u32();
  if (in.u32() != 0 && file.minor <= kFormatMinor) fail_by("W05", in, "4 zero bytes", "others");
  if (count > in.left() / kSectionRecord)
    in.fail("a section count that fits the file", std::to_string(count));
  BytesIn data(bytes, kThesisFile);
  data.raw(in.at() + count * kSectionRecord);
  std::tuple<std::uint32_t, std::uint32_t> last;
  for (std::uint64_t k = 0; k < count; ++k) {
    ThesisSection section{in.u32(), in.u32(), {}};
    const std::tuple now(section.id, section.plane);
    if (section.id == 0 || (k > 0 && now <= last)) in.fail("sections by id and plane", "another order");
    last = now;
    const ByteSpan part = data.raw(in.u32());
    if (section.id > kPerceptualTableId) continue;
    section.bytes.assign(part.begin(), part.end());
    under_rule("O05", [&] {
      const auto read = section.id == kPerceptualTableId ? read_package_section : read_plane_section;
      read(section, file.minor, file.tables);
    });
  }
  data.finish();
  for (std::size_t p = 0; p < file.tables.planes.size(); ++p)
    check_thesis_plane(file.tables.planes[p], 0, "plane " + std::to_string(p) + ", ");
  return file;
}

ThesisFile read_thesis(std::span<const std::uint8_t> bytes) {
  return under_rule("O04", [&] { return read_sections(bytes); });
}

}  // namespace texmesh
