// Archives as services give them, and hostile ones: a sentence each.
#include <gtest/gtest.h>

#include <chrono>

#include "pipeline/import/archive/archive_files.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "tests/support/images.h"
#include "tests/support/sanitizers.h"
#include "tests/support/zip_writer.h"

namespace texmesh::archive_test {

using testing::zip_of;
using testing::ZipFile;

const std::string kObj =
    "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
const std::string kLicence =
    "Model Information:\n* title:\tOld bust\n* source:\thttps://sketchfab.com/3d-models/old-bust-1\n"
    "* author:\tN. N. (https://sketchfab.com/nn)\n\nModel License:\n"
    "* license type:\tCC-BY-4.0 (http://creativecommons.org/licenses/by/4.0/)\n* requirements:\tcredit\n\n"
    "This work is based on \"Old bust\" by N. N. licensed under CC-BY-4.0\n";

std::string picture() {
  const Bytes png =
      testing::encode_image("png", 2, 2, 3, std::vector<std::uint8_t>(12, 70), OIIO::TypeDesc::UINT8);
  return {png.begin(), png.end()};
}

ImportedModel import_zip(const std::vector<ZipFile>& files, const ImportOptions& options = {}) {
  NoFiles none;
  return import_model("a.zip", zip_of(files), none, options, {});
}

std::string refusal_of(const Bytes& zip, const ImportOptions& options = {}) {
  NoFiles none;
  try {
    import_model("a.zip", zip, none, options, {});
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}
std::string refusal_of(const std::vector<ZipFile>& files, const ImportOptions& options = {}) {
  return refusal_of(zip_of(files), options);
}

bool has(const std::string& text, std::string_view part) { return text.find(part) != std::string::npos; }

TEST(Archive, SketchfabsDownloadBringsItsLicence) {
  const std::string gltf =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"scene.bin","byteLength":36}]})";
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::string bin(reinterpret_cast<const char*>(corners), sizeof corners);
  const ImportedModel m =
      import_zip({{"scene.gltf", gltf}, {"scene.bin", bin, false}, {"license.txt", kLicence}});
  EXPECT_EQ(m.model.mesh.triangles.size(), 1u);
  EXPECT_EQ(m.format, "gltf");
  EXPECT_EQ(m.about.title, "Old bust");
  EXPECT_EQ(m.about.creator, "N. N.");
  EXPECT_EQ(creator_url(m.about), "https://sketchfab.com/nn");
  EXPECT_EQ(m.about.licence, "CC-BY-4.0");
  EXPECT_TRUE(has(m.about.licence_url, "creativecommons.org"));
  EXPECT_EQ(m.about.source_url, "https://sketchfab.com/3d-models/old-bust-1");
  EXPECT_TRUE(has(m.about.attribution, "This work is based on"));
}

TEST(Archive, FilesOfOtherFoldersAndNamesOfWindowsAreFound) {
  for (const std::string slash : {"/", "\\"})
    for (const bool deflated : {false, true}) {
      const ImportedModel m = import_zip({{"source" + slash + "a.obj", kObj, deflated},
                                          {"source" + slash + "m.mtl", "newmtl m\nmap_Kd C.png\n", deflated},
                                          {"textures" + slash + "C.png", picture(), deflated},
                                          {"__MACOSX/source/._a.obj", "x"},
                                          {"source" + slash + "._a.obj", "x"},
                                          {"scan" + slash + "__MACOSX" + slash + "b.gltf", "x"}});
      EXPECT_EQ(m.model.images.size(), 1u);
      EXPECT_EQ(m.format, "obj");
    }
}

TEST(Archive, OfTwoPicturesOfOneNameNeitherIsTakenAndBothAreTold) {
  const ZipFile model{"s/a.obj", kObj}, b{"b/C.png", picture()}, c{"c/C.png", picture()};
  const auto of = [&](const std::string& written) {
    return import_zip({model, {"s/m.mtl", "newmtl m\nmap_Kd " + written + "\n"}, b, c}).model;
  };
  const Model unknown = of("C.png");
  EXPECT_TRUE(unknown.images.empty());
  const auto told = std::ranges::find(unknown.notes, "missing-texture", &Note::code);
  ASSERT_NE(told, unknown.notes.end());
  EXPECT_TRUE(has(told->text, R"(any of these may be meant: "b/C.png", "c/C.png")")) << told->text;
  EXPECT_EQ(of("b/C.png").images.size(), 1u) << "a whole name of the archive";
}

TEST(Archive, ThousandsOfNamesAmongThousandsOfFilesTakeNoTime) {
  std::vector<ZipFile> files{{"a.obj", kObj}, {"m.mtl", "newmtl m\nmap_Kd x.png\n"}};
  for (int i = 0; i < 2000; ++i) {
    files[1].text += "newmtl m" + std::to_string(i) + "\nmap_Kd P" + std::to_string(i) + ".png\n";
    files.push_back({"t" + std::to_string(i) + "/X.png", "x"});
  }
  const auto start = std::chrono::steady_clock::now();
  const Model model = import_zip(files).model;
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  EXPECT_LT(took.count(), testing::sanitizers_take(3.0));
  const auto told = std::ranges::find(model.notes, "missing-texture", &Note::code);
  ASSERT_NE(told, model.notes.end());
  EXPECT_TRUE(has(told->text, R"("x.png" not found)") && has(told->text, R"("t10/X.png", )")) << told->text;
  EXPECT_LT(told->text.size(), 600u) << "not all 2,000";
}

TEST(Archive, NamesInAnyEncodingAreFound) {
  // "Büste Ä.png" by programs of Windows, by others, and with the name in UTF-8 beside it.
  const std::string utf8 = "B\xc3\xbcste \xc3\x84.png", oem = "B\x81ste \x8e.png",
                    latin = "B\xfcste \xc4.png";
  const auto with_path = [](const std::string& name, const std::string& path) {
    BytesOut extra;
    extra.u16(0x7075);
    extra.u16(5 + path.size());
    extra.u8(1);
    extra.u32(crc32_z(0, reinterpret_cast<const Bytef*>(name.data()), name.size()));
    extra.text(path);
    const Bytes bytes = extra.finish();
    return ZipFile{name, picture(), true, 0, ~0ull, 0, {bytes.begin(), bytes.end()}};
  };
  for (const ZipFile& file : {ZipFile{utf8, picture()}, ZipFile{oem, picture()}, ZipFile{latin, picture()},
                              ZipFile{"t/" + oem, picture()}, ZipFile{"\x81/" + oem, picture()},
                              with_path("B?ste ?.png", utf8), with_path(oem, utf8)})
    for (const std::string& written : {utf8, latin}) {
      const Model m =
          import_zip({{"a.obj", kObj}, {"m.mtl", "newmtl m\nmap_Kd " + written + "\n"}, file}).model;
      EXPECT_EQ(m.images.size(), 1u) << readable_name(file.name) << " as " << readable_name(written);
    }
}

TEST(Archive, AnotherReadingOfANameNeverHidesAFile) {
  const Bytes zip =
      zip_of({{"a.obj", kObj}, {"\xe9.png", "Windows", false}, {"\xc3\xa9.png", "true", false}});
  ArchiveFiles archive("a.zip", zip, 1 << 20);
  const Bytes found = archive.read("\xc3\xa9.png", 100).value();
  EXPECT_EQ(std::string(found.begin(), found.end()), "true");
}

TEST(Archive, ALinkIsNotFollowedAndIsTold) {
  const ZipFile mtl{"m.mtl", "newmtl m\nmap_Kd C.png\n"}, link{"C.png", "x/D.png", false, 0, ~0ull, 0120777};
  const Model m = import_zip({{"a.obj", kObj}, mtl, link, {"x/D.png", picture()}}).model;
  const auto told = std::ranges::find(m.notes, "missing-texture", &Note::code);
  ASSERT_NE(told, m.notes.end());
  EXPECT_TRUE(has(told->text, "a symbolic link; unpack the archive")) << told->text;
  EXPECT_EQ(import_zip({{"a.obj", kObj}, mtl, link, {"x/C.png", picture()}}).model.images.size(), 1u)
      << "the one file of this last part";
  const std::string alone = refusal_of({{"a.obj", "b/c", false, 0, ~0ull, 0120777}, {"b/c", kObj}});
  EXPECT_TRUE(has(alone, "found a.obj (a symbolic link), b/c alone")) << alone;
}

TEST(Archive, WhatAnArchiveHasInThePlaceOfAModelIsTold) {
  EXPECT_TRUE(has(refusal_of({{"a.fbx", "x"}, {"b.png", "x"}, {"c", "x"}, {"d", "x"}}),
                  "found a.fbx, b.png, c and 1 more alone"));
  EXPECT_TRUE(has(refusal_of({{"textures/a.png", "x"}, {"source/a.zip", "x"}}),
                  "found source/a.zip, an archive in the archive: unpack the outer one"));
}

TEST(Archive, OpenDroneMapsModelIsTheGeoreferencedOneInMetresWithZUp) {
  const ImportedModel m = import_zip({{"odm_texturing/odm_textured_model.obj", kObj},
                                      {"odm_texturing/odm_textured_model_geo.obj", kObj + "v 5 5 5\n"},
                                      {"odm_georeferencing/coords.txt", "WGS84 UTM 32N\n500000 5000000\n"}});
  EXPECT_EQ(m.about.up_axis, "y");  // turned
  EXPECT_EQ(std::ranges::count(m.model.mesh.positions, Vec3f{0, 0, -1}), 1);
  EXPECT_EQ(m.about.metres_per_unit, 1);
  EXPECT_EQ(m.about.epsg, 32632u);
}

TEST(Archive, TheBestModelIsTaken) {
  const auto chosen = [](std::vector<std::string> names) {
    std::vector<ArchivedFile> files(names.size());
    for (std::size_t k = 0; k < names.size(); ++k) files[k].name = names[k];
    const auto k = model_of_archive(files, "a.zip");
    return k ? names[*k] : "";
  };
  EXPECT_EQ(chosen({"a.ply", "b.obj", "c/x.GLB"}), "c/x.GLB");
  EXPECT_EQ(chosen({"other.gltf", "scene.gltf"}), "scene.gltf");
  EXPECT_EQ(chosen({"deep/a.obj", "a.obj"}), "a.obj");
  EXPECT_EQ(chosen({"readme.txt"}), "");
  EXPECT_EQ(chosen({"b.obj", "c.obj", "a.glb"}), "a.glb") << "several worse ones are no matter";
  EXPECT_THROW(chosen({"a.obj", "b.obj"}), InputError);
}

TEST(Archive, HostileArchivesAreRefusedWithASentence) {
  const ZipFile model{"a.obj", kObj};
  for (const char* name : {"../x.png", "a/../../x.png", "/etc/passwd", "C:\\x.png", "..\\x.png"})
    EXPECT_TRUE(has(refusal_of({model, {name, "x"}}), "names within the archive")) << name;
  EXPECT_TRUE(has(refusal_of({model, {"b.png", "x", true, 1}}), "password"));
  EXPECT_TRUE(has(refusal_of({model, model}), "every file once"));
  EXPECT_TRUE(has(refusal_of({{"readme.txt", "x"}}), "an archive with a .gltf"));
  EXPECT_TRUE(
      has(refusal_of({{"a.obj", zip_of({model}).empty() ? "" : "PK\3\4", false}}), "another archive"));
  EXPECT_TRUE(has(refusal_of({{"a.obj", kObj, true, 0, 1u << 30}}), "a size that its packed bytes can give"));
  EXPECT_TRUE(has(refusal_of({{"a.obj", kObj, true, 0, kObj.size() + 9}}), "its size and CRC-32"));
  EXPECT_TRUE(has(refusal_of({{"a.obj", kObj, false, 0, kObj.size() - 9}}), "its size and CRC-32"));
  ImportOptions small;
  small.max_file_bytes = 400;
  EXPECT_TRUE(has(refusal_of({model, {"b.txt", std::string(500, 'x')}}, small), "together"));
  std::vector<ZipFile> many(kMaxArchiveFiles + 1);
  for (std::size_t k = 0; k < many.size(); ++k) many[k] = {"f" + std::to_string(k), "", false};
  EXPECT_TRUE(has(refusal_of(many), "at most 20000 files"));
}

TEST(Archive, EveryCutAndEveryChangedByteIsRefusedOrReads) {
  const Bytes zip = zip_of({{"a.obj", kObj}, {"license.txt", kLicence}});
  for (std::size_t n = 4; n < zip.size(); ++n)
    EXPECT_NE(refusal_of(Bytes(zip.begin(), zip.begin() + static_cast<std::ptrdiff_t>(n))), "") << n;
  for (std::size_t k = 4; k < zip.size(); ++k)
    for (const std::uint8_t change : {0x01, 0x80, 0xff}) {
      Bytes bad = zip;
      bad[k] = static_cast<std::uint8_t>(bad[k] ^ change);
      refusal_of(bad);  // nothing but an InputError
    }
}

}  // namespace texmesh::archive_test
