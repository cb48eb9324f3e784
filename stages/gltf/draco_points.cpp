#include "stages/gltf/draco_points.h"

#include <draco/mesh/mesh.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include "stages/base/first_use_table.h"

namespace texmesh {
namespace {

/// Which records are equal. Equal ones have one number; numbers are given in the order of first use.
struct FirstUses {
  std::vector<std::uint32_t> number;  // per record
  std::vector<std::uint32_t> first;   // per number: the first record that has it
};

std::uint64_t hash_of(std::span<const std::uint32_t> record) {
  std::uint64_t hash = 0;
  for (const std::uint32_t word : record) hash = hash_with(hash, word);
  return hash;
}

FirstUses find_first_uses(std::span<const std::uint32_t> words, std::size_t words_each) {
  const std::size_t count = words.size() / words_each;
  const auto record = [&](std::size_t i) { return words.subspan(i * words_each, words_each); };
  FirstUses out;
  out.number.reserve(count);
  FirstUseTable table(count);
  const auto record_of = [&](std::uint32_t number) { return record(out.first[number]); };
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t number = table.number_of(
        hash_of(record(i)), [&](std::uint32_t n) { return std::ranges::equal(record_of(n), record(i)); },
        [&](std::uint32_t n) { return hash_of(record_of(n)); });
    if (number == out.first.size()) out.first.push_back(static_cast<std::uint32_t>(i));
    out.number.push_back(number);
  }
  return out;
}

void merge_values(draco::PointAttribute& attribute, std::uint32_t points) {
  const std::size_t bytes = static_cast<std::size_t>(attribute.byte_stride()), words_each = (bytes + 3) / 4;
  std::vector<std::uint32_t> words(attribute.size() * words_each, 0);
  const auto value = [&](std::size_t i) {
    return attribute.GetAddress(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)));
  };
  for (std::size_t i = 0; i < attribute.size(); ++i)
    std::memcpy(words.data() + i * words_each, value(i), bytes);
  const FirstUses uses = find_first_uses(words, words_each);
  if (uses.first.size() == attribute.size()) return;
  for (std::uint32_t u = 0; u < uses.first.size(); ++u)
    attribute.SetAttributeValue(draco::AttributeValueIndex(u), words.data() + uses.first[u] * words_each);
  const bool by_point = attribute.is_mapping_identity();
  if (by_point) attribute.SetExplicitMapping(points);
  for (draco::PointIndex p(0); p < points; ++p) {
    const std::uint32_t at = by_point ? p.value() : attribute.mapped_index(p).value();
    attribute.SetPointMapEntry(p, draco::AttributeValueIndex(uses.number[at]));
  }
  attribute.Resize(uses.first.size());
}

void merge_points(draco::Mesh& mesh) {
  const auto attributes = static_cast<std::size_t>(mesh.num_attributes());
  if (attributes == 0) return;
  std::vector<std::uint32_t> words;
  words.reserve(mesh.num_points() * attributes);
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p)
    for (int a = 0; a < mesh.num_attributes(); ++a)
      words.push_back(mesh.attribute(a)->mapped_index(p).value());
  const FirstUses uses = find_first_uses(words, attributes);
  if (uses.first.size() == mesh.num_points()) return;
  // No attribute is its points' list any more: such a one would tell all points apart.
  for (int a = 0; a < mesh.num_attributes(); ++a) {
    draco::PointAttribute& attribute = *mesh.attribute(a);
    for (std::uint32_t u = 0; u < uses.first.size(); ++u)
      attribute.SetPointMapEntry(draco::PointIndex(u),
                                 attribute.mapped_index(draco::PointIndex(uses.first[u])));
    attribute.SetExplicitMapping(uses.first.size());
  }
  mesh.set_num_points(static_cast<std::uint32_t>(uses.first.size()));
  for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f) {
    draco::Mesh::Face face = mesh.face(f);
    for (draco::PointIndex& p : face) p = draco::PointIndex(uses.number[p.value()]);
    mesh.SetFace(f, face);
  }
}

}  // namespace

void merge_equal_points(draco::Mesh& mesh) {
  for (int a = 0; a < mesh.num_attributes(); ++a) merge_values(*mesh.attribute(a), mesh.num_points());
  merge_points(mesh);
}

}  // namespace texmesh
