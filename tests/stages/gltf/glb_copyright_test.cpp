#include "stages/gltf/glb_container.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/base/errors.h"

namespace texmesh::glb_copyright_test {

TEST(GlbCopyright, OnlyTheAssetChanges) {
  const Bytes binary{1, 2, 3, 4, 5};
  const Bytes glb = glb_container(R"({"asset":{"version":"2.0","generator":"t"},"z":1,"a":0.1})", binary);
  EXPECT_EQ(with_copyright(glb, ""), glb);
  const Bytes padded{1, 2, 3, 4, 5, 0, 0, 0};
  EXPECT_EQ(
      with_copyright(glb, "A \"B\""),
      glb_container(R"({"asset":{"version":"2.0","generator":"t","copyright":"A \"B\""},"z":1,"a":0.1})",
                    padded));
  EXPECT_EQ(with_copyright(with_copyright(glb, "old"), "new"), with_copyright(glb, "new"));
}

TEST(GlbCopyright, EveryTruncationIsTold) {
  const Bytes glb = glb_container(R"({"asset":{"version":"2.0"}})", Bytes{1, 2, 3, 4});
  for (std::size_t n = 0; n < glb.size(); ++n) {
    const std::size_t json_end = 12 + 8 + 28;
    if (n == json_end) continue;  // a GLB without a binary chunk
    EXPECT_THROW(with_copyright(Bytes(glb.begin(), glb.begin() + static_cast<std::ptrdiff_t>(n)), "A"),
                 FormatError)
        << n;
  }
  EXPECT_THROW(with_copyright(glb_container(R"({"asset":3})", {}), "A"), FormatError);
  EXPECT_THROW(with_copyright(glb_container("[]", {}), "A"), FormatError);
}

}  // namespace texmesh::glb_copyright_test
