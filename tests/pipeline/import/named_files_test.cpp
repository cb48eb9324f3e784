// The rules for names of files hold for every format and every kind of name: kinds times formats, not cases.
#include "pipeline/import/named_files.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/pipeline/import/gltf/textured_gltf.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::named_files_test {

using testing::bytes_of;
using testing::MemoryResolver;

/// A model of one format that names a texture.
struct Format {
  const char* name;
  ImportedModel (*import)(const std::string& written, Resolver& files);
};

const std::string kObj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";

ImportedModel import_text(const std::string& name, const std::string& text, Resolver& files) {
  return import_model(name, bytes_of(text), files, {}, {});
}
ImportedModel obj(const std::string& written, Resolver& files) {
  auto& memory = dynamic_cast<MemoryResolver&>(files);
  memory.files["m.mtl"] = bytes_of("newmtl m\nmap_Kd " + written + "\n");
  return import_text("m.obj", "mtllib m.mtl\n" + kObj, files);
}
ImportedModel obj_norm(const std::string& written, Resolver& files) {
  auto& memory = dynamic_cast<MemoryResolver&>(files);
  memory.files["m.mtl"] = bytes_of("newmtl m\nnorm -bm 1 " + written + "\n");
  return import_text("m.obj", "mtllib m.mtl\n" + kObj, files);
}
ImportedModel ply(const std::string& written, Resolver& files) {
  return import_text("m.ply",
                     "ply\nformat ascii 1.0\ncomment TextureFile " + written +
                         "\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                         "property float s\nproperty float t\nelement face 1\n"
                         "property list uchar int vertex_indices\nend_header\n"
                         "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n",
                     files);
}
ImportedModel gltf(const std::string& written, Resolver& files) {
  testing::GltfBuilder b = testing::textured(testing::base_colour());
  b.json["images"][0]["uri"] = written;
  return import_model("m.glb", b.glb(), files, {}, {});
}
ImportedModel range(const std::string& written, Resolver& files) {
  auto& memory = dynamic_cast<MemoryResolver&>(files);
  std::string grid = "P5\n4 3\n255\n";
  grid.append(12, 'x');
  memory.files["grid.pgm"] = bytes_of(grid);
  const nlohmann::json scan{{"version", 1},
                            {"type", "cylindrical-range-scan"},
                            {"y_step", 1},
                            {"grid", "grid.pgm"},
                            {"texture", written}};
  return import_text("m.json", scan.dump(), files);
}

constexpr Format kFormats[] = {
    {"obj", obj}, {"norm", obj_norm}, {"ply", ply}, {"gltf", gltf}, {"range", range}};

/// Where files lie, what is written, and which file is meant ("" = none) with which warning ("" = none).
struct Case {
  std::vector<std::string> there;
  std::string written, found, warning;
};

void expect_in_every_format(const std::vector<Case>& cases, std::initializer_list<std::string> without = {}) {
  for (const Format& format : kFormats) {
    if (std::find(without.begin(), without.end(), format.name) != without.end()) continue;
    for (const Case& c : cases) {
      SCOPED_TRACE(std::string(format.name) + ": " + c.written);
      MemoryResolver files;
      for (const std::string& name : c.there) files.files[name] = testing::png_bytes(8, 4, 3);
      const ImportedModel m = format.import(c.written, files);
      EXPECT_EQ(m.model.images.size(), c.found.empty() ? 0u : 1u);
      if (!c.found.empty()) EXPECT_EQ(files.asked.back(), c.found);
      std::string warnings;
      for (const Note& n : m.model.notes)
        if (n.severity == Severity::kWarning) warnings += n.code + ": " + n.text;
      EXPECT_EQ(warnings.substr(0, warnings.find(':')), c.warning) << warnings;
      if (c.warning == "missing-texture")
        EXPECT_NE(warnings.find(" not found: "), std::string::npos) << warnings;
    }
  }
}

TEST(NamedFiles, SlashesBlanksAndDotsAreReadTheSameEverywhere) {
  expect_in_every_format({{{"t.png"}, "t.png", "t.png", ""},
                          {{"t.png"}, "./t.png", "t.png", ""},
                          {{"t.png"}, ".\\t.png", "t.png", ""},
                          {{"t.png"}, "x/../t.png", "t.png", ""},
                          {{"a/t.png"}, "a/t.png", "a/t.png", ""},
                          {{"a/t.png"}, "a\\t.png", "a/t.png", ""},
                          {{"a/t.png"}, "a//t.png", "a/t.png", ""},
                          {{"a/b c/t u.png"}, "a\\b c/t u.png", "a/b c/t u.png", ""},
                          {{"t#1.png"}, "t#1.png", "t#1.png", ""}});
}

TEST(NamedFiles, QuotesTrailingBlanksAndCommentsOfTextFormats) {
  expect_in_every_format({{{"t u.png"}, "\"t u.png\"", "t u.png", ""},
                          {{"t.png"}, "'t.png'", "t.png", ""},
                          {{"t.png"}, "  t.png \t", "t.png", ""},
                          {{"t.png"}, "t.png # the picture", "t.png", ""},
                          {{"t u.png"}, "\"t u.png\" # the picture", "t u.png", ""},
                          {{"t #1.png"}, "t #1.png", "t #1.png", ""},
                          {{"t.png"}, "t.png\r", "t.png", ""}},
                         {"gltf"});
}

TEST(NamedFiles, UrisArePercentDecodedOnce) {
  for (const auto& [written, there] :
       std::vector<std::pair<std::string, std::string>>{{"t%20u.png", "t u.png"},
                                                        {"%C3%A9.png", "\xC3\xA9.png"},
                                                        {"100%25.png", "100%.png"},
                                                        {"a%5Ct.png", "a/t.png"},
                                                        {"50%.png", "50%.png"},
                                                        {"t%20u.png", "t%20u.png"},
                                                        {"%2541.png", "%41.png"}}) {
    MemoryResolver files;
    files.files[there] = testing::png_bytes(8, 4, 3);
    EXPECT_EQ(gltf(written, files).model.images.size(), 1u) << written;
    EXPECT_EQ(files.asked.back(), there) << written;
  }
}

TEST(NamedFiles, NamesThatLeadOutAreNeverFollowedAndTheLastPartIsTaken) {
  std::vector<Case> cases;
  for (const std::string written :
       {"C:\\scans\\x\\t.png", "c:/t.png", "C:t.png", "/data/x/t.png", "../t.png", "a/../../t.png",
        "..\\t.png", "\\\\server\\share\\t.png", "//server/t.png", "file:///data/x/t.png",
        "http://host/a/t.png", "https://host/t.png?size=1#a", "x/../../../etc/t.png"}) {
    cases.push_back({{"t.png"}, written, "t.png", "outside-name"});
    cases.push_back({{}, written, "", "missing-texture"});
    cases.push_back({{"T.PNG"}, written, "T.PNG", "similar-name"});
  }
  expect_in_every_format(cases);
}

TEST(NamedFiles, ResolversAreNeverAskedForNamesThatLeadOut) {
  for (const Format& format : kFormats)
    for (const std::string written : {"../t.png", "/etc/hostname", "a/../../../x", "C:\\x.png", "..", ".",
                                      "a/", "a/..", "http://x/", "~/../../x"}) {
      MemoryResolver files;
      format.import(written, files);
      for (const std::string& asked : files.asked) {
        EXPECT_NE(asked.front(), '/') << asked;
        EXPECT_EQ(("/" + asked + "/").find("/../"), std::string::npos) << asked;
        EXPECT_EQ(asked.find(':'), std::string::npos) << asked;
      }
    }
}

TEST(NamedFiles, TheOnlyNameThatDiffersInCaseOrCompositionIsTaken) {
  expect_in_every_format(
      {{{"Textured_Mesh.JPG"}, "textured_mesh.jpg", "Textured_Mesh.JPG", "similar-name"},
       {{"Tex/T.png"}, "tex/t.PNG", "Tex/T.png", "similar-name"},
       {{"\xC3\x89t\xC3\xA9.png"}, "E\xCC\x81te\xCC\x81.png", "\xC3\x89t\xC3\xA9.png", "similar-name"},
       {{"E\xCC\x81te\xCC\x81.png"}, "\xC3\xA9t\xC3\xA9.png", "E\xCC\x81te\xCC\x81.png", "similar-name"},
       {{"\xD0\x99.png"}, "\xD0\xB8\xCC\x86.png", "\xD0\x99.png", "similar-name"},
       {{"B\xFCste.png"}, "b\xC3\xBCste.png", "B\xFCste.png", "similar-name"},
       {{"T.png", "T.PNG"}, "t.png", "", "missing-texture"},
       {{"t.png", "T.PNG"}, "t.png", "t.png", ""},
       {{"u.png"}, "t.png", "", "missing-texture"}});
}

TEST(NamedFiles, AMessageNamesTheFilesThatMayBeMeantAndThePlacesThatWereLookedAt) {
  MemoryResolver files;
  files.files["sub/m.mtl"] = bytes_of("newmtl m\nmap_Kd tex/a.png\n");
  files.files["sub/tex/A.png"] = files.files["tex/A.PNG"] = bytes_of("x");
  const ImportedModel m = import_text("m.obj", "mtllib sub/m.mtl\n" + kObj, files);
  ASSERT_EQ(m.model.notes.size(), 1u);
  EXPECT_EQ(
      m.model.notes[0].text,
      "texture \"tex/a.png\" not found: looked for \"sub/tex/a.png\", \"tex/a.png\"; any of these may be "
      "meant: \"sub/tex/A.png\", \"tex/A.PNG\"; the material stays without it");
}

TEST(NamedFiles, NamesCountFromTheFileThatSaysThemThenFromTheModel) {
  struct Placed {
    const char *library, *written, *there;
  };
  for (const Placed p :
       {Placed{"mats/m.mtl", "t.png", "mats/t.png"}, Placed{"mats/m.mtl", "mats/t.png", "mats/t.png"},
        Placed{"mats/m.mtl", "t.png", "t.png"}, Placed{"mats/m.mtl", "../t.png", "t.png"},
        Placed{"mats/m.mtl", "..\\tex\\t.png", "tex/t.png"},
        Placed{"mats\\m.mtl", "tex/t.png", "mats/tex/t.png"}, Placed{"./a/b/m.mtl", "../t.png", "a/t.png"},
        Placed{"a/b/m.mtl", "../../t.png", "t.png"}}) {
    SCOPED_TRACE(std::string(p.library) + " " + p.written);
    MemoryResolver files;
    std::string library = p.library;
    std::replace(library.begin(), library.end(), '\\', '/');
    if (library.starts_with("./")) library.erase(0, 2);
    files.files[library] = bytes_of(std::string("newmtl m\nmap_Kd ") + p.written + "\n");
    files.files[p.there] = testing::png_bytes(8, 4, 3);
    const ImportedModel m = import_text("m.obj", std::string("mtllib ") + p.library + "\n" + kObj, files);
    EXPECT_EQ(m.model.images.size(), 1u);
    EXPECT_TRUE(m.model.notes.empty());
  }
  MemoryResolver both;
  both.files["mats/m.mtl"] = bytes_of("newmtl m\nmap_Kd t.png\n");
  both.files["mats/t.png"] = testing::png_bytes(8, 4, 3);
  both.files["t.png"] = testing::png_bytes(4, 8, 3);
  EXPECT_EQ(import_text("m.obj", "mtllib mats/m.mtl\n" + kObj, both).model.images[0].width_px, 8u)
      << "the library's folder comes first";
}

TEST(NamedFiles, LibrariesFollowTheSameRules) {
  for (const std::string line :
       {"mtllib m.mtl", "MtlLib m.mtl", "MTLLIB \"m.mtl\"", "mtllib .\\m.mtl", "mtllib  m.mtl  ",
        "mtllib other.mtl m.mtl", "mtllib \"other 1.mtl\" m.mtl", "mtllib m.mtl # materials"}) {
    MemoryResolver files;
    files.files["m.mtl"] = bytes_of("newmtl m\nKd 1 0 0\n");
    files.files["other.mtl"] = files.files["other 1.mtl"] = bytes_of("newmtl o\n");
    const ImportedModel m = import_text("m.obj", line + "\n" + kObj, files);
    EXPECT_EQ(m.model.materials.at(0).base_colour.y, 0) << line;
    EXPECT_TRUE(m.model.notes.empty()) << line << m.model.notes.front().text;
  }
  for (const std::string line : {"mtllib M.MTL", "mtllib C:\\scans\\m.mtl", "mtllib ../m.mtl",
                                 "mtllib /x/m.mtl", "mtllib \\\\server\\m.mtl"}) {
    MemoryResolver files;
    files.files["m.mtl"] = bytes_of("newmtl m\nKd 1 0 0\n");
    const ImportedModel m = import_text("m.obj", line + "\n" + kObj, files);
    EXPECT_EQ(m.model.materials.at(0).base_colour.y, 0) << line;
    EXPECT_EQ(m.model.notes.size(), 1u) << line;
  }
}

TEST(NamedFiles, BuffersAndGridsFollowTheSameRulesButMustBeThere) {
  const testing::GltfBuilder b = testing::quad();
  const auto with = [&](const std::string& uri, const std::string& there) {
    MemoryResolver files;
    files.files[there] = b.bin;
    return import_model("m.gltf", b.gltf(uri), files, {}, {});
  };
  for (const auto& [uri, there] : std::vector<std::pair<std::string, std::string>>{{"a%20b.bin", "a b.bin"},
                                                                                   {"x\\m.bin", "x/m.bin"},
                                                                                   {"M.BIN", "m.bin"},
                                                                                   {"C:\\x\\m.bin", "m.bin"},
                                                                                   {"../m.bin", "m.bin"}})
    EXPECT_EQ(with(uri, there).model.mesh.triangles.size(), 2u) << uri;
  const std::string error = testing::input_error([&] { with("m.bin", "other.bin"); });
  EXPECT_NE(error.find("/buffers/0/uri"), std::string::npos) << error;
  EXPECT_NE(error.find("looked for \"m.bin\""), std::string::npos) << error;
}

TEST(NamedFiles, WhatMustNotBeReadCountsAsMissingAndSaysWhy) {
  struct Refusing : MemoryResolver {
    std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
      if (uri == "t.png") throw FileRefused(uri, "", "a regular file", "a FIFO");
      return MemoryResolver::read(uri, max_bytes);
    }
  };
  for (const Format& format : kFormats) {
    Refusing files;
    const ImportedModel m = format.import("t.png", files);
    ASSERT_EQ(testing::count_notes(m.model, "missing-texture"), 1) << format.name;
    EXPECT_NE(m.model.notes.back().text.find("\"t.png\" (a FIFO)"), std::string::npos)
        << m.model.notes.back().text;
  }
}

TEST(NamedFiles, HostileNamesCostLittleAndRefuseNothing) {
  std::string deep, dots;
  for (int i = 0; i < 2000; ++i) deep += "a/", dots += "../";
  std::vector<Case> cases;
  for (const std::string& written :
       {deep + "t.png", dots + "t.png", std::string(70000, 'x'), std::string(300, '\\'),
        std::string("%00%00"), std::string("\x01\x02.png"), std::string("\""), std::string("::::")})
    cases.push_back({{}, written, "", "missing-texture"});
  expect_in_every_format(cases);
}

}  // namespace texmesh::named_files_test
