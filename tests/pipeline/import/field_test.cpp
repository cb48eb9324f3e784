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

namespace texmesh::field_test {

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

using Files = std::vector<std::pair<std::string, std::string>>;
using Expect = std::function<void(const ImportedModel&)>;

/// The first file is the model.
Case with(const std::string& row, const std::string& input, const Files& files, std::size_t pictures,
          const std::string& codes, Expect expect = {}) {
  return {row, input, {files.begin(), files.end()}, files[0].first, pictures, codes, std::move(expect)};
}
/// An OBJ whose library names a picture that is there.
Case with_mtl(const std::string& row, const std::string& input, const std::string& library,
              const std::string& written, const std::string& there, const std::string& codes) {
  return with(row, input, {{"m.obj", obj(library)}, {library, mtl(written)}, {there, kPicture}}, 1, codes);
}
Case with_text(const std::string& row, const std::string& input, const std::string& model,
               const std::string& library, const std::string& codes, Expect expect = {}) {
  return with(row, input, {{"m.obj", model}, {"m.mtl", library}, {"t.png", kPicture}}, 1, codes,
              std::move(expect));
}
Case with_ply(const std::string& row, const std::string& input, const std::string& written,
              const std::string& there, const std::string& codes) {
  return with(row, input, {{"m.ply", ply("comment TextureFile " + written + "\n")}, {there, kPicture}}, 1,
              codes);
}

const Case kNames[] = {
    with_mtl("mtl-folder", "beside the library", "mats/m.mtl", "t.png", "mats/t.png", ""),
    with_mtl("mtl-folder", "from the model", "mats/m.mtl", "mats/t.png", "mats/t.png", ""),
    with_mtl("mtl-folder", "beside the model", "mats/m.mtl", "t.png", "t.png", ""),
    with_mtl("mtl-folder", "below the library", "mats/m.mtl", "tex/t.png", "mats/tex/t.png", ""),
    with_mtl("mtl-folder", "up from the library", "mats/m.mtl", "..\\t.png", "t.png", ""),
    with_mtl("mtl-folder", "two folders down", "a/b/m.mtl", "../t.png", "a/t.png", ""),
    with("absolute-name", "library",
         {{"m.obj", obj("D:\\x\\m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", kPicture}}, 1, "outside-name"),
    with_mtl("name-case", "picture", "m.mtl", "textured_mesh.jpg", "Textured_Mesh.JPG", "similar-name"),
    with_mtl("name-case", "folder", "m.mtl", "TEX/t.png", "tex/T.png", "similar-name"),
    with_mtl("name-case", "composed", "m.mtl", "E\xCC\x81.png", "\xC3\x89.png", "similar-name"),
    with_mtl("name-case", "decomposed", "m.mtl", "\xC3\xA9.png", "E\xCC\x81.png", "similar-name"),
    with("name-case", "library", {{"m.obj", obj("M.MTL")}, {"m.mtl", mtl("t.png")}, {"t.png", kPicture}}, 1,
         "similar-name"),
    with("name-case", "two that may be meant",
         {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.png")}, {"T.png", kPicture}, {"t.PNG", kPicture}}, 0,
         "missing-texture"),
    with_ply("ply-backslash", "PLY", "tex\\t.png", "tex/t.png", ""),
    with_ply("ply-backslash", "PLY, quoted", "\".\\tex\\t.png\"", "tex/t.png", ""),
    with("ply-backslash", "glTF", {{"m.glb", gltf("tex\\t.png")}, {"tex/t.png", kPicture}}, 1, ""),
    with("ply-backslash", "glTF, encoded", {{"m.glb", gltf("tex%5Ct.png")}, {"tex/t.png", kPicture}}, 1, ""),
    with_mtl("ply-backslash", "MTL", "m.mtl", "tex\\t.png", "tex/t.png", ""),
    with("ply-backslash", "library",
         {{"m.obj", obj("mats\\m.mtl")}, {"mats/m.mtl", mtl("t.png")}, {"t.png", kPicture}}, 1, ""),
    with_mtl("stale-name", "another ending", "m.mtl", "tex/t.tif", "tex/T.png", "other-ending"),
    with("stale-name", "two other endings",
         {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.tif")}, {"t.png", kPicture}, {"t.jpg", kPicture}}, 0,
         "missing-texture"),
    with("stale-name", "an ending that is no picture's",
         {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.txt", kPicture}}, 0, "missing-texture"),
    with_ply("stale-name", "PLY, another ending", "t.bmp", "t.png", "other-ending"),
    with("stale-name", "glTF, another ending", {{"m.glb", gltf("t.jpg")}, {"t.png", kPicture}}, 1,
         "other-ending"),
    with("stale-name", "library renamed with its model",
         {{"m.obj", obj("scan.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", kPicture}}, 1, "renamed-mtl"),
    with("stale-name", "a library of another name is another model's",
         {{"m.obj", obj("scan.mtl")}, {"n.mtl", mtl("t.png")}, {"t.png", kPicture}}, 0, "missing-mtl"),
    with_mtl("moved-file", "MTL, the picture beside the model", "m.mtl", "tex/t.png", "t.png", "moved-file"),
    with_mtl("moved-file", "MTL", "m.mtl", "t.png", "textures/t.png", "moved-file"),
    with_mtl("moved-file", "beside the library", "mats/m.mtl", "t.png", "mats/textures/t.png", "moved-file"),
    with_mtl("moved-file", "out of the folder", "m.mtl", "../textures/t.png", "textures/t.png", "moved-file"),
    with_mtl("moved-file", "a similar name wins", "m.mtl", "tex/t.png", "tex/T.png", "similar-name"),
    with_ply("moved-file", "PLY", "t.png", "textures/t.png", "moved-file"),
    with("moved-file", "glTF", {{"m.glb", gltf("textures/t.png")}, {"t.png", kPicture}}, 1, "moved-file"),
    with("moved-file", "library",
         {{"m.obj", obj("mats/m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", kPicture}}, 1, "moved-file"),
    with("uri-query", "glTF", {{"m.glb", gltf("t.png?v=1")}, {"t.png", kPicture}}, 1, ""),
    with_mtl("escaped-name", "MTL", "m.mtl", "t%20u.png", "t u.png", ""),
    with_mtl("escaped-name", "a name that has a percent sign", "m.mtl", "50%25.png", "50%25.png", ""),
    with_ply("escaped-name", "PLY", "t%20u.png", "t u.png", ""),
    with("unnamed-texture", "PLY", {{"m.ply", ply("")}, {"m.png", kPicture}}, 1, "unnamed-texture"),
    with("unnamed-texture", "PLY, of another name", {{"m.ply", ply("")}, {"n.png", kPicture}}, 0, ""),
    with("unnamed-texture", "OBJ without a library",
         {{"m.obj", kVertices + "f 1/1 2/2 3/3 4/4\n"}, {"m.JPG", kPicture}}, 1, "unnamed-texture"),
    with("unnamed-texture", "OBJ whose library is missing", {{"m.obj", obj("m.mtl")}, {"m.png", kPicture}}, 1,
         "missing-mtl unnamed-texture"),
    with("unnamed-texture", "OBJ with colours",
         {{"m.obj", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\nf 1/1 2/1 3/1\n"},
          {"m.png", kPicture}},
         0, ""),
    with("unnamed-texture", "OBJ without texture coordinates",
         {{"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}, {"m.png", kPicture}}, 0, "")};

void add_outside_names(std::vector<Case>& all) {
  for (const std::string written :
       {"C:\\Users\\x\\Scans\\t.png", "/data/x/t.png", "../t.png", "file:///data/x/t.png",
        "\\\\server\\share\\t.png", "http://host/t.png"}) {
    const std::string row = "absolute-name";
    all.push_back(with_mtl(row, "MTL " + written, "m.mtl", written, "t.png", "outside-name"));
    all.push_back(with(row, "none " + written, {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl(written)}}, 0,
                       "missing-texture", is_red));
    all.push_back(with_ply(row, "PLY " + written, written, "t.png", "outside-name"));
    all.push_back(
        with(row, "glTF " + written, {{"m.glb", gltf(written)}, {"t.png", kPicture}}, 1, "outside-name"));
  }
}

Expect has_creator(const std::string& name) {
  return [name](const ImportedModel& m) { EXPECT_EQ(m.about.creator, name); };
}
const std::string kMark = "\xef\xbb\xbf";  // a byte order mark

const Case kTexts[] = {
    with_text("mtl-bom", "MTL", obj("m.mtl"), kMark + mtl("t.png"), ""),
    with_text("mtl-bom", "OBJ", kMark + obj("m.mtl"), mtl("t.png"), ""),
    with_text("mtl-bom", "both", kMark + obj("m.mtl"), kMark + mtl("t.png"), ""),
    with("mtl-bom", "PLY", {{"m.ply", kMark + ply("comment TextureFile t.png\n")}, {"t.png", kPicture}}, 1,
         ""),
    with("mtl-bom", "STL",
         {{"m.stl", kMark + "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                            "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n"}},
         0, ""),
    with_text("UTF-16", "MTL", obj("m.mtl"), utf16(mtl("t.png")), ""),
    with_text("UTF-16", "OBJ", utf16(obj("m.mtl")), mtl("t.png"), ""),
    with_text("statement-case", "MtlLib, UseMtl", "MtlLib m.mtl\n" + kVertices + "UseMtl m\nf 1/1 2/2 3/3\n",
              mtl("t.png"), ""),
    with_text("statement-case", "all upper",
              "MTLLIB m.mtl\nV 0 0 0\nV 1 0 0\nV 0 1 0\nVT 0 0\nUSEMTL m\nF 1/1 2/1 3/1\n", mtl("t.png"), ""),
    with_text("statement-case", "MTL", obj("m.mtl"), "NEWMTL m\nMAP_KD t.png\n", ""),
    with_text("statement-case", "tabs", "mtllib\tm.mtl\n" + kVertices + "usemtl\tm\nf\t1/1\t2/2\t3/3\n",
              "newmtl\tm\nmap_Kd\tt.png\n", ""),
    with_text("statement-case", "unknown words", obj("m.mtl") + "foo 1\nFOO 2\n", mtl("t.png") + "glow 1\n",
              "left-out"),
    with_text("latin1-credit", "OBJ", "# author: Museum f\xfcr Kunst\n" + obj("m.mtl"), mtl("t.png"),
              "text-encoding", has_creator("Museum f\xc3\xbcr Kunst")),
    with_text("latin1-credit", "OBJ and MTL: one warning", "# title: B\xfcste\n" + obj("m.mtl"),
              "# \xe9\n" + mtl("t.png"), "text-encoding",
              [](const ImportedModel& m) { EXPECT_EQ(testing::count_notes(m.model, "text-encoding"), 1); }),
    with_text("latin1-credit", "Windows-1252", "# author: \x93\x41\x94 \x80\n" + obj("m.mtl"), mtl("t.png"),
              "text-encoding", has_creator("\xe2\x80\x9c\x41\xe2\x80\x9d \xe2\x82\xac")),
    with_text("latin1-credit", "UTF-8 stays", "# author: f\xc3\xbcr\n" + obj("m.mtl"), mtl("t.png"), "",
              has_creator("f\xc3\xbcr")),
    with("latin1-credit", "PLY",
         {{"m.ply", ply("comment author: M\xfcller\ncomment TextureFile t.png\n")}, {"t.png", kPicture}}, 1,
         "text-encoding", has_creator("M\xc3\xbcller"))};

Case with_artec(const std::string& input, const std::string& name, const std::string& model,
                std::size_t pictures, const std::string& codes) {
  return with("artec-ply", input,
              {{name, model}, {"p_0.png", kPicture}, {"p_1.png", text(testing::png_bytes(4, 8, 3))}},
              pictures, codes);
}
std::string artec_with_camera() {
  std::string faces = kArtecFaces;
  faces.insert(faces.find("end_header"), "element camera 1\nproperty float f\n");
  return artec(kArtecComments, faces + "7\n");
}
std::string artec_with_large_index() {
  std::string faces = kArtecFaces;
  faces.replace(faces.find("1 3 3 3 4 5"), 11, "1 3 3 3 4 9");
  return artec(kArtecComments, faces);
}
Case lost_of(const std::string& input, const std::function<void(nlohmann::json&)>& change) {
  testing::GltfBuilder b = testing::quad();
  change(b.json);
  return with("variants", input, {{"m.glb", text(b.glb())}}, 0, "left-out");
}
Expect has_triangles(std::size_t count) {
  return [count](const ImportedModel& m) { EXPECT_EQ(m.model.mesh.triangles.size(), count); };
}
Case with_face(const std::string& row, const std::string& faces, const std::string& codes,
               std::size_t triangles) {
  return with(row, faces, {{"m.obj", kVertices + "vn 0 0 1\n" + faces + "\n"}}, 0, codes,
              has_triangles(triangles));
}
/// A face that is good and one of these corners.
Case with_ply_face(const std::string& corners) {
  std::string file = ply("");
  file.replace(file.find("element face 1"), 14, "element face 2");
  return with("broken-face", "PLY " + corners, {{"m.ply", file + corners + "\n"}}, 0, "broken-face left-out",
              has_triangles(1));
}

const Case kContents[] = {
    with_artec("comments", "p.ply", artec(kArtecComments, kArtecFaces), 2, ""),
    with_artec("no comments", "p.ply", artec("", kArtecFaces), 2, ""),
    with_artec("no comments, renamed", "p-small.ply", artec("", kArtecFaces), 2, ""),
    with_artec("no comments, another name", "q.ply", artec("", kArtecFaces), 0, "missing-texture"),
    with_artec("one texture", "p.ply", artec("comment TextureFile p_0.png\n", kArtecFaces), 1,
               "odd-texture-number"),
    with_artec("an index too large", "p.ply", artec_with_large_index(), 1, "odd-texcoord-list"),
    with_artec("an element that nobody knows", "p.ply", artec_with_camera(), 2, "left-out"),
    with_face("normal-index-0", "f 1/1/0 2/2/0 3/3/0", "index-0", 1),
    with_face("normal-index-0", "f 1//0 2//0 3//0", "index-0", 1),
    with_face("normal-index-0", "f 1/0 2/0 3/0", "index-0", 1),
    with_face("normal-index-0", "f 1/0/1 2/0/1 3/0/1", "index-0", 1),
    with_face("normal-index-0", "f 1/1/1 2/2/0 3/3/1", "index-0", 1),
    with_face("normal-index-0", "f 1/0/0 2/0/0 3/0/0", "index-0", 1),
    with_face("broken-face", "f 0 1 2\nf 1 2 3", "broken-face left-out", 1),
    with_face("broken-face", "f 1 2 5\nf 1 2 3", "broken-face left-out", 1),
    with_face("broken-face", "f 1 2 3\nf 1 2 3 99999999999", "broken-face left-out", 1),
    with_face("broken-face", "f -1 -2 -5\nf -1 -2 -3", "broken-face left-out", 1),
    with_face("broken-face", "s off\nf 1 2 3\nf 9 2 3\ns 1\nf 1 3 4", "broken-face left-out", 2),
    with_face("broken-face", "f 1/9 2/2 3/3", "index-beyond", 1),
    with_face("broken-face", "f 1//7 2//-8 3//1", "index-beyond", 1),
    with_ply_face("3 0 1 3"),
    with_ply_face("3 0 1 -1"),
    with_ply_face("3 0 1 1.5"),
    with_ply_face("4 0 1 2 7000000000"),
    lost_of("glTF",
            [](nlohmann::json& j) {
              j["extensionsUsed"] = {"KHR_materials_variants"};
              j["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "red"}}, {{"name", "blue"}}};
            }),
    lost_of("animations", [](nlohmann::json& j) { j["animations"] = {nlohmann::json::object()}; }),
    lost_of("morph targets",
            [](nlohmann::json& j) {
              j["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
            }),
    with("variants", "curves of OBJ", {{"m.obj", kVertices + "f 1 2 3\nvp 0 0\ncurv 0 1 1 2\n"}}, 0,
         "left-out"),
    with("zbrush", "#MRGB",
         {{"m.obj", "#MRGB ffff0000ff00ff00ff0000ffffffffff\n" + kVertices + "f 1 2 3 4\n"}}, 0, "",
         [](const ImportedModel& m) {
           EXPECT_EQ(m.model.mesh.colours.at(1), (Vec4f{0, 1, 0, 1}));
         }),
    with("smoothing", "s off", {{"m.obj", kVertices + "s off\nf 1 2 3\nf 1 3 4\n"}}, 0, "",
         [](const ImportedModel& m) { EXPECT_TRUE(m.normals_by_specification); })};

Case with_seen(const std::string& input, const std::string& library, const std::string& picture,
               std::size_t pictures, Expect expect) {
  return with("alpha-marks-charts", input,
              {{"m.obj", kLeftHalf}, {"m.mtl", "newmtl m\n" + library}, {"t.png", picture}}, pictures, "",
              std::move(expect));
}
std::string left_half_ply() {
  std::string out = ply("comment TextureFile t.png\n");
  return out.replace(out.find("1 0 0 1 0"), 9, "1 0 0 0.5 0");
}
constexpr std::array<std::uint8_t, 3> kNormal{127, 130, 250}, kBrown{120, 90, 60};

const Case kPictures[] = {
    with_seen("OBJ", "map_Kd t.png\n", half_clear(), 1, is_opaque),
    with_seen("OBJ, moved by -o", "map_Kd -o 1 0 0 t.png\n", half_clear(), 1, is_opaque),
    with_seen(
        "OBJ, moved to the clear half", "map_Kd -s 2 1 1 t.png\n", half_clear(), 1,
        [](const ImportedModel& m) { EXPECT_EQ(m.model.materials.at(0).alpha_mode, AlphaMode::kMask); }),
    with("alpha-marks-charts", "PLY", {{"m.ply", left_half_ply()}, {"t.png", half_clear()}}, 1, "",
         is_opaque),
    with_seen("bump: normals where faces are", "bump t.png\n", half_rgb({kNormal, kBrown}), 1,
              has_normal_map),
    with_seen("bump: normals where no face is", "bump t.png\n", half_rgb({kBrown, kNormal}), 0, is_opaque)};

void add_foreign_files(std::vector<Case>& all) {
  for (const auto& [what, content] :
       Files{{"LFS pointer", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n"},
             {"annex pointer", "/annex/objects/SHA256E-s3--0\n"},
             {"HTML", "<!DOCTYPE html><html>"},
             {"ZIP", std::string("PK\3\4\0\0", 6)},
             {"gzip", "\x1f\x8b\x08"},
             {"DVC", "outs:\n- md5: 0\n"},
             {"empty", ""}}) {
    const std::string row = "pointer", codes = "missing-texture";
    all.push_back(with(row, "MTL " + what,
                       {{"m.obj", obj("m.mtl")}, {"m.mtl", mtl("t.png")}, {"t.png", content}}, 0, codes,
                       is_red));
    all.push_back(with(row, "PLY " + what,
                       {{"m.ply", ply("comment TextureFile t.png\n")}, {"t.png", content}}, 0, codes));
    all.push_back(with(row, "glTF " + what, {{"m.glb", gltf("t.png")}, {"t.png", content}}, 0, codes));
  }
}

/// A triangle in each of the tiles 1001 and 1002, or both in the first one.
std::string tiles_obj(bool two) {
  return "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\nvt 1 1\nusemtl m\n"
         "f 1/1 2/2 3/3\n" +
         std::string(two ? "f 1/2 2/4 3/5\n" : "f 1/1 3/3 4/2\n");
}
std::string tiles_ply(const std::string& name) {
  return "ply\nformat ascii 1.0\ncomment TextureFile " + name +
         "\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n"
         "property float t\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n0 0 1 1 0\n1 0 1 2 0\n0 1 1 1 1\n3 0 1 2\n3 3 4 5\n";
}
std::string tiles_gltf(const std::string& name) {
  testing::GltfBuilder b;
  const int p = b.attribute<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1}, "VEC3");
  const int t = b.attribute<float>({0, 1, 1, 1, 0, 0, 1, 1, 2, 1, 1, 0}, "VEC2");
  b.push("images", {{"uri", name}});
  b.push("textures", {{"source", 0}});
  b.push("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  b.mesh({{"POSITION", p}, {"TEXCOORD_0", t}}, {{"material", 0}});
  b.node({{"mesh", 0}});
  return text(b.glb());
}
void has_two_materials(const ImportedModel& m) {
  ASSERT_EQ(m.model.materials.size(), 2u);
  EXPECT_NE(m.model.mesh.triangle_material[0], m.model.mesh.triangle_material[1]);
}
void has_one_material(const ImportedModel& m) { EXPECT_EQ(m.model.materials.size(), 1u); }

const std::string kSecond = text(testing::png_bytes(4, 8, 3));

void add_tiles(std::vector<Case>& all) {
  const auto add = [&](const std::string& input, const Files& model, bool second, const std::string& codes,
                       Expect expect) {
    Files files = model;
    files.emplace_back("s.1001.png", kPicture);
    if (second) files.emplace_back("s.1002.png", kSecond);
    all.push_back(with("udim", input, files, second ? 2 : 1, codes, std::move(expect)));
  };
  for (const std::string name : {"s.<UDIM>.png", "s.1001.png"}) {
    const bool word = name != "s.1001.png";
    const std::vector<Files> models{{{"m.obj", tiles_obj(true)}, {"m.mtl", mtl(name)}},
                                    {{"m.ply", tiles_ply(name)}},
                                    {{"m.glb", tiles_gltf(word ? "s.%3CUDIM%3E.png" : name)}}};
    for (const Files& model : models) {
      add(model[0].first + " " + name, model, true, "", has_two_materials);
      add(model[0].first + " " + name + ", a tile is not there", model, false, word ? "missing-texture" : "",
          word ? has_two_materials : has_one_material);
    }
  }
  all.push_back(with("udim", "a number, and faces in one tile",
                     {{"m.obj", tiles_obj(false)},
                      {"m.mtl", mtl("s.1001.png")},
                      {"s.1001.png", kPicture},
                      {"s.1002.png", kSecond}},
                     1, "", has_one_material));
  all.push_back(with("udim", "the first tile is not there and has no faces",
                     {{"m.glb", tiles_gltf("s.<UDIM>.png")}, {"s.1002.png", kSecond}}, 1, "missing-texture",
                     has_two_materials));
}

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&all](const auto& table) { all.insert(all.end(), std::begin(table), std::end(table)); };
  add(kNames), add(kTexts), add(kContents), add(kPictures);
  add_outside_names(all);
  add_foreign_files(all);
  add_tiles(all);
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
        "alpha-marks-charts", "latin1-credit", "normal-index-0", "broken-face", "udim"})
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

TEST(Field, AFileWithoutAnyGoodFaceIsRefused) {
  for (const auto& [name, content] :
       Files{{"m.obj", kVertices + "f 1 2 9\nf 0 1 2\n"},
             {"m.ply", ply("").replace(ply("").rfind("3 0 1 2"), 7, "3 0 1 3")}}) {
    MemoryResolver files;
    EXPECT_THROW(import_model(name, testing::bytes_of(content), files, {}, {}), InputError) << name;
  }
}

// The right half is another gloss, which no face shows.
TEST(Field, GlossThatNobodySeesCountsNot) {
  testing::GltfBuilder b;
  const int p = b.attribute<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int t = b.attribute<float>({0, 0, .5f, 0, 0, 1}, "VEC2");
  for (const std::string& picture : {kPicture, half_rgb({{{51, 51, 51}, {255, 0, 0}}})}) {
    b.push("images", {{"bufferView", b.view_of(testing::bytes_of(picture))}, {"mimeType", "image/png"}});
    b.push("textures", {{"source", b.json["images"].size() - 1}});
  }
  const nlohmann::json moved{{"KHR_texture_transform", {{"offset", {1, 1}}}}};
  b.push("materials", {{"extensions",
                        {{"KHR_materials_pbrSpecularGlossiness",
                          {{"diffuseTexture", {{"index", 0}}},
                           {"specularGlossinessTexture", {{"index", 1}, {"extensions", moved}}}}}}}});
  b.mesh({{"POSITION", p}, {"TEXCOORD_0", t}}, {{"material", 0}});
  b.node({{"mesh", 0}});
  MemoryResolver files;
  const ImportedModel m = import_model("t.glb", b.glb(), files, {}, {});
  EXPECT_EQ(told(m), "specular-glossiness-mean");
  const Pixels data = decode_image(
      m.model.images.at(static_cast<std::size_t>(m.model.materials.at(0).metallic_roughness_texture.image)));
  const Pixels colour = decode_image(
      m.model.images.at(static_cast<std::size_t>(m.model.materials.at(0).base_colour_texture.image)));
  EXPECT_LT(data.data[2], 26) << "grey gloss on paint is hardly metal";
  EXPECT_EQ(colour.width_px, 8u);
}

}  // namespace texmesh::field_test
