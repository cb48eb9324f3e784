#include "format/base/json_fields.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"

namespace texmesh::json_fields_test {

nlohmann::json parse(const std::string& text) {
  return parse_json(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), "x.json",
                    1 << 25);
}

TEST(ParseJson, ANameThatAnObjectHasTwiceIsRefused) {
  EXPECT_THROW(parse(R"({"a":1,"a":1})"), FormatError);
  EXPECT_THROW(parse(R"([{"b":{"a":1,"c":[{}],"a":2}}])"), FormatError);
  EXPECT_EQ(parse(R"({"a":{"a":1},"b":[{"a":1},{"a":2}]})").size(), 2u);
}

TEST(ParseJson, SaysWhereASyntaxErrorIs) {
  for (const char* text : {R"({"a":1}})", R"({"a":)", "", "{]", "{\"a\":\"\xff\"}"})
    EXPECT_THROW(parse(text), FormatError);
  try {
    parse(R"({"a":1}})");
  } catch (const FormatError& e) {
    EXPECT_EQ(e.place(), "byte 8");
  }
  EXPECT_THROW(parse(R"({"a":1e999})"), FormatError);
}

TEST(ParseJson, ManySmallObjectsTakeLinearTime) {  // in square time this would be hours
  std::string text = R"({"all":[{})";
  for (int i = 1; i < 500'000; ++i) text += ",{}";
  EXPECT_EQ(parse(text + "]}")["all"].size(), 500'000u);
}

}  // namespace texmesh::json_fields_test
