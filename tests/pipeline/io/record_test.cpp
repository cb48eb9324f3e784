#include "pipeline/io/record.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"

namespace texmesh::record_test {

enum class Fruit : std::uint8_t { kApple, kPear };

}  // namespace texmesh::record_test

template <>
struct texmesh::EnumNames<texmesh::record_test::Fruit> {
  static constexpr std::array<std::string_view, 2> names{"apple", "pear"};
};

namespace texmesh::record_test {

struct Inner {
  int count = 0;
  friend bool operator==(const Inner&, const Inner&) = default;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("count", s.count, Range{-3, 9}, "how many");
  }
};

struct Outer {
  std::string name, note, path;
  bool is_set = false;
  std::uint64_t bytes = 0;
  double seconds = 0;
  Fruit fruit = Fruit::kApple;
  Sha256 digest{};
  std::vector<Inner> inner;
  std::optional<Inner> one;
  std::map<std::string, int> by_name;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("version", Constant{1}, "");
    v("name", s.name, Range{1, 10}, "its name");
    v("note", s.note, FieldRule{.words = "a|b", .may_miss = true}, "");
    v("path", s.path, kNamesFile, "");
    v("is_set", s.is_set, "");
    v("bytes", s.bytes, "");
    v("seconds", s.seconds, kSeconds, "");
    v("fruit", s.fruit, "");
    v("digest", s.digest, "");
    v("inner", s.inner, FieldRule{.count = Range{0, 2}}, "");
    v("one", s.one, "");
    v("by_name", s.by_name, "");
  }
};

Outer example() {
  Outer o;
  o.name = "n";
  o.path = "\xff";
  o.is_set = true;
  o.bytes = 1ull << 60;
  o.seconds = .25;
  o.fruit = Fruit::kPear;
  o.digest[0] = 7;
  o.inner = {{1}, {-3}};
  o.by_name = {{"x", 4}};
  return o;
}

std::string fault_of(const Json& json, bool refuse_others = false) {
  try {
    from_json<Outer>(json, "f", refuse_others);
  } catch (const InputError& e) {
    return e.place() + ": " + e.expected() + ", " + e.found();
  }
  return "none";
}

TEST(Record, ComesBackFromItsJson) {
  Outer o = example();
  const Json json = to_json(o);
  EXPECT_FALSE(json.contains("note"));
  EXPECT_FALSE(json.contains("one"));
  EXPECT_EQ(json["version"], 1);
  EXPECT_EQ(json["fruit"], "pear");
  const Outer again = from_json<Outer>(Json::parse(to_json_line(o)), "f", true);
  EXPECT_EQ(to_json(again), json);
  EXPECT_EQ(again.path, "\xff");
  EXPECT_EQ(again.inner, o.inner);
  o.one = Inner{2};
  o.note = "b";
  EXPECT_EQ(from_json<Outer>(to_json(o), "f").one->count, 2);
  EXPECT_EQ(from_json<Outer>(to_json(o), "f").note, "b");
}

TEST(Record, SaysWhatIsWrongAndWhere) {
  const auto with = [](const char* pointer, const Json& value) {
    Json json = to_json(example());
    json[Json::json_pointer(pointer)] = value;
    return json;
  };
  EXPECT_EQ(fault_of(with("/inner/1/count", 10)), "/inner/1/count: an integer in -3 .. 9, 10");
  EXPECT_EQ(fault_of(with("/inner/1/count", 1.5)), "/inner/1/count: an integer in -3 .. 9, 1.5");
  EXPECT_EQ(fault_of(with("/inner/1", 3)), "/inner/1: an object, 3");
  EXPECT_EQ(fault_of(with("/inner", Json::array({1, 2, 3}))), "/inner: a list of 0 to 2 values, [1,2,3]");
  EXPECT_EQ(fault_of(with("/fruit", "plum")), "/fruit: one of apple, pear, \"plum\"");
  EXPECT_EQ(fault_of(with("/note", "c")), "/note: one of a, b, \"c\"");
  EXPECT_EQ(fault_of(with("/name", "")), "/name: a text of at least 1 bytes, \"\"");
  EXPECT_EQ(fault_of(with("/name", "01234567890")), "/name: a text of at most 10 bytes, \"01234567890\"");
  EXPECT_EQ(fault_of(with("/bytes", -1)), "/bytes: a whole number from 0, -1");
  EXPECT_EQ(fault_of(with("/seconds", -1)), "/seconds: a number in 0 .. 1000000000, -1");
  EXPECT_EQ(fault_of(with("/is_set", 1)), "/is_set: true or false, 1");
  EXPECT_EQ(fault_of(with("/digest", "00")), "/digest: 64 hexadecimal digits, \"00\"");
  EXPECT_EQ(fault_of(with("/version", 2)), "/version: 1, 2");
  EXPECT_EQ(fault_of(with("/by_name/x", "y")), "/by_name/x: a whole number, \"y\"");
  EXPECT_EQ(fault_of(with("/other", 1)), "none");
  EXPECT_EQ(fault_of(with("/other", 1), true), "/other: a known field, \"other\"");
  Json missing = to_json(example());
  missing.erase("bytes");
  EXPECT_EQ(fault_of(missing), "/bytes: a value, nothing");
  EXPECT_EQ(fault_of(3), ": an object, 3");
}

TEST(Record, ASyntaxErrorHasItsLineAndColumn) {
  const std::string text = "{\n  \"a\": 1,\n  \"b\" 2\n}\n";
  try {
    parse_document({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, 1000, 8, "a.json");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.place(), "line 3, column 7");
  }
}

TEST(Record, ANameTwiceIsRefused) {
  const auto found = [](const std::string& text) -> std::string {
    try {
      parse_document(text_bytes(text), 1000, 8, "a.json");
    } catch (const InputError& e) {
      return e.found();
    }
    return "read";
  };
  EXPECT_EQ(found(R"({"a":[{},[],{"b":"{,","c":[{}]}],"b":1})"), "read");
  EXPECT_EQ(found(R"({"a":[{"b":1,"c":2,"b":3}]})"), "\"b\" twice");
}

TEST(Record, HasASchema) {
  const Json schema = schema_of<Outer>();
  EXPECT_EQ(schema["required"], Json({"version", "name", "path", "is_set", "bytes", "seconds", "fruit",
                                      "digest", "inner", "by_name"}));
  const Json& p = schema["properties"];
  EXPECT_EQ(p["version"], Json({{"const", 1}}));
  EXPECT_EQ(p["name"].dump(), R"({"type":"string","minLength":1,"maxLength":10,"description":"its name"})");
  EXPECT_EQ(p["note"].dump(), R"({"enum":["a","b"]})");
  EXPECT_EQ(p["bytes"].dump(), R"({"type":"integer","minimum":0})");
  EXPECT_EQ(p["fruit"].dump(), R"({"enum":["apple","pear"]})");
  EXPECT_EQ(p["inner"]["maxItems"], 2);
  EXPECT_EQ(p["inner"]["items"]["properties"]["count"]["minimum"], -3);
  EXPECT_EQ(p["by_name"].dump(), R"({"type":"object","additionalProperties":{"type":"integer"}})");
}

TEST(Record, NotesHaveOneForm) {
  const Note note{Severity::kWarning, "missing-texture", "/a", "no such file"};
  EXPECT_EQ(to_json_line(note),
            R"({"severity":"warning","code":"missing-texture","place":"/a","text":"no such file"})");
  EXPECT_EQ(from_json<Note>(to_json(note), "f"), note);
}

}  // namespace texmesh::record_test
