#include "pipeline/import/finish_model.h"

#include <algorithm>
#include <cmath>

#include "format/base/errors.h"
#include "pipeline/import/drop_unused.h"
#include "pipeline/import/local_frame.h"
#include "pipeline/import/near_uvs.h"
#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

bool finite(Vec2f a) { return std::isfinite(a.x) && std::isfinite(a.y); }
bool finite(Vec3f a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

void fill_defaults(Model& model) {
  Mesh& mesh = model.mesh;
  if (model.materials.empty()) model.materials.emplace_back();
  if (mesh.triangle_material.empty()) mesh.triangle_material.assign(mesh.triangles.size(), 0);
  if (mesh.triangle_part.empty()) mesh.triangle_part.assign(mesh.triangles.size(), 0);
  if (mesh.part_names.empty()) mesh.part_names.emplace_back();
  for (std::size_t i = 0; i < mesh.part_names.size(); ++i)
    if (mesh.part_names[i].empty()) mesh.part_names[i] = "part " + std::to_string(i + 1);
}

/// A reader that hands over a wrong index has a bug; reading past an array for it would be worse than saying
// so.
void check_structure(const Model& model, const std::string& file_name) {
  const Mesh& mesh = model.mesh;
  const std::size_t wedges = mesh.wedge_count();
  auto require = [&file_name](bool ok, const char* what) {
    if (!ok) throw InputError(file_name, "imported mesh", what, "an index or a count out of range");
  };
  auto attribute = [wedges](std::size_t n) { return n == 0 || n == wedges; };
  require(attribute(mesh.uv0.size()) && attribute(mesh.uv1.size()) && attribute(mesh.normals.size()) &&
              attribute(mesh.colours.size()) && attribute(mesh.tangents.size()),
          "one value per wedge for every attribute");
  require(mesh.triangle_material.size() == mesh.triangles.size() &&
              mesh.triangle_part.size() == mesh.triangles.size(),
          "a material and a part for every triangle");
  for (std::uint32_t p : mesh.wedge_position)
    require(p < mesh.positions.size(), "wedges that refer to positions");
  for (const Triangle& t : mesh.triangles)
    for (std::uint32_t w : t) require(w < wedges, "triangles that refer to wedges");
  for (std::uint16_t m : mesh.triangle_material)
    require(m < model.materials.size(), "triangles that refer to materials");
  for (std::uint16_t p : mesh.triangle_part)
    require(p < mesh.part_names.size(), "triangles that refer to parts");
}

void check_limits(const Model& model, const std::string& file_name, const ImportOptions& options) {
  auto check = [&file_name](const char* what, std::size_t found, int limit) {
    if (found > static_cast<std::size_t>(limit))
      throw InputError(file_name, what, "at most " + std::to_string(limit), std::to_string(found));
  };
  check("positions", model.mesh.positions.size(), options.max_vertices);
  check("vertices with texture coordinates", model.mesh.wedge_count(), options.max_vertices);
  check("triangles", model.mesh.triangles.size(), options.max_triangles);
  check("images", model.images.size(), options.max_images);
}

void drop_non_finite_triangles(Model& model, const std::string& file_name) {
  Mesh& mesh = model.mesh;
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    bool good = true;
    for (std::uint32_t w : mesh.triangles[t]) good = good && finite(mesh.positions[mesh.wedge_position[w]]);
    if (!good) continue;
    mesh.triangles[kept] = mesh.triangles[t];
    mesh.triangle_material[kept] = mesh.triangle_material[t];
    mesh.triangle_part[kept] = mesh.triangle_part[t];
    ++kept;
  }
  const std::size_t dropped = mesh.triangles.size() - kept;
  if (dropped && kept == 0)
    throw InputError(file_name, "positions", "some finite ones",
                     "NaN, infinity or more than " + shortest(kLargestCoordinate) + " in every triangle");
  if (kept == 0) throw InputError(file_name, "triangles", "at least one", "none");
  if (!dropped) return;
  mesh.triangles.resize(kept);
  mesh.triangle_material.resize(kept);
  mesh.triangle_part.resize(kept);
  add_warning(model.notes, "non-finite-position", file_name,
              count_of(dropped, "triangle", "triangles") +
                  " left out because of positions that are NaN, infinite or beyond " +
                  shortest(kLargestCoordinate));
}

void repair_uvs(Model& model, std::vector<Vec2f>& uvs, const std::string& file_name) {
  std::size_t bad = 0;
  for (Vec2f& uv : uvs)
    if (!finite(uv)) {
      uv = {};
      ++bad;
    }
  if (bad)
    add_warning(
        model.notes, "non-finite-uv", file_name,
        count_of(bad, "texture coordinate", "texture coordinates") + " with NaN or infinity set to 0");
}

/// Normals become unit vectors. One that is NaN or 0 takes the sum of its triangles' area-weighted normals.
void repair_normals(Mesh& mesh) {
  if (mesh.normals.empty()) return;
  std::vector<std::uint8_t> bad(mesh.normals.size(), 0);
  bool any = false;
  for (std::size_t w = 0; w < mesh.normals.size(); ++w) {
    const Vec3d n = to_double(mesh.normals[w]);
    const double l = length(n);
    if (l > 1e-20 && std::isfinite(l)) {
      mesh.normals[w] = to_float(n * (1 / l));
    } else {
      bad[w] = 1;
      any = true;
    }
  }
  if (!any) return;
  std::vector<Vec3d> sum(mesh.normals.size());
  for (const Triangle& t : mesh.triangles) {
    if (!bad[t[0]] && !bad[t[1]] && !bad[t[2]]) continue;
    const Vec3d a = to_double(mesh.positions[mesh.wedge_position[t[0]]]);
    const Vec3d n = cross(to_double(mesh.positions[mesh.wedge_position[t[1]]]) - a,
                          to_double(mesh.positions[mesh.wedge_position[t[2]]]) - a);
    for (std::uint32_t w : t) sum[w] = sum[w] + n;
  }
  for (std::size_t w = 0; w < bad.size(); ++w) {
    if (!bad[w]) continue;
    const double l = length(sum[w]);
    mesh.normals[w] = l > 0 && std::isfinite(l) ? to_float(sum[w] * (1 / l)) : Vec3f{0, 1, 0};
  }
}

void clamp_colours(std::vector<Vec4f>& colours) {
  auto clamp = [](float x) { return x >= 0 ? std::min(x, 1.0f) : x < 0 ? 0.0f : 1.0f; };  // NaN: 1, no tint
  for (Vec4f& c : colours) c = {clamp(c.x), clamp(c.y), clamp(c.z), clamp(c.w)};
}

/// Unit length, w one of 1 and -1; what cannot be so is 0. Nothing at all where no normal map needs them.
void repair_tangents(Model& model) {
  std::vector<Vec4f>& tangents = model.mesh.tangents;
  const bool wanted = std::any_of(model.materials.begin(), model.materials.end(),
                                  [](const Material& m) { return needs_tangents(m); });
  if (!wanted || model.mesh.normals.empty()) tangents.clear();
  for (Vec4f& t : tangents) {
    const Vec3d d{t.x, t.y, t.z};
    const double l = length(d);
    if (l > 1e-20 && std::isfinite(l) && std::isfinite(t.w)) {
      const Vec3f unit = to_float(d * (1 / l));
      t = {unit.x, unit.y, unit.z, t.w < 0 ? -1.0f : 1.0f};
    } else {
      t = {};
    }
  }
}

void turn_z_up(Mesh& mesh) {
  auto turn = [](auto& v) { v = {v.x, v.z, -v.y}; };
  for (Vec4f& t : mesh.tangents) t = {t.x, t.z, -t.y, t.w};
  turn(mesh.origin);
  for (Vec3f& p : mesh.positions) turn(p);
  for (Vec3f& n : mesh.normals) turn(n);
}

}  // namespace

void finish_model(Model& model, const std::string& file_name, const ImportOptions& options) {
  fill_defaults(model);
  check_structure(model, file_name);
  check_limits(model, file_name, options);
  drop_non_finite_triangles(model, file_name);
  drop_unused_vertices(model);
  repair_uvs(model, model.mesh.uv0, file_name);
  repair_uvs(model, model.mesh.uv1, file_name);
  repair_normals(model.mesh);
  clamp_colours(model.mesh.colours);
  drop_unused_materials(model);
  drop_unused_parts(model.mesh);
  drop_unused_images(model, file_name);
  repair_tangents(model);
  bring_uvs_near(model);
  if (options.up == UpAxis::kZ) turn_z_up(model.mesh);
}

}  // namespace texmesh
