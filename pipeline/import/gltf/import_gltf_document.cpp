// A stranger's file becomes JSON whose shape is known: the chunks of a GLB, the parser within bounds, and one
// look at the values that the reader uses. tinygltf reads them afterwards (import_gltf_structure.cpp). It
// ignores an optional property of a wrong type, wraps integers to 32 bits and takes a negative index for
// none, and its structures show nothing of that. So the look checks types, lengths and integers, and that
// every index has its element; what tinygltf checks itself (missing properties, strides, types of accessors)
// is left to it.
#include <fmt/format.h>

#include <sstream>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "format/model/material_extensions.h"
#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/import/text_scan.h"
#include "stages/gltf/glb_container.h"

namespace texmesh {
namespace {

constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

std::uint32_t u32(ByteSpan bytes, std::size_t at) { return value_at<std::uint32_t>(bytes.data() + at); }

}  // namespace

void Source::fail(const std::string& place, const std::string& expected, const std::string& found) const {
  throw InputError(file, place, expected, found);
}

void Source::note_once(Severity severity, const std::string& code, const std::string& place,
                       const std::string& text) const {
  for (const Note& n : notes) {
    if (n.code == code) return;
  }
  notes.push_back({severity, code, place, text});
}

Container split_container(const Source& source, ByteSpan bytes) {
  Container c;
  if (bytes.size() < 4 || text_of(bytes.first(4)) != "glTF") {
    c.json = text_of(bytes);
    const std::size_t begin = c.json.find_first_not_of(" \t\r\n\xef\xbb\xbf");
    if (begin == c.json.npos || c.json[begin] != '{')
      source.fail("byte 0", "a GLB, which begins with glTF, or JSON", "neither");
    return c;
  }
  c.is_glb = true;
  if (bytes.size() < kHeaderBytes) {
    source.fail("GLB header", "12 bytes", std::to_string(bytes.size()));
  }
  if (u32(bytes, 4) != 2) source.fail("GLB header", "version 2", std::to_string(u32(bytes, 4)));
  const std::uint32_t length = u32(bytes, 8);
  if (length > bytes.size()) {
    source.fail("GLB header", "a file of " + std::to_string(length) + " bytes",
                std::to_string(bytes.size()) + ": the file is cut off");
  }
  tell_trailing_bytes(source.notes, bytes, length);
  bool has_json = false;
  for (std::size_t at = kHeaderBytes; at < length && !(has_json && c.bin);) {
    const std::string place = "GLB chunk at byte " + std::to_string(at);
    if (length - at < kChunkHeaderBytes) source.fail(place, "8 bytes", std::to_string(length - at));
    const std::uint32_t chunk_bytes = u32(bytes, at), type = u32(bytes, at + 4);
    at += kChunkHeaderBytes;
    if (chunk_bytes > length - at) {
      source.fail(place, "at most " + std::to_string(length - at) + " bytes", std::to_string(chunk_bytes));
    }
    const ByteSpan chunk = bytes.subspan(at, chunk_bytes);
    if (!has_json) {
      if (type != kGlbJsonChunk) source.fail(place, "a JSON chunk first", "another type");
      c.json = text_of(chunk);
      has_json = true;
    } else if (type == kGlbBinaryChunk) {
      c.bin = chunk;
    }
    at += chunk_bytes;
  }
  if (!has_json) source.fail("byte 12", "a JSON chunk", "the end of the file");
  // Padding must be blanks; some exporters write zeros.
  while (!c.json.empty() && c.json.back() == '\0') c.json.remove_suffix(1);
  return c;
}

namespace {

/// `extras` may hold anything, and nothing reads them any more. null counts as absent, as some exporters
/// write it, but not to tinygltf.
void drop_extras_and_nulls(GltfJson& value) {
  if (value.is_object()) {
    value.erase("extras");
    for (auto it = value.begin(); it != value.end();) it = it->is_null() ? value.erase(it) : std::next(it);
  }
  if (value.is_structured()) {
    for (GltfJson& child : value) drop_extras_and_nulls(child);
  }
}

// The objects of a glTF with the members that are read: "!" must be there, "[]" is an array, "{}" an object
// of any names, "@nodes" an index into the document's nodes, "*3" so many numbers, "," a choice.
constexpr const char* kShapes = R"(
document asset!=asset extensionsRequired=text[] extensionsUsed=text[] buffers=buffer[] images=image[]
document bufferViews=bufferView[] accessors=accessor[] samplers=sampler[] textures=texture[]
document materials=material[] meshes=mesh[] nodes=node[] scenes=scene[] scene=@scenes
asset minVersion=text
buffer byteLength!=size uri=text
bufferView buffer=@buffers byteOffset=size byteLength=size byteStride=0..252 extensions=packings
packings EXT_meshopt_compression=meshopt KHR_meshopt_compression=meshopt
meshopt buffer!=@buffers byteOffset=size byteLength!=size byteStride!=1..256 count!=size
meshopt mode!="ATTRIBUTES","TRIANGLES","INDICES" filter=text
accessor bufferView=@bufferViews byteOffset=size count=size normalized=truth sparse=sparse
accessor componentType=5120,5121,5122,5123,5125,5126
sparse count=int indices=sparseIndices values=sparseValues
sparseIndices bufferView=@bufferViews byteOffset=int componentType=5121,5123,5125
sparseValues bufferView=@bufferViews byteOffset=int
image uri=text bufferView=@bufferViews
sampler magFilter=9728,9729 minFilter=9728,9729,9984,9985,9986,9987
sampler wrapS=33071,33648,10497 wrapT=33071,33648,10497
texture sampler=@samplers source=@images extensions=otherImages
otherImages EXT_texture_webp=otherImage EXT_texture_avif=otherImage KHR_texture_basisu=otherImage
otherImage source=@images
material emissiveFactor=number*3 alphaCutoff=number alphaMode="OPAQUE","MASK","BLEND" doubleSided=truth
material normalTexture=textureInfo occlusionTexture=textureInfo emissiveTexture=textureInfo
material pbrMetallicRoughness=pbr extensions=object{} extensions=materialExtensions
pbr baseColorFactor=number*4 metallicFactor=number roughnessFactor=number
pbr baseColorTexture=textureInfo metallicRoughnessTexture=textureInfo
textureInfo index!=@textures texCoord=0..255 scale=number strength=number extensions=moves
moves KHR_texture_transform=transform
transform offset=number*2 scale=number*2 rotation=number texCoord=0..255
mesh primitives!=primitive[]
primitive attributes=@accessors{} indices=@accessors material=@materials mode=0..6 extensions=compressions
compressions KHR_draco_mesh_compression=draco
draco bufferView!=@bufferViews attributes!=int{}
node mesh=@meshes children=@nodes[] matrix=number*16 rotation=number*4 scale=number*3 translation=number*3
node extensions=copies
copies EXT_mesh_gpu_instancing=instancing KHR_node_visibility=visibility
visibility visible=truth
instancing attributes!=@accessors{}
scene nodes=@nodes[]
)";

struct Look {
  const Source& source;
  const GltfJson& document;
  [[noreturn]] void refuse(const std::string& place, const std::string& expected,
                           const GltfJson& found) const {
    const std::string text = found.is_structured() ? found.type_name() : found.dump();
    source.fail(place, expected, text.size() > 80 ? text.substr(0, 80) + "..." : text);
  }
  /// "3.0" is an integer to JSON Schema, but not to tinygltf: rewritten here.
  void integer(GltfJson& v, const std::string& place, std::uint64_t lo, std::uint64_t hi) const {
    const double real = v.is_number_float() ? v.get<double>() : -1;
    if (real >= 0 && real < 0x1p53 && std::floor(real) == real) v = static_cast<std::uint64_t>(real);
    if (!v.is_number_unsigned() || v.get<std::uint64_t>() < lo || v.get<std::uint64_t>() > hi)
      refuse(place, fmt::format("an integer from {} to {}", lo, hi), v);
  }
};
using Rule = std::function<void(const Look& look, GltfJson& value, const std::string& place)>;

/// kShapes and materials' extensions as rules.
class Shapes {
 public:
  Shapes() {
    std::string shapes = kShapes;
    for (const MaterialExtensionKind& kind : material_extensions()) {
      shapes += fmt::format("materialExtensions {0}={0}\n{0}", kind.name);
      for (const ExtensionFactorKind& f : kind.factors)
        shapes +=
            fmt::format(" {}=number{}", f.key, f.components > 1 ? fmt::format("*{}", f.components) : "");
      for (const ExtensionTextureKind& t : kind.textures) shapes += fmt::format(" {}=textureInfo", t.key);
      shapes += '\n';
    }
    std::istringstream lines(shapes);
    for (std::string line, object, member; std::getline(lines, line);) {
      std::istringstream words(line);
      for (words >> object; words >> member;) {
        const std::size_t equals = member.find('='), end = equals - (member[equals - 1] == '!');
        objects_[object].push_back({member.substr(0, end), rule_of(member.substr(equals + 1)), end < equals});
      }
    }
  }
  Rule rule_of(const std::string& type);

 private:
  struct Member {
    std::string name;
    Rule rule;
    bool required;
  };
  std::map<std::string, std::vector<Member>> objects_;
};

Rule Shapes::rule_of(const std::string& type) {
  const auto of_type = [](bool (GltfJson::*is)() const noexcept, const char* expected) {
    return [=](const Look& look, const GltfJson& v, const std::string& place) {
      if (!(v.*is)()) look.refuse(place, expected, v);
    };
  };
  if (type == "text") return of_type(&GltfJson::is_string, "a string");
  if (type == "number") return of_type(&GltfJson::is_number, "a number");
  if (type == "truth") return of_type(&GltfJson::is_boolean, "true or false");
  if (type == "int") return rule_of("0..2147483647");  // tinygltf keeps some sizes as int
  if (type == "size") return rule_of("0..9007199254740991");
  if (type.ends_with("[]") || type.ends_with("{}"))
    return [rule = rule_of(type.substr(0, type.size() - 2)), array = type.ends_with("[]")](
               const Look& look, GltfJson& v, const std::string& place) {
      constexpr std::size_t kMost = 1'000'000;
      if (array ? !v.is_array() : !v.is_object()) look.refuse(place, array ? "an array" : "an object", v);
      if (v.size() > kMost) look.refuse(place, fmt::format("at most {} elements", kMost), v.size());
      for (auto& [name, value] : v.items()) rule(look, value, place + "/" + name);
    };
  if (type[0] == '@')
    return [array = type.substr(1)](const Look& look, GltfJson& v, const std::string& place) {
      const auto it = look.document.find(array);
      const std::size_t size = it != look.document.end() && it->is_array() ? it->size() : 0;
      if (size == 0) look.refuse(place, "an element of /" + array + ", which is empty", v);
      look.integer(v, place, 0, size - 1);
    };
  if (const std::size_t dots = type.find(".."); dots != type.npos)
    return [lo = std::stoull(type), hi = std::stoull(type.substr(dots + 2))](
               const Look& look, GltfJson& v, const std::string& place) { look.integer(v, place, lo, hi); };
  if (const std::size_t star = type.find('*'); star != type.npos)
    return [count = std::stoull(type.substr(star + 1))](const Look& look, GltfJson& v,
                                                        const std::string& place) {
      if (!v.is_array() || v.size() != count ||
          !std::all_of(v.begin(), v.end(), std::mem_fn(&GltfJson::is_number)))
        look.refuse(place, std::to_string(count) + " numbers", v);
    };
  if (type.find(',') != type.npos)
    return [choice = GltfJson::parse("[" + type + "]")](const Look& look, GltfJson& v,
                                                        const std::string& place) {
      if (std::find(choice.begin(), choice.end(), v) == choice.end())
        look.refuse(place, "one of " + choice.dump(), v);
    };
  return [members = &objects_[type]](const Look& look, GltfJson& v, const std::string& place) {
    if (!v.is_object()) look.refuse(place, "an object", v);
    for (const Member& member : *members) {
      if (const auto it = v.find(member.name); it != v.end())
        member.rule(look, *it, place + "/" + member.name);
      else if (member.required)
        look.source.fail(place, "\"" + member.name + "\"", "an object without it");
    }
  };
}

}  // namespace

GltfJson parse_gltf_json(const Source& source, std::string_view text) {
  const JsonShape shape = scan_json_shape(text_bytes(text), kMaxGltfJsonDepth);
  if (shape.too_deep)
    source.fail("byte " + std::to_string(*shape.too_deep), "JSON of at most 64 levels", "deeper nesting");
  if (shape.values > kMaxGltfJsonValues)
    source.fail("", "JSON of at most " + std::to_string(kMaxGltfJsonValues) + " values",
                std::to_string(shape.values));
  try {
    GltfJson document = GltfJson::parse(text);
    if (!document.is_object()) source.fail("", "a JSON object", document.type_name());
    if (values_in(document) != shape.values)
      add_warning(source.notes, "duplicate-member", "",
                  "an object of the JSON names a member twice; the last one counts");
    return document;
  } catch (const GltfJson::parse_error& e) {
    source.fail("byte " + std::to_string(e.byte), "JSON", "a syntax error or the end of the text");
  } catch (const GltfJson::exception&) {
    source.fail("", "numbers that fit a double", "a larger one");
  }
}

void look_through(const Source& source, GltfJson& document) {
  static Shapes shapes;
  static const Rule rule = shapes.rule_of("document");
  drop_extras_and_nulls(document);
  rule({source, document}, document, "");
}

}  // namespace texmesh
