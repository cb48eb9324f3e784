#pragma once
// Meshes as streams of KHR_draco_mesh_compression: one encoder, for meshes that are made and for those of
// files.
#include <cstring>
#include <map>
#include <memory>

#include "stages/geometry/scale_frames.h"

namespace draco {
class Mesh;
}

namespace texmesh {

/// Places that floats are rounded to: 2^bits along each axis, from `origin` to origin + range, ends included.
struct DracoGrid {
  int bits = 0;  // 0 = floats stay as they are
  Vec3f origin;  // a fourth component begins where the third does
  float range = 1;
};

/// One primitive of a file: its Draco stream, and the stream's id of every glTF attribute.
struct DracoStream {
  std::vector<std::uint8_t> bytes;
  std::map<std::string, int> attributes;      // "POSITION" -> unique id
  std::uint32_t vertices = 0, triangles = 0;  // as a decoder gives them
  Vec3f low, high;                            // of the positions; of recode_draco() alone
};

/// Points and triangles as they are, hardly compressed: for meshes that are coded again soon.
inline constexpr int kDracoFastest = 10;

/// Triangles and what their vertices have, on the way into a stream.
class DracoMesh {
 public:
  /// `indices`: three a triangle, below `vertices`.
  DracoMesh(std::span<const std::uint32_t> indices, std::size_t vertices);
  ~DracoMesh();
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;

  /// Adds an attribute with glTF's name, of which vertex i has value(i): a vector of floats, or a std::array
  /// of codes of 8 or 16 bits. Attributes stand in the stream in the order of the calls. Of normals the grid
  /// tells the bits alone.
  void add(const std::string& name, const DracoGrid& grid, const auto& value) {
    using Element = decltype(value(0u));
    std::uint8_t* to = values_of(name, component_bytes(Element()), sizeof(Element), grid);
    for (std::uint32_t i = 0; i < vertices_; ++i) {
      const Element element = value(i);
      std::memcpy(to + i * sizeof element, &element, sizeof element);
    }
  }
  /// Edgebreaker, with seams of its own for every attribute, so that positions are stored once. `speed`: 0
  /// makes the smallest streams, 9 is the fastest of these; kDracoFastest. Same bytes for same input.
  /// StageError when Draco refuses.
  DracoStream encode(int speed);

 private:
  struct State;
  template <class T, std::size_t N>
  static std::size_t component_bytes(const std::array<T, N>&) {
    return sizeof(T);
  }
  static std::size_t component_bytes(const auto&) { return sizeof(float); }
  std::uint8_t* values_of(const std::string& name, std::size_t component_bytes, std::size_t bytes,
                          const DracoGrid& grid);
  std::uint32_t vertices_;
  std::unique_ptr<State> state_;
};

/// How fine a mesh is coded anew. Steps are the largest distance between neighbouring places of a grid.
struct DracoSteps {
  double position = 0;  // object units, > 0
  double uv = 0;        // texture coordinates, > 0
  int normal_bits = 8;
  int colour_bits = 8;  // of the 8 that vertex colours have
  /// Steps exactly so long. Otherwise a grid's last place is the end of what it holds, and its steps may be
  /// half as long.
  bool exact = false;
};

struct DracoWork;

/// The primitives of one file, to be coded anew on coarser grids that all of them share, so that borders
/// between primitives stay closed. They are decoded once for several codings.
class DracoRecoder {
 public:
  /// With `lit_as`, which must outlive this, normals are fitted to it.
  DracoRecoder(std::vector<DracoStream> primitives, const NormalSamples* lit_as, std::string entry);
  ~DracoRecoder();
  DracoRecoder(DracoRecoder&&) noexcept;
  /// When one stream does not get smaller, all streams stay as they are (one grid for all), unless normals
  /// were fitted. FormatError when a stream does not decode; StageError when Draco refuses.
  std::vector<DracoStream> coded(const DracoSteps& steps, const RunContext& context);

 private:
  void decode(const RunContext& context);
  std::vector<DracoStream> primitives_;
  const NormalSamples* lit_as_;
  std::string entry_;
  std::vector<DracoWork> work_;  // empty: to be decoded
};

/// Gives values of an attribute that are equal bit for bit one index, and points that have all of their
/// values in common one index; both are numbered in the order in which they first stand. So does Draco
/// (DeduplicateAttributeValues, then DeduplicatePointIds), whose streams come out the same; its tables of
/// nodes took a tenth of the time that writing half a million triangles takes. Fewer than 2^31 values and
/// points.
void merge_equal_points(draco::Mesh& mesh);

}  // namespace texmesh
