// Models that are no glTF: OBJ with MTL, PLY, STL, range scans; archives of models.
#include <algorithm>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/import/archive/archive_files.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/uri.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/reader_limits.h"
#include "tests/support/zip_writer.h"

namespace texmesh::fuzz {
namespace {

using namespace std::string_view_literals;

template <class Import>
bool unless_input_error(const Import& import) {
  try {
    import();
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

/// The parts before and behind the first NUL.
std::pair<ByteSpan, Bytes> at_nul(ByteSpan input) {
  const auto nul = std::ranges::find(input, 0);
  const auto length = static_cast<std::size_t>(nul - input.begin());
  const ByteSpan rest = input.subspan(std::min(length + 1, input.size()));
  return {input.first(length), {rest.begin(), rest.end()}};
}

/// The OBJ, a NUL, the library.
bool read_obj(ByteSpan input) {
  const auto [obj, mtl] = at_nul(input);
  MemoryFiles files;
  files.files["a.mtl"] = mtl;
  return unless_input_error([&, o = obj] { import_obj("fuzz", o, files, reader_limits(), {}); });
}

bool read_mtl(ByteSpan input) {
  static const Bytes obj = to_bytes(
      "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\nusemtl n\nf 1/1 2/1 3/1\n");
  MemoryFiles files;
  files.files["a.mtl"].assign(input.begin(), input.end());
  return unless_input_error([&] { import_obj("fuzz", obj, files, reader_limits(), {}); });
}

bool read_ply(ByteSpan input) {
  MemoryFiles files;
  return unless_input_error([&] { import_ply("fuzz", input, files, reader_limits(), {}); });
}

bool read_archive(ByteSpan input) {
  NoFiles none;
  return unless_input_error([&] { import_model("fuzz.zip", input, none, reader_limits(), {}); });
}

bool read_stl(ByteSpan input) {
  return unless_input_error([&] { import_stl("fuzz", input, reader_limits(), {}); });
}

/// The JSON, a NUL, the grid.
bool read_range(ByteSpan input) {
  const auto [json, grid] = at_nul(input);
  MemoryFiles files;
  files.files["r.pgm"] = grid;
  return unless_input_error([&, j = json] { import_range_scan("fuzz.json", j, files, reader_limits(), {}); });
}

bool read_cyberware(ByteSpan input) {
  MemoryFiles files;
  return unless_input_error([&] { import_range_scan("fuzz.cyl", input, files, reader_limits(), {}); });
}

/// A name, a NUL, the name of a file that says it. Whatever the name is, no resolver is asked for one that
/// leads out of the model's folder.
bool read_name(ByteSpan input) {
  struct Beneath : MemoryFiles {
    std::optional<Bytes> read(const std::string& uri, std::uint64_t) override {
      if (is_preview_uri(uri)) return std::nullopt;
      if (uri.starts_with('/') || has_scheme(uri) || ("/" + uri + "/").find("/../") != uri.npos) std::abort();
      return std::nullopt;
    }
  } files;
  files.files["Scan.JPG"] = {};
  const auto [name, said_in] = at_nul(input);
  return unless_input_error([&, n = name, s = said_in] {
    for (const bool is_uri : {false, true}) {
      Notes notes;
      find_file({{n.begin(), n.end()}, {s.begin(), s.end()}, is_uri}, files, 1, notes, "");
    }
  });
}

/// Names of an archive's files, one a line (@ before it: a link), a NUL, the name that is looked for. What
/// the archive offers in its place is there.
bool read_archived_name(ByteSpan input) {
  constexpr std::size_t kMostFiles = 64;
  const auto [names, wanted] = at_nul(input);
  std::vector<testing::ZipFile> files{{"d/a.obj", "x", false}};
  for (const std::string_view line : pieces_of(text_of(names), '\n')) {
    const bool is_link = line.starts_with('@');
    if (files.size() < kMostFiles)
      files.push_back({std::string(line.substr(is_link)), "x", false, 0, ~0ull, is_link ? 0120777u : 0});
  }
  const Bytes zip = testing::zip_of(files);
  return unless_input_error([&, w = wanted] {
    ArchiveFiles archive("fuzz.zip", zip, 1 << 20);
    const std::string name(w.begin(), w.end());
    for (const std::string& other : archive.similar(name))
      if (!archive.read(other, 1)) std::abort();
    Notes notes;
    find_file({name, "", false}, archive, 1, notes, "");
  });
}

// ---- seeds

std::vector<Bytes> archived_name_seeds() {
  return {to_bytes("d/C.png\ne/c.PNG\n@c.png\0c.png"sv),
          to_bytes("B\x81.png\nd/\x81/B\xfc.png\0b\xc3\xbc.jpg"sv),
          to_bytes("d\\t\\x.png\n__MACOSX/._x.png\0..\\t\\x.png"sv)};
}

std::vector<Bytes> name_seeds() {
  return {to_bytes("\"C:\\scans\\a b.png\" # c"sv), to_bytes("../tex/./%2e%2e/scan%20a.jpg\0mats/m.mtl"sv),
          to_bytes("scan.jpg"sv), to_bytes("http://h/x/scan.jpg?a#b"sv)};
}

std::vector<Bytes> obj_seeds() {
  return {
      to_bytes(
          "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0 0.5 0.5 0.5\nv 1 1 0\nvn 0 0 1\nvt 0 0\nvt 1 0\ng a\ns 1\nusemtl m\n"
          "f 1/1/1 2/2/1 3/1/1\nf -1//1 -2//1 -3//1\nf 1 2 4 \\\n3\n\0newmtl m\nKd 1 0 0\nmap_Kd a.png\n"sv),
      to_bytes("# t\nv 1e0 -.5 2.\nv 1 2 3\nv 4 5 7\nf 1 2 3\nl 1 2\np 1\n")};
}

std::vector<Bytes> mtl_seeds() {
  return {to_bytes(
      "newmtl m\nKa 0 0 0\nKd 1 .5 0\nKs 0 0 0\nNs 20\nd 0.5\nTr 0.5\nillum 2\nmap_Kd -s 1 1 1 -o 0 0 0 -clamp on a b.png\n"
      "bump -bm 0.5 n.png\nnewmtl n\nPr 0.5\nPm 1\nnorm n.png\nmap_d a.png\nmap_Ke e.png\n")};
}

std::vector<Bytes> ply_seeds() {
  const std::string header =
      " 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n";
  std::vector<Bytes> list{to_bytes("ply\nformat ascii" + header +
                                   "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2 6 0 0 1 0 0 1\n")};
  for (const bool big : {false, true}) {
    BytesOut out;
    const auto f32 = [&](float x) {
      Bytes b(4);
      std::memcpy(b.data(), &x, 4);
      if (big) std::ranges::reverse(b);
      out.raw(b);
    };
    out.text(std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian" + header);
    for (int v = 0; v < 3; ++v) {
      f32(v == 1), f32(v == 2), f32(0);
      out.u8(1), out.u8(2), out.u8(3);
    }
    out.u8(3);
    for (unsigned v = 0; v < 3; ++v) out.u32(big ? v << 24 : v);
    out.u8(6);
    for (int k = 0; k < 6; ++k) f32(k == 2 || k == 5);
    list.push_back(out.finish());
  }
  list.push_back(to_bytes(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n6 0 1 2 3 -1 0\n"));
  return list;
}

std::vector<Bytes> archive_seeds() {
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  BytesOut path;  // the name in UTF-8 beside the one in other bytes
  path.u16(0x7075);
  path.u16(10);
  path.u8(1);
  path.u32(crc32_z(0, reinterpret_cast<const Bytef*>("?.mtl"), 5));
  path.text("a.mtl");
  const Bytes extra = path.finish();
  return {
      testing::zip_of({{"a.obj", obj, false}}),
      testing::zip_of({{"a.obj", "mtllib A.mtl\nusemtl m\n" + obj, false},
                       {"?.mtl", "newmtl m\nmap_Kd t\n", false, 0, ~0ull, 0, {extra.begin(), extra.end()}},
                       {"x/\x81T", "x", false},
                       {"t", "x/T", false, 0, ~0ull, 0120777}}),
      testing::zip_of({{"odm_textured_model_geo.obj", obj},
                       {"coords.txt", "WGS84 UTM 32N\n", false},
                       {"license.txt", "* title:\tA\n* license type:\tCC0-1.0 (https://a.b/)\n", false}})};
}

std::vector<Bytes> stl_seeds() {
  BytesOut out;
  out.text(std::string(80, ' '));
  out.u32(2);
  for (unsigned t = 0; t < 2; ++t) {
    for (unsigned k = 0; k < 12; ++k) out.f32(static_cast<float>(k * k % (5 + t)));
    out.u16(0);
  }
  return {
      out.finish(),
      to_bytes(
          "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\nendsolid a\n")};
}

std::vector<Bytes> range_seeds() {
  BytesOut out;
  out.text(
      R"({"version":1,"type":"cylindrical-range-scan","y_step":0.5,"grid":"r.pgm","radius_scale":0.01,"valid_max":300})");
  out.u8(0);
  out.text("P5\n# a\n4 3\n65535\n");
  for (unsigned k = 0; k < 12; ++k) out.u8(1), out.u8(k);
  return {out.finish()};
}

std::vector<Bytes> cyberware_seeds() {
  BytesOut out;
  out.text(
      "Cyberware Digitizer Data\nNAME=head\nSPACE=CYLINDRICAL\nNLG=4\nLGINCR=1570796\nLGMIN=0\nNLT=3\nLTINCR=700\nLGSHIFT=0\n"
      "RSHIFT=5\nSCALE=100.0\nTHETA_RIGHTHAND=TRUE\nDATA=\n");
  for (unsigned k = 0; k < 12; ++k) out.u8(12), out.u8(53 + k);
  return {out.finish()};
}

// ---- what the texts are made of

constexpr std::string_view kObjWords[] = {
    "v ",   "vt ", "vn ",   "f ",   "g ", "o ", "s ",    "l ",  "usemtl ",     "mtllib a.mtl",
    "\\\n", "#",   "1/1/1", "1//1", "-1", "0",  "1e300", "nan", "99999999999", "\0newmtl m\n"sv};
constexpr std::string_view kMtlWords[] = {
    "newmtl m",  "newmtl n",   "Ka ",         "Kd ",     "Ks ",     "Ns ",     "Ni ",    "Tf ",
    "Tr ",       "d ",         "illum ",      "map_Kd ", "map_Ks ", "map_Ke ", "map_d ", "bump ",
    "map_Bump ", "norm ",      "disp ",       "refl ",   "-s ",     "-o ",     "-t ",    "-mm ",
    "-bm ",      "-clamp on ", "-imfchan r ", "Pr ",     "Pm ",     "Ke ",     "xyz ",   "spectral a.rfl"};
constexpr std::string_view kPlyWords[] = {"ply\n",
                                          "format ascii 1.0\n",
                                          "format binary_little_endian 1.0\n",
                                          "element vertex ",
                                          "element face ",
                                          "element tristrips ",
                                          "element material ",
                                          "property ",
                                          "list ",
                                          "uchar ",
                                          "char ",
                                          "short ",
                                          "ushort ",
                                          "int ",
                                          "uint ",
                                          "float ",
                                          "double ",
                                          "x\n",
                                          "nx\n",
                                          "s\n",
                                          "t\n",
                                          "red\n",
                                          "alpha\n",
                                          "vertex_indices\n",
                                          "texcoord\n",
                                          "texnumber\n",
                                          "comment TextureFile a\n",
                                          "obj_info ",
                                          "end_header\n",
                                          "4000000000",
                                          "-1",
                                          "nan",
                                          "1e300"};
constexpr std::string_view kNameWords[] = {"..", "/",       "\\", "%2f", "%2e", "%00",
                                           "C:", "file://", "\"", " #",  ".",   "a"};
constexpr std::string_view kStlWords[] = {"solid ",    "facet normal ", "outer loop\n", "vertex ",
                                          "endloop\n", "endfacet\n",    "endsolid",     "color",
                                          "COLOR=",    "nan",           "1e300"};
constexpr std::string_view kRangeWords[] = {"\"y_top\":",
                                            "\"alpha_step_deg\":",
                                            "\"alpha_start_deg\":",
                                            "\"clockwise\":true",
                                            "\"radius_offset\":",
                                            "\"valid_min\":",
                                            "\"max_radius_step\":",
                                            "\"texture\":",
                                            "P5\n",
                                            "255\n",
                                            "65535\n",
                                            "1e300",
                                            "99999"};
constexpr std::string_view kArchiveWords[] = {"PK\3\4", "PK\1\2", "PK\5\6", "PK\6\6",
                                              "PK\6\7", "../",    ".obj"};
constexpr std::string_view kCyberwareWords[] = {
    "NLG=",        "NLT=",           "LGINCR=", "LTINCR=",           "LGSHIFT=", "RSHIFT=",
    "LGMIN=",      "LGMAX=",         "SCALE=",  "SPACE=CYLINDRICAL", "DATA=\n",  "THETA_RIGHTHAND=FALSE",
    "FILLED=TRUE", "INSIDE_OUT=TRUE"};

template <std::size_t kCount>
Target text_target(const char* name, bool (*run)(ByteSpan), std::vector<Bytes> (*seeds)(),
                   const std::string_view (&words)[kCount]) {
  return {name, false, run, seeds, Shape::kBytes, nullptr, {std::begin(words), std::end(words)}};
}

}  // namespace

void add_scan_targets(std::vector<Target>& list) {
  list.insert(list.end(), {text_target("obj", read_obj, obj_seeds, kObjWords),
                           text_target("mtl", read_mtl, mtl_seeds, kMtlWords),
                           text_target("ply", read_ply, ply_seeds, kPlyWords),
                           text_target("name", read_name, name_seeds, kNameWords),
                           text_target("archive", read_archive, archive_seeds, kArchiveWords),
                           text_target("archived_name", read_archived_name, archived_name_seeds, kNameWords),
                           text_target("stl", read_stl, stl_seeds, kStlWords),
                           text_target("range", read_range, range_seeds, kRangeWords),
                           text_target("cyberware", read_cyberware, cyberware_seeds, kCyberwareWords)});
}

}  // namespace texmesh::fuzz
