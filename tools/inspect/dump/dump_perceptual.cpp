#include <fmt/format.h>

#include "format/rules/jnd_choice.h"
#include "pipeline/io/table.h"
#include "tools/inspect/dump/dump_parts.h"

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

/// Every step from scale to scale. The first row, S_0, follows no other.
Table table_7_1(const PerceptualTable& t) {
  Table table("change of the distance to the skeleton from scale to scale, over collapses (Table 7.1)",
              {{"scales", 0, "scale"},
               {"triangles", kGrouped, "triangles"},
               {"collapses", kGrouped, "collapses"},
               {"average", 4, "average"},
               {"deviation", 4, "deviation"},
               {"largest", 4, "largest"},
               {"least", 4, "least"}});
  for (std::size_t k = 0; k < t.scale.size(); ++k)
    table.row({{t.scale[k], fmt::format("{}-{}", t.scale[k > 0 ? k - 1 : 0], t.scale[k])},
               t.triangles[k],
               t.collapses[k],
               t.average[k],
               t.deviation[k],
               t.largest[k],
               t.least[k]});
  return table;
}

Table table_7_2(const PerceptualTable& t, const std::vector<Comparison>& comparisons) {
  Table table(
      "cumulative values from S_0 (Table 7.2); of collapses: the root of the sum of squares, and against\n"
      "the vertex that is left (survivor); --json has all pairs",
      {"from", "to"});
  for (const Comparison& c : comparisons) table.column({c.name, 4});
  for (std::size_t j = 1; j < t.scale.size(); ++j) {
    table.row({0, t.scale[j]});
    for (const Comparison& c : comparisons) table.rows.back().emplace_back(c.value[j]);
  }
  return table;
}

Table pairs_of(const PerceptualTable& t, const Comparison& c) {
  Table table(c.name, {{"from", 0, "from"}, {"to", 0, "to"}, {"value", 4, "value"}});
  const std::size_t rows = t.scale.size();
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = i + 1; j < rows; ++j) table.row({t.scale[i], t.scale[j], c.value[i * rows + j]});
  return table;
}

}  // namespace

std::string perceptual_text(PackageReader& package, DumpGamma) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t || t->scale.size() < 2) return "no perceptual table\n";
  const std::vector<Comparison> comparisons = comparisons_of(*t);
  const double jnd = package.manifest().jnd;
  Table steps = table_7_1(*t);
  steps.rows.erase(steps.rows.begin());
  Table majors("major scales at JND " + shortest(jnd), {Column::text("by"), Column::text("major scales")});
  for (const Comparison& c : comparisons)
    majors.row({c.name, fmt::format("{}", fmt::join(majors_of(*t, c, jnd), " "))});
  return steps.text() + "\n" + table_7_2(*t, comparisons).text() + "\n" + majors.text();
}

Json perceptual_json(PackageReader& package, DumpGamma) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t) return {{"perceptual", nullptr}};
  const double jnd = package.manifest().jnd;
  Json values = Json::array();
  for (const Comparison& c : comparisons_of(*t))
    values.push_back({{"by", c.name}, {"major", majors_of(*t, c, jnd)}, {"pairs", pairs_of(*t, c).json()}});
  return {{"perceptual", {{"jnd", jnd}, {"steps", table_7_1(*t).json()}, {"values", values}}}};
}

}  // namespace texmesh
