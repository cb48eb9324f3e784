// Cases that people have reported of such tools, by the names under which they are known, each with its
// siblings: what a model comes to, and which lines its user sees.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "stages/condition/condition.h"
#include "stages/image/decode_image.h"
#include "tests/pipeline/import/gltf/textured_gltf.h"
#include "tests/pipeline/import/obj/obj_cases.h"
#include "tests/support/chunks.h"

namespace texmesh {
namespace {

using testing::kVertices;
using testing::MemoryResolver;

std::string text(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }

struct Case {
  std::string row, input;  // names
  std::map<std::string, std::string> files;
  std::string model;         // of the files
  std::size_t pictures = 0;  // that the model's materials use
  std::string told;          // codes of warnings and of what is left out, by first use
  std::function<void(const ImportedModel&)> expect;
};

std::string told(const ImportedModel& m) {
  std::string codes;
  for (const Note& n : m.model.notes)
    if ((n.severity == Severity::kWarning || n.code == kLostNote) && codes.find(n.code) == codes.npos)
      codes += (codes.empty() ? "" : " ") + n.code;
  return codes;
}

const std::string kPicture = text(testing::png_bytes(8, 4, 3));
const std::string kFaces = kVertices + "usemtl m\nf 1/1 2/2 3/3 4/4\n";

std::string obj(const std::string& library) { return "mtllib " + library + "\n" + kFaces; }
std::string mtl(const std::string& picture) { return "newmtl m\nKd 1 0 0\nmap_Kd " + picture + "\n"; }
std::string ply(const std::string& comments) {
  return "ply\nformat ascii 1.0\n" + comments +
         "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n"
         "property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
}
std::string gltf(const std::string& uri) {
  testing::GltfBuilder b =
      testing::textured({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  b.json["images"][0]["uri"] = uri;
  return text(b.glb());
}
std::string utf16(const std::string& ascii) {
  std::string out = "\xff\xfe";
  for (const char c : ascii) out += {c, '\0'};
  return out;
}
/// Two triangles, each with a texture.
std::string artec(const std::string& comments, const std::string& texture_faces) {
  return "ply\nformat ascii 1.0\n" + comments +
         "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 2\nproperty list uchar int vertex_indices\n"
         "element multi_texture_vertex 6\nproperty uchar tx\nproperty float u\nproperty float v\n" +
         texture_faces;
}
const std::string kArtecFaces =
    "element multi_texture_face 2\nproperty uchar tx\nproperty uint tn\n"
    "property list uchar int texture_vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
    "0 0 0\n0 1 0\n0 1 1\n1 0 0\n1 0.5 1\n1 0.25 0.75\n0 3 3 0 1 2\n1 3 3 3 4 5\n";
const std::string kArtecComments = "comment TextureFile p_0.png\ncomment TextureFile p_1.png\n";

/// 8 x 8 texels; alpha is 0 in the right half, where no face of quad_obj() is.
std::string half_clear() {
  Bytes samples;
  for (int i = 0; i < 64; ++i)
    samples.insert(samples.end(),
                   {200, 90, static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i % 8 < 4 ? 255 : 0)});
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  return text(testing::encode_image("png", 8, 8, 4, samples, OIIO::TypeDesc::UINT8, attributes));
}
/// `values[0]` in the left half, where faces are, `values[1]` in the right one.
std::string half_rgb(std::array<std::array<std::uint8_t, 3>, 2> values) {
  Bytes samples;
  for (int i = 0; i < 64; ++i)
    for (const std::uint8_t v : values[i % 8 < 4 ? 0 : 1]) samples.push_back(v);
  return text(testing::encode_image("png", 8, 8, 3, samples, OIIO::TypeDesc::UINT8));
}
const std::string kLeftHalf =
    "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nusemtl m\n"
    "f 1/1 2/2 3/3 4/4\n";
void is_opaque(const ImportedModel& m) { EXPECT_EQ(m.model.materials.at(0).alpha_mode, AlphaMode::kOpaque); }
void is_red(const ImportedModel& m) { EXPECT_EQ(m.model.materials.at(0).base_colour.y, 0); }
void has_normal_map(const ImportedModel& m) { EXPECT_TRUE(m.model.materials.at(0).normal_texture.used()); }

void add_names(std::vector<Case>& all) {
  const std::string p = kPicture;
  const auto with_mtl = [&](const std::string& row, const std::string& input, const std::string& library,
                            const std::string& written, const std::string& there, const std::string& codes) {
    all.push_back(
        {row, input, {{"m.obj", obj(library)}, {library, mtl(written)}, {there, p}}, "m.obj", 1, codes, {}});
  };
  with_mtl("mtl-folder", "beside the library", "mats/m.mtl", "t.png", "mats/t.png", "");
  with_mtl("mtl-folder", "from the model", "mats/m.mtl", "mats/t.png", "mats/t.png", "");
  with_mtl("mtl-folder", "beside the model", "mats/m.mtl", "t.png", "t.png", "");
  with_mtl("mtl-folder", "below the library", "mats/m.mtl", "tex/t.png", "mats/tex/t.png", "");
  with_mtl("mtl-folder", "up from the library", "mats/m.mtl", "..\\t.png", "t.png", "");
  with_mtl("mtl-folder", "two folders down", "a/b/m.mtl", "../t.png", "a/t.png", "");
  for (const std::string written :
       {"C:\\Users\\x\\Scans\\t.png", "/data/x/t.png", "../t.png", "file:///data/x/t.png",
        "\\\\server\\share\\t.png", "http://host/t.png"}) {
    with_mtl("absolute-name", "MTL " + written, "m.mtl", written, "t.png", "outside-name");
    all.push_back({"absolute-name",
                   "none " + written,
                   {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl(written)}},
                   "m.obj",
                   0,
                   "missing-texture",
                   is_red});
    all.push_back({"absolute-name",
                   "PLY " + written,
                   {{"m.ply", ply("comment TextureFile " + written + "\n")}, {"t.png", p}},
                   "m.ply",
                   1,
                   "outside-name",
                   {}});
    all.push_back({"absolute-name",
                   "glTF " + written,
                   {{"m.glb", gltf(written)}, {"t.png", p}},
                   "m.glb",
                   1,
                   "outside-name",
                   {}});
  }
  all.push_back({"absolute-name",
                 "library",
                 {{"m.obj", obj("D:\\x\\m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", p}},
                 "m.obj",
                 1,
                 "outside-name",
                 {}});
  with_mtl("name-case", "picture", "m.mtl", "textured_mesh.jpg", "Textured_Mesh.JPG", "similar-name");
  with_mtl("name-case", "folder", "m.mtl", "TEX/t.png", "tex/T.png", "similar-name");
  with_mtl("name-case", "composed", "m.mtl", "E\xCC\x81.png", "\xC3\x89.png", "similar-name");
  with_mtl("name-case", "decomposed", "m.mtl", "\xC3\xA9.png", "E\xCC\x81.png", "similar-name");
  all.push_back({"name-case",
                 "library",
                 {{"m.obj", obj("M.MTL")}, {"m.mtl", mtl("t.png")}, {"t.png", p}},
                 "m.obj",
                 1,
                 "similar-name",
                 {}});
  all.push_back({"name-case",
                 "two that may be meant",
                 {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.png")}, {"T.png", p}, {"t.PNG", p}},
                 "m.obj",
                 0,
                 "missing-texture",
                 {}});
  all.push_back({"ply-backslash",
                 "PLY",
                 {{"m.ply", ply("comment TextureFile tex\\t.png\n")}, {"tex/t.png", p}},
                 "m.ply",
                 1,
                 "",
                 {}});
  all.push_back({"ply-backslash",
                 "PLY, quoted",
                 {{"m.ply", ply("comment TextureFile \".\\tex\\t.png\"\n")}, {"tex/t.png", p}},
                 "m.ply",
                 1,
                 "",
                 {}});
  all.push_back(
      {"ply-backslash", "glTF", {{"m.glb", gltf("tex\\t.png")}, {"tex/t.png", p}}, "m.glb", 1, "", {}});
  all.push_back({"ply-backslash",
                 "glTF, encoded",
                 {{"m.glb", gltf("tex%5Ct.png")}, {"tex/t.png", p}},
                 "m.glb",
                 1,
                 "",
                 {}});
  with_mtl("ply-backslash", "MTL", "m.mtl", "tex\\t.png", "tex/t.png", "");
  all.push_back({"ply-backslash",
                 "library",
                 {{"m.obj", obj("mats\\m.mtl")}, {"mats/m.mtl", mtl("t.png")}, {"t.png", p}},
                 "m.obj",
                 1,
                 "",
                 {}});
}

void add_texts(std::vector<Case>& all) {
  const std::string p = kPicture, bom = "\xef\xbb\xbf";
  const auto both = [&](const std::string& row, const std::string& input, const std::string& model,
                        const std::string& library, const std::string& codes,
                        std::function<void(const ImportedModel&)> more = {}) {
    all.push_back({row,
                   input,
                   {{"m.obj", model}, {"m.mtl", library}, {"t.png", p}},
                   "m.obj",
                   1,
                   codes,
                   std::move(more)});
  };
  both("mtl-bom", "MTL", obj("m.mtl"), bom + mtl("t.png"), "");
  both("mtl-bom", "OBJ", bom + obj("m.mtl"), mtl("t.png"), "");
  both("mtl-bom", "both", bom + obj("m.mtl"), bom + mtl("t.png"), "");
  all.push_back({"mtl-bom",
                 "PLY",
                 {{"m.ply", bom + ply("comment TextureFile t.png\n")}, {"t.png", p}},
                 "m.ply",
                 1,
                 "",
                 {}});
  all.push_back(
      {"mtl-bom",
       "STL",
       {{"m.stl", bom + "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                        "endloop\nendfacet\nendsolid a\n"}},
       "m.stl",
       0,
       "",
       {}});
  both("UTF-16", "MTL", obj("m.mtl"), utf16(mtl("t.png")), "");
  both("UTF-16", "OBJ", utf16(obj("m.mtl")), mtl("t.png"), "");
  both("statement-case", "MtlLib, UseMtl", "MtlLib m.mtl\n" + kVertices + "UseMtl m\nf 1/1 2/2 3/3\n",
       mtl("t.png"), "");
  both("statement-case", "all upper",
       "MTLLIB m.mtl\nV 0 0 0\nV 1 0 0\nV 0 1 0\nVT 0 0\nUSEMTL m\nF 1/1 2/1 3/1\n", mtl("t.png"), "");
  both("statement-case", "MTL", obj("m.mtl"), "NEWMTL m\nMAP_KD t.png\n", "");
  both("statement-case", "tabs", "mtllib\tm.mtl\n" + kVertices + "usemtl\tm\nf\t1/1\t2/2\t3/3\n",
       "newmtl\tm\nmap_Kd\tt.png\n", "");
  both("statement-case", "unknown words", obj("m.mtl") + "foo 1\nFOO 2\n", mtl("t.png") + "glow 1\n",
       "left-out");
  both("latin1-credit", "OBJ", "# author: Museum f\xfcr Kunst\n" + obj("m.mtl"), mtl("t.png"),
       "text-encoding",
       [](const ImportedModel& m) { EXPECT_EQ(m.about.creator, "Museum f\xc3\xbcr Kunst"); });
  both("latin1-credit", "OBJ and MTL: one warning", "# title: B\xfcste\n" + obj("m.mtl"),
       "# \xe9\n" + mtl("t.png"), "text-encoding",
       [](const ImportedModel& m) { EXPECT_EQ(testing::count_notes(m.model, "text-encoding"), 1); });
  both("latin1-credit", "Windows-1252",
       "# author: \x93"
       "A\x94 \x80\n" +
           obj("m.mtl"),
       mtl("t.png"), "text-encoding", [](const ImportedModel& m) {
         EXPECT_EQ(m.about.creator,
                   "\xe2\x80\x9c"
                   "A\xe2\x80\x9d \xe2\x82\xac");
       });
  both("latin1-credit", "UTF-8 stays", "# author: f\xc3\xbcr\n" + obj("m.mtl"), mtl("t.png"), "",
       [](const ImportedModel& m) { EXPECT_EQ(m.about.creator, "f\xc3\xbcr"); });
  all.push_back({"latin1-credit",
                 "PLY",
                 {{"m.ply", ply("comment author: M\xfcller\ncomment TextureFile t.png\n")}, {"t.png", p}},
                 "m.ply",
                 1,
                 "text-encoding",
                 [](const ImportedModel& m) { EXPECT_EQ(m.about.creator, "M\xc3\xbcller"); }});
}

void add_contents(std::vector<Case>& all) {
  const std::string p = kPicture;
  const auto artec_case = [&](const std::string& input, const std::string& name, const std::string& model,
                              std::size_t pictures, const std::string& codes) {
    all.push_back({"artec-ply",
                   input,
                   {{name, model}, {"p_0.png", p}, {"p_1.png", text(testing::png_bytes(4, 8, 3))}},
                   name,
                   pictures,
                   codes,
                   {}});
  };
  artec_case("comments", "p.ply", artec(kArtecComments, kArtecFaces), 2, "");
  artec_case("no comments", "p.ply", artec("", kArtecFaces), 2, "");
  artec_case("no comments, renamed", "p-small.ply", artec("", kArtecFaces), 2, "");
  artec_case("no comments, another name", "q.ply", artec("", kArtecFaces), 0, "missing-texture");
  artec_case("one texture", "p.ply", artec("comment TextureFile p_0.png\n", kArtecFaces), 1, "");
  std::string odd = kArtecFaces;
  odd.replace(odd.find("1 3 3 3 4 5"), 11, "1 3 3 3 4 9");
  artec_case("an index too large", "p.ply", artec(kArtecComments, odd), 1, "odd-texcoord-list");
  const std::string more =
      "element camera 1\nproperty float f\n" + kArtecFaces.substr(0, kArtecFaces.find("0 3 3"));
  artec_case("an element that nobody knows", "p.ply",
             artec(kArtecComments,
                   more.substr(0, more.find("3 0 2 3\n") + 8) +
                       "0 0 0\n0 1 0\n0 1 1\n1 0 0\n1 0.5 1\n1 0.25 0.75\n7\n0 3 3 0 1 2\n1 3 3 3 4 5\n"),
             2, "left-out");
  for (const std::string face : {"f 1/1/0 2/2/0 3/3/0", "f 1//0 2//0 3//0", "f 1/0 2/0 3/0",
                                 "f 1/0/1 2/0/1 3/0/1", "f 1/1/1 2/2/0 3/3/1", "f 1/0/0 2/0/0 3/0/0"})
    all.push_back({"normal-index-0",
                   face,
                   {{"m.obj", kVertices + "vn 0 0 1\n" + face + "\n"}},
                   "m.obj",
                   0,
                   "index-0",
                   [](const ImportedModel& m) { EXPECT_EQ(m.model.mesh.triangles.size(), 1u); }});
  testing::GltfBuilder shop = testing::quad();
  shop.json["extensionsUsed"] = {"KHR_materials_variants"};
  shop.json["extensions"] = {
      {"KHR_materials_variants", {{"variants", {{{"name", "red"}}, {{"name", "blue"}}}}}}};
  all.push_back({"variants", "glTF", {{"m.glb", text(shop.glb())}}, "m.glb", 0, "left-out", {}});
  testing::GltfBuilder moving = testing::quad();
  moving.json["animations"] = {nlohmann::json::object()};
  all.push_back({"variants", "animations", {{"m.glb", text(moving.glb())}}, "m.glb", 0, "left-out", {}});
  testing::GltfBuilder smiling = testing::quad();
  smiling.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  all.push_back({"variants", "morph targets", {{"m.glb", text(smiling.glb())}}, "m.glb", 0, "left-out", {}});
  all.push_back({"variants",
                 "curves of OBJ",
                 {{"m.obj", kVertices + "f 1 2 3\nvp 0 0\ncurv 0 1 1 2\n"}},
                 "m.obj",
                 0,
                 "left-out",
                 {}});
  all.push_back({"zbrush",
                 "#MRGB",
                 {{"m.obj", "#MRGB ffff0000ff00ff00ff0000ffffffffff\n" + kVertices + "f 1 2 3 4\n"}},
                 "m.obj",
                 0,
                 "",
                 [](const ImportedModel& m) {
                   EXPECT_EQ(m.model.mesh.colours.at(1), (Vec4f{0, 1, 0, 1}));
                 }});
  all.push_back({"smoothing",
                 "s off",
                 {{"m.obj", kVertices + "s off\nf 1 2 3\nf 1 3 4\n"}},
                 "m.obj",
                 0,
                 "",
                 [](const ImportedModel& m) { EXPECT_TRUE(m.normals_by_specification); }});
}

void add_pictures(std::vector<Case>& all) {
  const auto seen = [&](const std::string& input, const std::string& library, const std::string& picture,
                        std::size_t pictures, std::function<void(const ImportedModel&)> more) {
    all.push_back({"alpha-marks-charts",
                   input,
                   {{"m.obj", kLeftHalf}, {"m.mtl", "newmtl m\n" + library}, {"t.png", picture}},
                   "m.obj",
                   pictures,
                   "",
                   std::move(more)});
  };
  seen("OBJ", "map_Kd t.png\n", half_clear(), 1, is_opaque);
  seen("OBJ, moved by -o", "map_Kd -o 1 0 0 t.png\n", half_clear(), 1, is_opaque);
  seen("OBJ, moved to the clear half", "map_Kd -s 2 1 1 t.png\n", half_clear(), 1,
       [](const ImportedModel& m) { EXPECT_EQ(m.model.materials.at(0).alpha_mode, AlphaMode::kMask); });
  std::string as_ply = ply("comment TextureFile t.png\n");
  as_ply.replace(as_ply.find("1 0 0 1 0"), 9, "1 0 0 0.5 0");
  as_ply.replace(as_ply.find("3 0 1 2"), 7, "3 0 1 2");
  all.push_back(
      {"alpha-marks-charts", "PLY", {{"m.ply", as_ply}, {"t.png", half_clear()}}, "m.ply", 1, "", is_opaque});
  const std::array<std::uint8_t, 3> normal{127, 130, 250}, brown{120, 90, 60};
  seen("bump: normals where faces are", "bump t.png\n", half_rgb({normal, brown}), 1, has_normal_map);
  seen("bump: normals where no face is", "bump t.png\n", half_rgb({brown, normal}), 0, is_opaque);
  for (const auto& [what, content] : std::map<std::string, std::string>{
           {"LFS pointer", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n"},
           {"annex pointer", "/annex/objects/SHA256E-s3--0\n"},
           {"HTML", "<!DOCTYPE html><html>"},
           {"ZIP", std::string("PK\3\4\0\0", 6)},
           {"gzip", "\x1f\x8b\x08"},
           {"DVC", "outs:\n- md5: 0\n"},
           {"empty", ""}}) {
    all.push_back({"pointer",
                   "MTL " + what,
                   {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", content}},
                   "m.obj",
                   0,
                   "missing-texture",
                   is_red});
    all.push_back({"pointer",
                   "PLY " + what,
                   {{"m.ply", ply("comment TextureFile t.png\n")}, {"t.png", content}},
                   "m.ply",
                   0,
                   "missing-texture",
                   {}});
    all.push_back({"pointer",
                   "glTF " + what,
                   {{"m.glb", gltf("t.png")}, {"t.png", content}},
                   "m.glb",
                   0,
                   "missing-texture",
                   {}});
  }
  const std::string tiles =
      "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\nvt 1 1\nusemtl m\n"
      "f 1/1 2/2 3/3\nf 1/2 2/4 3/5\n";
  const std::string a = kPicture, b = text(testing::png_bytes(4, 8, 3));
  all.push_back({"udim",
                 "MTL",
                 {{"m.obj", tiles}, {"m.mtl", mtl("s.<UDIM>.png")}, {"s.1001.png", a}, {"s.1002.png", b}},
                 "m.obj",
                 2,
                 "",
                 {}});
  all.push_back({"udim",
                 "a tile is not there",
                 {{"m.obj", tiles}, {"m.mtl", mtl("s.<UDIM>.png")}, {"s.1001.png", a}},
                 "m.obj",
                 1,
                 "missing-texture",
                 {}});
  all.push_back({"udim",
                 "PLY",
                 {{"m.ply", ply("comment TextureFile s.<UDIM>.png\n")}, {"s.1001.png", a}},
                 "m.ply",
                 0,
                 "missing-texture",
                 [](const ImportedModel& m) {
                   EXPECT_NE(m.model.notes.at(0).text.find("UDIM tiles are read where an MTL"),
                             std::string::npos);
                 }});
}

std::vector<Case> cases() {
  std::vector<Case> all;
  add_names(all);
  add_texts(all);
  add_contents(all);
  add_pictures(all);
  return all;
}

TEST(Field, EveryRowAndItsSiblings) {
  std::map<std::string, int> tried;
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.row + ": " + c.input);
    ++tried[c.row];
    MemoryResolver files;
    for (const auto& [name, content] : c.files) files.files[name] = testing::bytes_of(content);
    const ImportedModel m = import_model(c.model, files.files.at(c.model), files, {}, {});
    EXPECT_EQ(m.model.images.size(), c.pictures);
    EXPECT_EQ(told(m), c.told) << (m.model.notes.empty() ? "" : m.model.notes.back().text);
    if (c.expect) c.expect(m);
  }
  for (const char* row :
       {"mtl-folder", "artec-ply", "absolute-name", "mtl-bom", "statement-case", "name-case", "ply-backslash",
        "alpha-marks-charts", "latin1-credit", "normal-index-0"})
    EXPECT_GE(tried[row], 5) << row;
}

TEST(Field, ChunksRounded) {
  testing::Random random{3};
  MemoryResolver files;
  const Bytes glb =
      testing::chunks_glb(testing::textured_sphere(3, .1), 16, testing::ChunkKind::kFloat, random);
  const ImportedModel m = import_model("origins.glb", glb, files, {}, {});
  const ConditionedMesh c = condition_mesh(m.model.mesh, true, {}, RunContext{});
  EXPECT_EQ(c.report.boundary_edges, 0u);
  EXPECT_GT(c.report.rounded_positions, 0u);
}

// A face and the same face turned round, in every way that materials say which of them is seen.
TEST(Field, ReversedTwins) {
  const auto triangles = [](const std::string& mode, bool double_sided, bool moved_uvs) {
    testing::GltfBuilder b;
    const int p = b.attribute<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0}, "VEC3");
    const float u = moved_uvs ? .5f : 0;
    const int t = b.attribute<float>({0, 0, 1, 0, 0, 1, u, 0, u, 1, 1 + u, 0}, "VEC2");
    b.push("materials", {{"alphaMode", mode}, {"doubleSided", double_sided}});
    b.mesh({{"POSITION", p}, {"TEXCOORD_0", t}}, {{"material", 0}});
    b.node({{"mesh", 0}});
    MemoryResolver files;
    const ImportedModel m = import_model("t.glb", b.glb(), files, {}, {});
    EXPECT_EQ(m.model.mesh.uv0[m.model.mesh.triangles[0][1]], (Vec2f{1, 0})) << "the first stays";
    return std::pair(m.model.mesh.triangles.size(), told(m));
  };
  using Result = std::pair<std::size_t, std::string>;
  EXPECT_EQ(triangles("OPAQUE", true, false), Result(1, ""));
  EXPECT_EQ(triangles("OPAQUE", true, true), Result(1, "left-out"))
      << "nobody sees it, but it was another picture";
  EXPECT_EQ(triangles("OPAQUE", false, false), Result(2, "")) << "each shows its side";
  EXPECT_EQ(triangles("MASK", true, false), Result(1, ""));
  EXPECT_EQ(triangles("MASK", true, true), Result(2, "")) << "one shows through the other";
  EXPECT_EQ(triangles("BLEND", true, false), Result(2, "")) << "both count";
}

TEST(Field, ReversedTwinsOfAWholeScanWithSharedNormals) {
  const Mesh sphere = testing::textured_sphere(2, .1);
  std::string once, twice;
  for (std::size_t i = 0; i < sphere.positions.size(); ++i) {
    const Vec3f &p = sphere.positions[i], &n = sphere.normals[i];
    for (const auto& [word, v] : {std::pair("v ", p), std::pair("vn ", n)})
      once += word + std::to_string(v.x) + " " + std::to_string(v.y) + " " + std::to_string(v.z) + "\n";
  }
  twice = once;
  for (const Triangle& t : sphere.triangles) {
    const auto corner = [](std::uint32_t w) {
      return " " + std::to_string(w + 1) + "//" + std::to_string(w + 1);
    };
    const std::string face = "f" + corner(t[0]) + corner(t[1]) + corner(t[2]) + "\n";
    once += face;
    twice += face + "f" + corner(t[2]) + corner(t[1]) + corner(t[0]) + "\n";
  }
  const auto mesh_of = [](const std::string& obj_text) {
    MemoryResolver files;
    return import_model("m.obj", testing::bytes_of(obj_text), files, {}, {}).model.mesh;
  };
  EXPECT_TRUE(mesh_of(once) == mesh_of(twice));
}

}  // namespace
}  // namespace texmesh
