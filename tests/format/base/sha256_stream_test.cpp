#include "format/base/sha256.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace texmesh::sha256_stream_test {

std::vector<std::uint8_t> made_bytes(std::size_t size) {
  std::vector<std::uint8_t> out;
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < size; ++i)
    out.push_back(static_cast<std::uint8_t>((state = state * 1664525u + 1013904223u) >> 24));
  return out;
}

std::string digest_of(std::string_view text) {
  return to_hex(sha256({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
}

/// FIPS 180-2, appendix B, and the empty text.
TEST(Sha256, AsPublished) {
  EXPECT_EQ(digest_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(digest_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(digest_of(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, PiecesOfAnySize) {
  for (std::size_t size = 0; size < 300; ++size) {
    const std::vector<std::uint8_t> bytes = made_bytes(size);
    for (const std::size_t piece : {1u, 3u, 55u, 64u, 65u, 200u}) {
      Sha256Stream stream;
      for (std::size_t at = 0; at < size; at += piece)
        stream.add(std::span(bytes).subspan(at, std::min(piece, size - at)));
      EXPECT_EQ(stream.bytes(), size);
      EXPECT_EQ(stream.finish(), sha256(bytes)) << size << " bytes by " << piece;
    }
  }
}

}  // namespace texmesh::sha256_stream_test
