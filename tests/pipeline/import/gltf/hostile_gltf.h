#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <functional>

#include "tests/support/gltf_builder.h"
#include "tests/support/sanitizers.h"

namespace texmesh::testing {

inline constexpr double kMostSeconds = sanitizers_take(2.0);

inline std::string refusal(const Bytes& bytes, const ImportOptions& options = {}) {
  MemoryResolver resolver;
  const std::clock_t start = std::clock();  // processor time: other tests may run beside this one
  std::string what;
  try {
    import_gltf("m.gltf", bytes, resolver, options, {});
  } catch (const InputError& e) {
    what = e.what();
    EXPECT_EQ(e.file(), "m.gltf");
  }
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, kMostSeconds) << what;
  return what;
}
/// The message about a quad to which `change` did something.
inline std::string refusal(const std::function<void(nlohmann::json&)>& change) {
  GltfBuilder b = quad();
  b.json["buffers"] = {{{"byteLength", b.bin.size()}}};
  change(b.json);
  return refusal(b.glb());
}
inline void expect_refused(const std::string& message_part,
                           const std::function<void(nlohmann::json&)>& change) {
  const std::string what = refusal(change);
  EXPECT_NE(what.find(message_part), std::string::npos)
      << "\"" << what << "\" without \"" << message_part << "\"";
}
inline nlohmann::json& primitive(nlohmann::json& j) { return j["meshes"][0]["primitives"][0]; }

}  // namespace texmesh::testing
