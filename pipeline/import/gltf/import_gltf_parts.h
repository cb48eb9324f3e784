#pragma once
#include <nlohmann/json_fwd.hpp>

#include "pipeline/import/mesh_builder.h"

namespace tinygltf {
class Model;
}

// The parts of the glTF reader (import_gltf.cpp puts them together). The JSON is parsed once, within bounds;
// look_through() checks what tinygltf's structures would not show; tinygltf makes structures of it. Bytes are
// only ever reached through Buffers and AccessorReader, which know their lengths.
namespace texmesh {

using GltfJson = nlohmann::json;
/// What every part is given. Places in messages are JSON pointers: "/accessors/3/count".
struct Source {
  const std::string& file;
  Resolver& resolver;
  const ImportOptions& options;
  const RunContext& context;
  Notes& notes;
  Lost& lost;
  double largest_coordinate = kLargestCoordinate;  // beyond it a position is left out
  [[noreturn]] void fail(const std::string& place, const std::string& expected,
                         const std::string& found) const;
  /// Adds the note unless there is one with that code.
  void note_once(Severity severity, const std::string& code, const std::string& place,
                 const std::string& text) const;
};

// import_gltf_document.cpp

struct Container {
  std::string_view json;
  std::optional<ByteSpan> bin;  // of a GLB
  bool is_glb = false;
};
/// Header and chunk lengths of a GLB checked against the file; anything else is taken for JSON.
Container split_container(const Source& source, ByteSpan bytes);

/// Bounds of a stranger's JSON. Parsers recurse; a value costs them at most a few hundred bytes, and real
/// scans have some thousands.
inline constexpr int kMaxGltfJsonDepth = 64;
inline constexpr std::uint64_t kMaxGltfJsonValues = 8'000'000;
/// Parses after a look at the brackets alone. A warning says that an object names a member twice.
GltfJson parse_gltf_json(const Source& source, std::string_view text);
/// Takes out `extras` and null, and checks types, lengths, whole numbers and indices of every property that
/// the reader uses.
void look_through(const Source& source, GltfJson& document);

// import_gltf_structure.cpp

/// What has been looked through, read by tinygltf but for buffers and images: tinygltf opens and decodes
/// nothing. InputError where it misses a property or knows no such value.
tinygltf::Model read_structure(const Source& source, const GltfJson& document);

// import_gltf_buffers.cpp

/// The bytes behind bufferViews: the BIN chunk, data: URIs and files, read at first use,
/// with EXT_meshopt_compression or KHR_meshopt_compression undone.
class Buffers {
 public:
  Buffers(const Source& source, const GltfJson& document, const tinygltf::Model& structure,
          std::optional<ByteSpan> bin);
  /// `place` is who asks, for messages.
  ByteSpan view(std::size_t index, const std::string& place);

 private:
  ByteSpan buffer(std::size_t index);
  ByteSpan range(std::size_t buffer_index, std::uint64_t offset, std::uint64_t length,
                 const std::string& place);
  std::vector<std::uint8_t> decompressed(const GltfJson& extension, const std::string& place);

  const Source& source_;
  const GltfJson& document_;
  const tinygltf::Model& structure_;
  std::optional<ByteSpan> bin_;
  std::uint64_t decompressed_bytes_ = 0;
  std::vector<std::optional<std::vector<std::uint8_t>>> buffers_, views_;
};

/// One accessor over checked bytes. Elements are read one by one with memcpy: alignment does not matter, and
/// sparse accessors need no copy.
class AccessorReader {
 public:
  /// Throws InputError when the elements do not lie within their bufferViews or sparse indices are not
  /// increasing and below count. `model` and `buffers` must outlive the reader.
  AccessorReader(const Source& source, const tinygltf::Model& model, Buffers& buffers, std::size_t index);
  std::size_t count() const { return count_; }
  /// Elements that no byte of a file stands for.
  std::size_t zeros() const { return base_ ? 0 : count_ - sparse_indices_.size(); }
  int components() const { return components_; }
  int component_type() const { return component_type_; }
  /// What two neighbouring values of an integer type differ by, as read() gives them; 0 for floats.
  float step() const;
  /// components() floats; integers as they are, or normalised where the accessor says so.
  void read(std::size_t element, float* out) const;
  /// Integers count as normalised whatever the accessor says.
  void normalize() { normalized_ = true; }
  /// First component of an unsigned integer accessor.
  std::uint32_t read_index(std::size_t element) const;

 private:
  const std::uint8_t* element_at(std::size_t element) const;

  std::size_t count_ = 0, stride_ = 0, component_bytes_ = 0;
  int components_ = 0, component_type_ = 0;
  bool normalized_ = false;
  const std::uint8_t* base_ = nullptr;  // null: zeros
  std::vector<std::uint32_t> sparse_indices_;
  const std::uint8_t* sparse_values_ = nullptr;
};

// import_gltf_primitives.cpp

using ReadFloats = std::function<void(std::size_t vertex, float* out)>;

/// Vertices by attribute; an empty function is an attribute that is not there.
struct VertexData {
  std::size_t count = 0;
  ReadFloats position, normal, uv0, uv1, colour, tangent;
  int colour_components = 4;
  float position_step = 0;             // of a grid that positions were rounded to; 0 = none
  std::vector<std::uint32_t> indices;  // empty with indexed == false
  bool indexed = false;
};
/// KHR_draco_mesh_compression. Its counts are read from the stream's header and checked before the decoder,
/// which allocates what a header asks for, sees it. `attributes` maps names to the stream's attribute ids;
/// `normalized` says what the accessor of a name says.
VertexData decode_draco(const Source& source, const std::string& place, ByteSpan data,
                        const GltfJson& attributes,
                        const std::function<bool(const std::string& name)>& normalized);

/// Triangles of one primitive in its mesh's space, with the vertices that they use, in the order of the file.
struct Primitive {
  std::vector<Triangle> triangles;
  std::vector<Vec3f> positions, normals;
  float position_step = 0;  // as in VertexData
  std::vector<Vec2f> uv0, uv1;
  std::vector<Vec4f> colours, tangents;
};
/// Empty for points, lines and primitives without positions.
Primitive read_primitive(const Source& source, const GltfJson& document, const tinygltf::Model& model,
                         Buffers& buffers, std::size_t mesh, std::size_t primitive);

// import_gltf_materials.cpp

/// Appends the glTF materials that `used` names (glTF's default material for -1) to `model`, in order, with
/// their images. The mesh is there already: its triangles' materials are places in `used`, until materials of
/// several tiles become several (TiledImages).
void read_materials(const Source& source, const GltfJson& document, const tinygltf::Model& structure,
                    Buffers& buffers, const std::vector<int>& used, Model& model);

}  // namespace texmesh
