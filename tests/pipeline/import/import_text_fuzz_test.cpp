// Replays the fuzz targets of OBJ and PLY over inputs made from words of the formats and from damaged good
// files.
#define LLVMFuzzerTestOneInput fuzz_ply
#include "tests/fuzz/ply_fuzz.cpp"
#undef LLVMFuzzerTestOneInput
#define LLVMFuzzerTestOneInput fuzz_obj
#include "tests/fuzz/obj_fuzz.cpp"
#undef LLVMFuzzerTestOneInput

#include <gtest/gtest.h>

#include "format/base/bytes.h"
#include "tests/support/meshes.h"

namespace {

using texmesh::Bytes;

using texmesh::testing::Random;
Bytes sentence(Random& random, const std::vector<std::string>& words, int length) {
  std::string s;
  for (int i = 0; i < length; ++i) {
    s += words[random.next() % words.size()];
    s += random.next() % 4 ? ' ' : '\n';
  }
  return {s.begin(), s.end()};
}

void damage(Random& random, Bytes& bytes) {
  for (std::uint32_t n = random.next() % 6; n > 0 && !bytes.empty(); --n) {
    const std::size_t at = random.next() % bytes.size();
    switch (random.next() % 4) {
      case 0:
        bytes[at] = static_cast<std::uint8_t>(random.next());
        break;
      case 1:
        bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      case 2:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes[random.next() % bytes.size()]);
        break;
      default:
        bytes.resize(at);
    }
  }
}

void replay(int (*target)(const std::uint8_t*, std::size_t), const std::vector<std::string>& words,
            const std::string& prefix, std::uint64_t seed) {
  Random random{seed};
  for (int i = 0; i < 4000; ++i) {
    Bytes bytes(prefix.begin(), prefix.end());
    const Bytes rest = sentence(random, words, static_cast<int>(random.next() % 60));
    bytes.insert(bytes.end(), rest.begin(), rest.end());
    if (i % 2) damage(random, bytes);
    EXPECT_EQ(target(bytes.data(), bytes.size()), 0);
  }
}

TEST(TextFuzz, Ply) {
  const std::vector<std::string> words{"element",
                                       "vertex",
                                       "face",
                                       "tristrips",
                                       "property",
                                       "list",
                                       "uchar",
                                       "int",
                                       "float",
                                       "double",
                                       "x",
                                       "y",
                                       "z",
                                       "s",
                                       "t",
                                       "red",
                                       "green",
                                       "blue",
                                       "vertex_indices",
                                       "texcoord",
                                       "texnumber",
                                       "comment TextureFile a",
                                       "end_header",
                                       "1",
                                       "2",
                                       "3",
                                       "0",
                                       "-1",
                                       "nan",
                                       "4000000000",
                                       "1e300",
                                       "6"};
  replay(fuzz_ply, words, "ply\nformat ascii 1.0\n", 1);
  replay(fuzz_ply, words,
         "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
         "y\nproperty float z\n",
         2);
  replay(fuzz_ply, {"0 ", "1 ", "2 ", "3 ", "6 ", "-1", "0.5", "nan"},
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
         "z\nelement face 2\n"
         "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n0 0 0\n1 0 "
         "0\n0 1 0\n",
         3);
}

TEST(TextFuzz, Obj) {
  using namespace std::string_literals;
  const std::vector<std::string> words{"v 0 0 0",     "v 1 0 0\n",
                                       "v 0 1 0\n",   "v 1 1 nan\n",
                                       "vt 0 1\n",    "vn 0 0 1\n",
                                       "f",           "1",
                                       "2",           "3",
                                       "-1",          "-2",
                                       "1/1",         "2/1/1",
                                       "3//1",        "1/",
                                       "/",           "usemtl",
                                       "m",           "mtllib a.mtl",
                                       "g",           "o",
                                       "\\\n",        "#",
                                       "99999999999", "\0newmtl m\nKd 1 0 0\nmap_Kd -s 1 1 a b.png\nTr 1\n"s};
  replay(fuzz_obj, words, "", 4);
  replay(fuzz_obj, words, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n", 5);
}

}  // namespace
