#pragma once
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "lab/thesis/exhibits.h"

namespace texmesh::testing {

inline const Exhibit& exhibit_of(const std::vector<Exhibit>& exhibits, const std::string& id) {
  for (const Exhibit& e : exhibits)
    if (e.id == id) return e;
  throw std::out_of_range(id);
}
/// A number of an exhibit's table.
inline double number_at(const Exhibit& e, std::size_t table, std::size_t row, std::size_t column) {
  return std::visit(
      [](const auto& value) -> double {
        if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) return static_cast<double>(value);
        throw std::bad_variant_access();
      },
      e.tables.at(table).rows.at(row).at(column).value);
}
/// Every row has the table's columns, and every text is there.
inline void expect_sound(const std::vector<Exhibit>& exhibits) {
  for (const Exhibit& e : exhibits) {
    EXPECT_FALSE(e.title.empty() || e.claim.empty() || e.made_by.empty() || e.finding.empty()) << e.id;
    EXPECT_FALSE(e.tables.empty()) << e.id;
    for (const Table& t : e.tables)
      for (const auto& row : t.rows) EXPECT_EQ(row.size(), t.columns.size()) << e.id << " " << t.caption;
  }
}

}  // namespace texmesh::testing
