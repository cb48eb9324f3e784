#include "pipeline/import/drop_unused.h"

#include <algorithm>

#include "format/base/errors.h"
#include "format/base/no_index.h"

namespace texmesh {
namespace {

template <class T>
void keep_marked(std::vector<T>& values, const std::vector<std::uint32_t>& new_index) {
  if (values.empty()) return;
  // new_index[i] <= i; moving a string or a vector onto itself would empty it.
  for (std::size_t i = 0; i < values.size(); ++i)
    if (new_index[i] != kNoIndex && new_index[i] != i) values[new_index[i]] = std::move(values[i]);
  values.resize(static_cast<std::size_t>(
      std::count_if(new_index.begin(), new_index.end(), [](auto i) { return i != kNoIndex; })));
}

/// Marks become consecutive indices in the old order; kNoIndex stays.
std::uint32_t number_marked(std::vector<std::uint32_t>& marks) {
  std::uint32_t next = 0;
  for (std::uint32_t& m : marks)
    if (m != kNoIndex) m = next++;
  return next;
}

}  // namespace

std::string count_of(std::size_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

void drop_unused_vertices(Model& model) {
  Mesh& mesh = model.mesh;
  std::vector<std::uint32_t> wedge(mesh.wedge_count(), kNoIndex), position(mesh.positions.size(), kNoIndex);
  for (const Triangle& t : mesh.triangles)
    for (std::uint32_t w : t) {
      wedge[w] = 0;
      position[mesh.wedge_position[w]] = 0;
    }
  const std::uint32_t wedges = number_marked(wedge), positions = number_marked(position);
  if (wedges == wedge.size() && positions == position.size()) return;
  if (positions != position.size())
    add_info(model.notes, "unused-vertices", "",
             count_of(position.size() - positions, "vertex", "vertices") + " of no triangle left out");
  keep_marked(mesh.uv0, wedge);
  keep_marked(mesh.uv1, wedge);
  keep_marked(mesh.normals, wedge);
  keep_marked(mesh.colours, wedge);
  keep_marked(mesh.tangents, wedge);
  keep_marked(mesh.wedge_position, wedge);
  keep_marked(mesh.positions, position);
  for (std::uint32_t& p : mesh.wedge_position) p = position[p];
  for (Triangle& t : mesh.triangles)
    for (std::uint32_t& w : t) w = wedge[w];
  for (std::uint32_t& p : model.range.position)
    if (p != kNoIndex) p = position[p];
}

void drop_unused_materials(Model& model) {
  std::vector<std::uint32_t> material(model.materials.size(), kNoIndex);
  for (std::uint16_t m : model.mesh.triangle_material) material[m] = 0;
  number_marked(material);
  keep_marked(model.materials, material);
  for (std::uint16_t& m : model.mesh.triangle_material) m = static_cast<std::uint16_t>(material[m]);
}

void drop_unused_parts(Mesh& mesh) {
  std::vector<std::uint32_t> part(mesh.part_names.size(), kNoIndex);
  for (std::uint16_t p : mesh.triangle_part) part[p] = 0;
  number_marked(part);
  keep_marked(mesh.part_names, part);
  for (std::uint16_t& p : mesh.triangle_part) p = static_cast<std::uint16_t>(part[p]);
}

void drop_unused_images(Model& model, const std::string& file_name) {
  std::vector<std::uint32_t> image(model.images.size(), kNoIndex);
  auto mark = [&](TextureRef& ref) {
    if (!ref.used()) return;
    if (static_cast<std::size_t>(ref.image) >= image.size())
      throw InputError(file_name, "imported materials", "textures that refer to images",
                       std::to_string(ref.image));
    image[static_cast<std::size_t>(ref.image)] = 0;
  };
  for (Material& m : model.materials) for_each_texture(m, mark);
  number_marked(image);
  keep_marked(model.images, image);
  for (Material& m : model.materials)
    for_each_texture(m, [&image](TextureRef& ref) {
      if (ref.used()) ref.image = static_cast<std::int32_t>(image[static_cast<std::size_t>(ref.image)]);
    });
}

}  // namespace texmesh
