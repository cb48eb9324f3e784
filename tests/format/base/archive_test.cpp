#include "format/base/archive.h"

#include <gtest/gtest.h>

namespace texmesh::archive_test {

struct Inner {
  std::uint32_t a = 0;
  std::string text;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.a, s.text);
  }
};
struct Outer {
  std::vector<Inner> inner;
  std::vector<std::uint64_t> numbers;
  bool flag = false;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.inner, s.numbers, s.flag);
  }
};

Outer outer(std::size_t inner, std::size_t numbers) {
  Outer o;
  for (std::size_t i = 0; i < inner; ++i)
    o.inner.push_back({static_cast<std::uint32_t>(i), std::string(i % 7, 'x')});
  for (std::size_t i = 0; i < numbers; ++i) o.numbers.push_back(i * i);
  o.flag = inner % 2 == 1;
  return o;
}

TEST(Archive, DigestIsThatOfTheBytes) {
  // Pieces of some bytes, pieces of more than the stream collects, and both about where it hands them on.
  for (const auto& [inner, numbers] : {std::pair<std::size_t, std::size_t>{0, 0},
                                       {1, 1},
                                       {5000, 8192},
                                       {5041, 8191},
                                       {3, 100'000},
                                       {9000, 3}}) {
    const Outer o = outer(inner, numbers);
    const std::vector<std::uint8_t> bytes = encode_artefact(o);
    const ArtefactDigest digest = digest_artefact(o);
    EXPECT_EQ(digest.digest, sha256(bytes)) << inner << " " << numbers;
    EXPECT_EQ(digest.bytes, bytes.size());
  }
}

TEST(Archive, EncodingTakesNoMoreMemoryThanTheBytes) {
  const std::vector<std::uint8_t> bytes = encode_artefact(outer(1000, 1000));
  EXPECT_EQ(bytes.capacity(), bytes.size());
}

TEST(Archive, DecodedAgain) {
  const Outer o = outer(11, 4), again = decode_artefact<Outer>(encode_artefact(o), "outer");
  ASSERT_EQ(again.inner.size(), 11u);
  EXPECT_EQ(again.inner[6].text, "xxxxxx");
  EXPECT_EQ(again.numbers, o.numbers);
  EXPECT_TRUE(again.flag);
}

}  // namespace texmesh::archive_test
