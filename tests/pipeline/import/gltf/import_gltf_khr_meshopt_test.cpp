// KHR_meshopt_compression: the structure of EXT_meshopt_compression, version 1 of attribute streams, and the
// filter of colours. The streams here were written by meshoptimizer 1.3 (encodeVertexBufferLevel) from values
// that the tests make by the same formulas.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cstring>

#include "pipeline/import/gltf/import_gltf_parts.h"
#include "stages/gltf/decode_meshopt.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/meshes.h"

namespace texmesh::import_gltf_khr_meshopt_test {

using nlohmann::json;
using testing::GltfBuilder;
using testing::MemoryResolver;
using testing::quad;

Bytes bytes_of(std::string_view hex) {
  Bytes out;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    out.push_back(static_cast<std::uint8_t>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  return out;
}

constexpr std::size_t kCount = 40, kStride = 12;

/// A rising float, two shorts of which one stays, four bytes that rise by more and more.
Bytes mixed_values() {
  Bytes out(kCount * kStride);
  for (std::size_t i = 0; i < kCount; ++i) {
    const float f = 0.25f * static_cast<float>(i);
    const std::uint16_t shorts[2] = {static_cast<std::uint16_t>(300 * i), 7};
    std::memcpy(&out[kStride * i], &f, 4);
    std::memcpy(&out[kStride * i + 4], shorts, 4);
    for (std::size_t j = 0; j < 4; ++j) out[kStride * i + 8 + j] = static_cast<std::uint8_t>(i * i * (j + 1));
  }
  return out;
}

/// All modes: differences of bytes and of shorts, exclusive or of words; packed, plain and zero bytes.
Bytes mixed_stream() {
  return bytes_of(
      "a168a7ff0102010f1f1a0ffff8f8f4c4f4c4a060103018f81cf262e262f262e2623c1edddd00007e0307030058"
      "5858585858585858585858585858585858585858585858585858585858585858585858585858152aaaaaaaaaaa"
      "aaaaaaaa00000002060a0e12161a1e22262a2e32363a3e42464a4e52565a5e62666a6e72767a7e82868a8e9296"
      "9a00040c141c242c343c444c545c646c747c848c949ca4acb4bcc4ccd4dce4ecf4fcfbf3ebe3dbd3cb0006121e"
      "2a36424e5a66727e8a96a2aebac6d2deeaf6fdf1e5d9cdc1b5a99d9185796d6155493d31000818283848586878"
      "8898a8b8c8d8e8f8f7e7d7c7b7a797877767574737271707081828384858680000000000000000000000000000"
      "00070000000000620100");
}

Bytes decoded(ByteSpan data, std::size_t count, std::size_t stride,
              MeshoptFilter filter = MeshoptFilter::kNone) {
  return decode_meshopt({data, count, stride, MeshoptMode::kAttributes, filter},
                        [](const std::string& expected, const std::string& found) {
                          throw InputError("m", "", expected, found);
                        });
}

TEST(ImportGltfKhrMeshopt, ReadsVersion1OfAttributes) {
  EXPECT_EQ(decoded(mixed_stream(), kCount, kStride), mixed_values());
}

TEST(ImportGltfKhrMeshopt, UndoesTheColourFilter) {
  struct Case {
    std::size_t stride;
    const char *stream, *colours;
  };
  // Red and opaque; green and half; four different values; white and clear: of 8, 6 and 12 bits.
  const Case cases[] = {
      {4, "a1ff007e31cd00fd65660083fd00007d4ccb00000000000000000000000000000000000000407fc1ff00",
       "fe0100ff00fe0080336699ccffffff00"},
      {4, "a1ff001e094a003d1718005c3d00001d123100000000000000000000000000000000000000101ff13f00",
       "fb0400ff00fb008239699aceffffff00"},
      {8,
       "a1ffff0001cecd0006011200026566000d07080003020000160d000002cccb0005040b00000000000000000000000000000004ff"
       "0701fcff0f0000",
       "efff10000000ffff0000efff00000880333366669999ccccffffffffffff0000"},
  };
  for (const Case& c : cases)
    EXPECT_EQ(decoded(bytes_of(c.stream), 4, c.stride, MeshoptFilter::kColour), bytes_of(c.colours))
        << c.stream;
}

TEST(ImportGltfKhrMeshopt, BrokenStreamsAreRefusedAndNeverMoreThanThat) {
  const Bytes good = mixed_stream();
  for (std::size_t n = 0; n < good.size(); ++n)
    EXPECT_THROW(decoded(ByteSpan(good).first(n), kCount, kStride), InputError) << n;
  Bytes longer = good;
  longer.insert(longer.begin() + 1, 0);
  EXPECT_THROW(decoded(longer, kCount, kStride), InputError);
  Bytes mode = good;
  mode.back() = 3;
  EXPECT_THROW(decoded(mode, kCount, kStride), InputError);
  EXPECT_THROW(decoded(good, kCount + 1000000, kStride), InputError);
  EXPECT_THROW(decoded(good, kCount, 6, MeshoptFilter::kColour), InputError);
  for (std::size_t at = 1; at < good.size(); ++at)
    for (const int bit : {0, 3, 7}) {
      Bytes damaged = good;
      damaged[at] ^= static_cast<std::uint8_t>(1 << bit);
      try {
        EXPECT_EQ(decoded(damaged, kCount, kStride).size(), kCount * kStride);
      } catch (const InputError&) {  // that, too
      }
    }
}

/// A quad whose positions are compressed under these names.
GltfBuilder compressed_quad(const std::vector<std::string>& names) {
  GltfBuilder b = quad();
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  Bytes data(meshopt_encodeVertexBufferBound(4, 12));
  data.resize(meshopt_encodeVertexBuffer(data.data(), data.size(), positions.data(), 4, 12));
  const json encoded = b.json["bufferViews"][static_cast<std::size_t>(b.view_of(data))];
  json& v = b.json["bufferViews"][0];
  v = {{"buffer", 1}, {"byteLength", 48}};
  for (const std::string& name : names)
    v["extensions"][name] = {{"buffer", 0},
                             {"byteOffset", encoded["byteOffset"]},
                             {"byteLength", data.size()},
                             {"byteStride", 12},
                             {"count", 4},
                             {"mode", "ATTRIBUTES"}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = names;
  b.json["buffers"] = {{{"byteLength", b.bin.size()}},
                       {{"byteLength", 48}, {"extensions", {{names[0], {{"fallback", true}}}}}}};
  return b;
}

TEST(ImportGltfKhrMeshopt, IsReadWhereverExtIs) {
  const auto import = [](const GltfBuilder& b) {
    MemoryResolver resolver;
    return import_gltf("m.glb", b.glb(), resolver, {}, {}).model.mesh;
  };
  EXPECT_EQ(import(compressed_quad({"KHR_meshopt_compression"})),
            import(compressed_quad({"EXT_meshopt_compression"})));
  EXPECT_EQ(import(compressed_quad({"KHR_meshopt_compression"})).positions, import(quad()).positions);
  EXPECT_THROW(import(compressed_quad({"EXT_meshopt_compression", "KHR_meshopt_compression"})), InputError);
  GltfBuilder b = compressed_quad({"EXT_meshopt_compression"});
  b.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["filter"] = "COLOR";
  EXPECT_THROW(import(b), InputError);
}

}  // namespace texmesh::import_gltf_khr_meshopt_test
