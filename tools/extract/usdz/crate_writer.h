#pragma once
#include <array>
#include <map>
#include <string>

#include "format/base/bytes.h"
#include "format/documents/about.h"

namespace texmesh {

/// A layer of Universal Scene Description that grows, written as a crate (usdc, version 0.7.0): the binary
/// form, whose layout OpenUSD's pxr/usd/sdf/crateFile.cpp defines. Integers are coded as its
/// integerCoding.cpp has it; LZ4 blocks hold literals alone, since floats, most of a mesh, are never packed.
class CrateWriter {
 public:
  /// A value of a field: the 8 bytes that a crate has for it.
  using Value = std::uint64_t;
  /// A path of the layer: a prim or a property. 0 is the layer itself.
  using Node = std::uint32_t;
  enum class Kind : std::uint32_t { kAttribute = 1, kPrim = 6, kLayer = 7, kRelationship = 8 };

  CrateWriter();

  // Small values.
  Value token(std::string_view text);
  Value text(std::string_view text);
  Value asset(std::string_view path);
  Value number(float x);
  Value integer(std::int32_t x);
  Value flag(bool x);
  Value uniform();
  // Values that stand in the file.
  Value number(double x);
  /// 2, 3 or 4 floats.
  Value vector(std::span<const float> v);
  Value matrix(const std::array<double, 16>& rows);
  /// `components` floats an element: 2, 3.
  Value array(std::span<const float> v, std::size_t components);
  Value array(std::span<const std::int32_t> v);
  Value token_array(const std::vector<std::string>& v);
  Value prepended(const std::vector<std::string>& tokens);
  Value targets(const std::vector<Node>& nodes);
  Value dictionary(const std::vector<NamedText>& texts);

  /// A prim. Children stand in the order in which they are added. Names are identifiers, unique in a parent.
  Node prim(Node parent, std::string_view name, std::string_view type);
  Node attribute(Node prim, std::string_view name, std::string_view type);
  Node attribute(Node prim, std::string_view name, std::string_view type, Value value);
  /// An attribute that takes the value of another one.
  Node connection(Node prim, std::string_view name, std::string_view type, Node source);
  Node relationship(Node prim, std::string_view name, Node target);
  void set(Node node, std::string_view field, Value value);

  /// The file. Same calls, same bytes.
  Bytes finish();

 private:
  struct Field {
    std::uint32_t name;
    Value value;
  };
  struct Entry {
    Kind kind = Kind::kPrim;
    std::uint32_t name = 0;  // token
    std::vector<Field> fields;
    std::vector<Node> prims, properties;
  };
  std::uint32_t token_index(std::string_view text);
  std::uint32_t string_index(std::string_view text);
  /// Pads to 8 bytes; the value of a type whose bytes follow.
  Value place(std::uint64_t type);
  Node add(Node parent, Kind kind, std::string_view name);
  Value token_vector(const std::vector<Node>& nodes);
  void list_children();
  Bytes tokens_section() const;
  Bytes fields_section(std::vector<std::uint32_t>& sets, std::vector<std::uint32_t>& set_of) const;
  Bytes paths_section() const;
  Bytes specs_section(const std::vector<std::uint32_t>& set_of) const;

  BytesOut out_;
  std::vector<std::string> tokens_;
  std::map<std::string, std::uint32_t, std::less<>> token_indices_;
  std::vector<std::uint32_t> strings_;
  std::vector<Entry> entries_;
};

}  // namespace texmesh
