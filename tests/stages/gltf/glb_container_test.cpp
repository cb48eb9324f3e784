#include "stages/gltf/glb_container.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <string>

namespace texmesh::glb_container_test {

TEST(GlbContainer, BothChunksArePadded) {
  const Bytes glb = glb_container("{\"a\":1}", Bytes{1, 2, 3, 4, 5});
  const Bytes expected{'g', 'l', 'T', 'F', 2,   0,   0,   0,   44,  0,   0,   0,   8,   0, 0,
                       0,   'J', 'S', 'O', 'N', '{', '"', 'a', '"', ':', '1', '}', ' ', 8, 0,
                       0,   0,   'B', 'I', 'N', 0,   1,   2,   3,   4,   5,   0,   0,   0};
  EXPECT_EQ(glb, expected);
}

/// Addresses that no memory stands behind: whoever reads there dies.
struct NoMemory {
  explicit NoMemory(std::size_t size)
      : bytes(size),
        place(::mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0)) {}
  ~NoMemory() {
    if (place != MAP_FAILED) ::munmap(place, bytes);
  }
  NoMemory(const NoMemory&) = delete;
  NoMemory& operator=(const NoMemory&) = delete;
  ByteSpan span() const { return {static_cast<const std::uint8_t*>(place), bytes}; }
  std::size_t bytes;
  void* place;
};

TEST(GlbContainer, FourGigabytesAreRefused) {
  // Heads have 12 + 8 + 8 bytes, the JSON 4: 4 GiB in all, one step more than the lengths can say.
  const NoMemory least((std::size_t{1} << 32) - 32), more(std::size_t{5} << 30);
  for (const NoMemory* binary : {&least, &more}) {
    if (binary->place == MAP_FAILED) GTEST_SKIP() << "no address space of " << binary->bytes << " bytes";
    try {
      glb_container("{  }", binary->span());
      ADD_FAILURE() << binary->bytes << " bytes are written";
    } catch (const FormatError& error) {
      EXPECT_EQ(std::string(error.what()),
                "GLB: length: expected at most 4294967295 bytes, since lengths have 32 bits, found " +
                    std::to_string(binary->bytes + 32));
    }
  }
}

}  // namespace texmesh::glb_container_test
