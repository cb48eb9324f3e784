#include "pipeline/about/gltf_about.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace texmesh::gltf_about_test {

using nlohmann::json;
using nlohmann::ordered_json;

About about_of(const json& document, Notes* notes = nullptr) {
  Notes own;
  return about_from_gltf(document, "glb", notes ? *notes : own);
}

json document() {
  return json::parse(R"json({
    "asset":{"version":"2.0","copyright":"(c) the file","generator":"g",
             "extras":{"author":"of extras","title":"of extras","license":"CC-BY-4.0 (https://a.b/by)",
                       "deep":{"x":[1,2.5]}}},
    "extras":{"description":"of the root","unit":"mm"},
    "scene":1,"scenes":[{"extras":{"title":"of another scene"}},{"extras":{"capture":"of the scene"}}],
    "nodes":[{"extras":{"a":"\u0007"}},{}],
    "extensions":{"KHR_xmp_json_ld":{"packets":[{"dc:title":"of XMP"},{"dc:title":"of a node"}]}}})json");
}

TEST(GltfAbout, RisingPriority) {
  json d = document();
  About a = about_of(d);
  EXPECT_EQ(a.attribution, "(c) the file");
  EXPECT_EQ(a.creator, "of extras");
  EXPECT_EQ(a.title, "of extras");  // nothing refers to a packet
  EXPECT_EQ(a.licence, "CC-BY-4.0");
  EXPECT_EQ(a.licence_url, "https://a.b/by");
  EXPECT_EQ(a.description, "of the root");
  EXPECT_EQ(a.capture, "of the scene");
  d["asset"]["extensions"]["KHR_xmp_json_ld"]["packet"] = 0u;
  EXPECT_EQ(about_of(d).title, "of XMP");
  d["asset"].erase("extensions");
  d["scenes"][1]["extensions"]["KHR_xmp_json_ld"]["packet"] = 1u;
  EXPECT_EQ(about_of(d).title, "of a node");
  d["scenes"][1]["extensions"]["KHR_xmp_json_ld"]["packet"] = 7u;
  EXPECT_EQ(about_of(d).title, "of extras");
}

TEST(GltfAbout, UnitAndUpAreGltfsWhateverExtrasSay) {
  const About a = about_of(document());
  EXPECT_EQ(a.metres_per_unit, 1);
  EXPECT_EQ(a.unit, "metre");
  EXPECT_EQ(a.up_axis, "y");
}

TEST(GltfAbout, KeepsWhatTheSourceSaidVerbatim) {
  const json d = document();
  const json source = json::parse(about_of(d).source);
  EXPECT_EQ(source["format"], "glb");
  EXPECT_EQ(source["asset"], d["asset"]);
  EXPECT_EQ(source["xmpPackets"], d["extensions"]["KHR_xmp_json_ld"]["packets"]);
  const json expected = {{{"path", ""}, {"value", d["extras"]}},
                         {{"path", "/scenes/0"}, {"value", d["scenes"][0]["extras"]}},
                         {{"path", "/scenes/1"}, {"value", d["scenes"][1]["extras"]}},
                         {{"path", "/nodes/0"}, {"value", d["nodes"][0]["extras"]}}};
  EXPECT_EQ(source["extras"], expected);
  EXPECT_FALSE(source.contains("cut"));
}

TEST(GltfAbout, WhatDoesNotFitIsNamedAndCostsANote) {
  json d = document();
  d["asset"]["extras"]["long"] = std::string(70000, 'x');
  d["nodes"] = json::array();
  for (int i = 0; i < 100; ++i) d["nodes"].push_back({{"extras", std::string(3000, 'y')}});
  Notes notes;
  const About a = about_of(d, &notes);
  EXPECT_LE(a.source.size(), kMaxAboutSourceBytes);
  EXPECT_NO_THROW(write_about(a));
  const json source = json::parse(a.source);
  EXPECT_FALSE(source.contains("asset"));
  EXPECT_TRUE(source["cut"][0].get<std::string>().starts_with("/asset: 7"));
  EXPECT_EQ(source["cut"].size(), kMaxAboutList);
  EXPECT_EQ(a.creator, "of extras");  // fields are read all the same
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].code, "metadata-cut");
  json deep = json::array();
  for (int i = 0; i < 60; ++i) deep = json::array({deep});
  EXPECT_NO_THROW(write_about(about_of({{"extras", deep}})));
}

TEST(GltfAbout, AnythingMayBeShapedWrongly) {
  for (const char* text :
       {"{}", R"({"asset":[]})", R"({"asset":{"copyright":3,"extras":[]},"scenes":{},"scene":-1})",
        R"({"scenes":[1],"extras":"x","extensions":{"KHR_xmp_json_ld":{"packets":{}}}})",
        R"({"asset":{"extensions":{"KHR_xmp_json_ld":{"packet":"0"}}}})", "[]", "3"})
    EXPECT_NO_THROW(write_about(about_of(json::parse(text)))) << text;
}

TEST(GltfAbout, WrittenBackAndReadAgain) {
  json d = document();
  d["asset"]["extensions"]["KHR_xmp_json_ld"]["packet"] = 0u;
  About a = about_of(d);
  ordered_json root = ordered_json::parse(R"({"asset":{"version":"2.0","generator":"texmesh"}})");
  write_gltf_about(a, root);
  EXPECT_EQ(root["asset"]["copyright"], "(c) the file. Licence: CC-BY-4.0");
  EXPECT_EQ(json(json::parse(root["asset"]["extras"].dump())), d["asset"]["extras"]);
  EXPECT_EQ(root["extensionsUsed"], ordered_json::array({"KHR_xmp_json_ld"}));
  const auto& packets = root["extensions"]["KHR_xmp_json_ld"]["packets"];
  EXPECT_EQ(packets[0]["dc:title"], "of XMP");
  About again = about_of(json::parse(root.dump()));
  EXPECT_EQ(again.title, "of XMP");
  EXPECT_EQ(again.creator, a.creator);
  EXPECT_EQ(again.licence, a.licence);
  EXPECT_EQ(again.licence_url, a.licence_url);
  // What a curator says wins over the packet, which stays.
  a.title = "of the museum";
  write_gltf_about(a, root);
  EXPECT_EQ(about_of(json::parse(root.dump())).title, "of the museum");
  EXPECT_EQ(root["extensions"]["KHR_xmp_json_ld"]["packets"][0]["dc:title"], "of XMP");
}

TEST(GltfAbout, WritesOverWhatIsShapedWrongly) {
  About a = about_of(document());
  a.metres_per_unit = 2;
  ordered_json root =
      ordered_json::parse(R"({"asset":{"extensions":3},"extensions":[],"extensionsUsed":"x","extras":1})");
  write_gltf_about(a, root);
  EXPECT_EQ(root["extras"]["texmesh"]["unit"]["metres"], 2);
  EXPECT_EQ(root["asset"]["extensions"]["KHR_xmp_json_ld"]["packet"], 2);
  a.source = R"({"asset":3,"xmpPackets":{"a":1}})";
  EXPECT_NO_THROW(write_gltf_about(a, root));
  a.source = R"({"xmpPackets":[3,[]],"asset":{"extensions":{"KHR_xmp_json_ld":{"packet":0}}}})";
  EXPECT_NO_THROW(write_gltf_about(a, root));
}

TEST(GltfAbout, NothingKnownWritesNothing) {
  ordered_json root = ordered_json::parse(R"({"asset":{"version":"2.0"}})");
  const ordered_json before = root;
  write_gltf_about({}, root);
  EXPECT_EQ(root, before);
}

TEST(GltfAbout, ASmallFileKeepsWhoseItIs) {
  About a = about_of(document());
  const auto bytes_of = [](const About& about) {
    ordered_json root = ordered_json::object();
    write_gltf_about(about, root);
    return root.dump().size();
  };
  EXPECT_EQ(about_within(a, bytes_of(a)), a);
  const About less = about_within(a, bytes_of(a) - 1);
  EXPECT_EQ(less.source, "");
  EXPECT_EQ(less.description, a.description);
  const About least = about_within(a, 1);
  EXPECT_EQ(least.description, "");
  EXPECT_EQ(least.licence, a.licence);
  EXPECT_EQ(least.attribution, a.attribution);
}

}  // namespace texmesh::gltf_about_test
