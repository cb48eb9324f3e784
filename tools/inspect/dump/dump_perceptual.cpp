#include "tools/inspect/dump/dump_perceptual.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/rules/jnd_choice.h"
#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// A way to compare scales, and its values for all pairs.
struct Comparison {
  std::string name;
  std::vector<float> value;
};

std::vector<Comparison> comparisons_of(const PerceptualTable& t) {
  std::vector<Comparison> out{{"p95", pair_values(t, PerceptualStatistic::kP95)}};
  for (const PerceptualStatistic s : {PerceptualStatistic::kAverage, PerceptualStatistic::kConservative,
                                      PerceptualStatistic::kAggressive}) {
    out.push_back({std::string(enum_name(s)), pair_values(t, s)});
    out.push_back({std::string(enum_name(s)) + ", survivor", pair_values(t, s, ChainRule::kSurvivor)});
  }
  return out;
}

std::vector<int> majors_of(const PerceptualTable& t, const Comparison& c, double jnd) {
  std::vector<int> out;
  const std::vector<std::uint8_t> major = major_rows(c.value, t.scale.size(), jnd);
  for (std::size_t k = 0; k < major.size(); ++k)
    if (major[k]) out.push_back(t.scale[k]);
  return out;
}

std::string value_text(float v) { return fixed(static_cast<double>(v), 4); }

std::string table_7_1(const PerceptualTable& t) {
  TextTable table;
  for (const char* header : {"scales", "triangles", "collapses", "average", "deviation", "largest", "least"})
    table.column(header);
  for (std::size_t k = 1; k < t.scale.size(); ++k)
    table.row({fmt::format("{}-{}", t.scale[k - 1], t.scale[k]), grouped(t.triangles[k]),
               grouped(t.collapses[k]), value_text(t.average[k]), value_text(t.deviation[k]),
               value_text(t.largest[k]), value_text(t.least[k])});
  return table.text();
}

std::string table_7_2(const PerceptualTable& t, const std::vector<Comparison>& comparisons) {
  TextTable table;
  table.column("from");
  table.column("to");
  for (const Comparison& c : comparisons) table.column(c.name);
  for (std::size_t j = 1; j < t.scale.size(); ++j) {
    std::vector<std::string> row{"0", std::to_string(t.scale[j])};
    for (const Comparison& c : comparisons) row.push_back(value_text(c.value[j]));
    table.row(std::move(row));
  }
  return table.text();
}

std::string majors_text(const PerceptualTable& t, const std::vector<Comparison>& comparisons, double jnd) {
  TextTable table;
  table.column("by", Align::kLeft);
  table.column("major scales", Align::kLeft);
  for (const Comparison& c : comparisons)
    table.row({c.name, fmt::format("{}", fmt::join(majors_of(t, c, jnd), " "))});
  return table.text();
}

}  // namespace

std::string perceptual_text(PackageReader& package) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t || t->scale.size() < 2) return "no perceptual table\n";
  const std::vector<Comparison> comparisons = comparisons_of(*t);
  const double jnd = package.manifest().jnd;
  return "change of the distance to the skeleton from scale to scale, over collapses (Table 7.1)\n" +
         table_7_1(*t) +
         "\ncumulative values from S_0 (Table 7.2); of collapses: the root of the sum of squares, and against\n"
         "the vertex that is left (survivor); --json has all pairs\n" +
         table_7_2(*t, comparisons) + fmt::format("\nmajor scales at JND {}\n", shortest(jnd)) +
         majors_text(*t, comparisons, jnd);
}

Json perceptual_json(PackageReader& package) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t) return {{"perceptual", nullptr}};
  const double jnd = package.manifest().jnd;
  const std::size_t rows = t->scale.size();
  Json steps = Json::array(), values = Json::array();
  for (std::size_t k = 0; k < rows; ++k)
    steps.push_back({{"scale", t->scale[k]},
                     {"triangles", t->triangles[k]},
                     {"collapses", t->collapses[k]},
                     {"average", t->average[k]},
                     {"deviation", t->deviation[k]},
                     {"largest", t->largest[k]},
                     {"least", t->least[k]}});
  for (const Comparison& c : comparisons_of(*t)) {
    Json pairs = Json::array();
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t j = i + 1; j < rows; ++j)
        pairs.push_back({{"from", t->scale[i]}, {"to", t->scale[j]}, {"value", c.value[i * rows + j]}});
    values.push_back({{"by", c.name}, {"major", majors_of(*t, c, jnd)}, {"pairs", pairs}});
  }
  return {{"perceptual", {{"jnd", jnd}, {"steps", steps}, {"values", values}}}};
}

}  // namespace texmesh
