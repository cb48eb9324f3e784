#include "pipeline/import/mesh_builder.h"

#include "format/base/text_bytes.h"
#include "pipeline/import/material_images.h"
#include "pipeline/import/up_axis.h"
#include "pipeline/io/table.h"
#include "stages/geometry/mesh_topology.h"

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

/// Positions and wedges that no triangle needs, with a note; indices follow, here and below.
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
             counted(position.size() - positions, "vertex", "vertices") + " of no triangle left out");
  keep_marked(mesh.uv0, wedge);
  keep_marked(mesh.uv1, wedge);
  keep_marked(mesh.normals, wedge);
  keep_marked(mesh.colours, wedge);
  keep_marked(mesh.tangents, wedge);
  keep_marked(mesh.wedge_position, wedge);
  keep_marked(mesh.positions, position);
  if (mesh.rounding.size() > 1) keep_marked(mesh.rounding, position);
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

/// After drop_unused_materials. InputError when a material refers to an image that is not there.
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

/// Least move in u and in v that a chart's textures do not notice, in repeats; 0 = none.
struct Period {
  std::array<int, 2> move{1, 1};
  void restrict_by(int axis, int other) {
    int& along = move[static_cast<std::size_t>(axis)];
    along = along == 0 || other == 0 ? 0 : std::max(along, other);  // 1 or 2
  }
};

int period_of(Wrap wrap) { return wrap == Wrap::kRepeat ? 1 : wrap == Wrap::kMirror ? 2 : 0; }

Period period_of(const Material& material, int set) {
  Period period;
  bool used = false;
  for_each_texture(material, [&](const TextureRef& t) {
    if (!t.used() || t.texcoord != set) return;
    used = true;
    // A scale by whole numbers takes whole moves to whole moves.
    const Vec2f s = t.transform.scale;
    const bool whole = t.transform.rotation == 0 && s.x == std::floor(s.x) && s.y == std::floor(s.y);
    period.restrict_by(0, whole ? period_of(t.wrap_s) : 0);
    period.restrict_by(1, whole ? period_of(t.wrap_t) : 0);
  });
  // No texture uses these coordinates: only the application that they are for knows what they mean.
  if (!used) period.move = {0, 0};
  return period;
}

/// Per wedge the lowest wedge of its chart.
std::vector<std::uint32_t> charts_of(const Mesh& mesh) {
  DisjointSets charts(mesh.wedge_count());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 1; k < 3; ++k) charts.join(t[0], t[k]);
  std::vector<std::uint32_t> lowest(mesh.wedge_count());
  for (std::uint32_t w = 0; w < lowest.size(); ++w) lowest[w] = charts.find(w);
  return lowest;
}

void bring_near(const Model& model, const std::vector<std::uint32_t>& chart, int set,
                std::vector<Vec2f>& uvs) {
  constexpr float kFar = 2;
  const auto is_far = [](Vec2f uv) { return !(std::fabs(uv.x) < kFar && std::fabs(uv.y) < kFar); };
  if (std::none_of(uvs.begin(), uvs.end(), is_far)) return;
  const Mesh& mesh = model.mesh;
  std::vector<Period> period_of_material, period(uvs.size());
  for (const Material& m : model.materials) period_of_material.push_back(period_of(m, set));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Period& p = period_of_material[mesh.triangle_material[t]];
    for (int axis = 0; axis < 2; ++axis)
      period[chart[mesh.triangles[t][0]]].restrict_by(axis, p.move[static_cast<std::size_t>(axis)]);
  }
  constexpr float kMost = std::numeric_limits<float>::max();
  std::vector<Vec2f> lowest(uvs.size(), {kMost, kMost}), highest(uvs.size(), {-kMost, -kMost});
  for (std::size_t w = 0; w < uvs.size(); ++w) {
    Vec2f &lo = lowest[chart[w]], &hi = highest[chart[w]];
    lo = {std::min(lo.x, uvs[w].x), std::min(lo.y, uvs[w].y)};
    hi = {std::max(hi.x, uvs[w].x), std::max(hi.y, uvs[w].y)};
  }
  const auto move = [](float lo, float hi, int repeats) {
    if (repeats == 0) return 0.0f;
    const float whole = std::floor(lo / static_cast<float>(repeats)) * static_cast<float>(repeats);
    const bool nearer = hi - whole < std::max(std::fabs(lo), std::fabs(hi));
    return std::fabs(whole) >= kFar && nearer ? whole : 0.0f;
  };
  for (std::size_t w = 0; w < uvs.size(); ++w) {
    const std::array<int, 2>& p = period[chart[w]].move;
    const Vec2f lo = lowest[chart[w]], hi = highest[chart[w]];
    uvs[w] = {uvs[w].x - move(lo.x, hi.x, p[0]), uvs[w].y - move(lo.y, hi.y, p[1])};
  }
}

/// Moves charts (wedges joined by triangles) that lie far from 0..1 near to it, by whole repeats of their
/// textures: nobody sees a difference, and coordinates keep the bits that a place 1,500 repeats away costs.
/// Only where there are textures and every one of the chart's materials repeats in that direction under the
/// move (wrap mode and texture transform allow it); charts within two repeats stay where they are, and so do
/// those so long that their other end would only get as far away.
void bring_uvs_near(Model& model) {
  if (model.mesh.uv0.empty() && model.mesh.uv1.empty()) return;
  const std::vector<std::uint32_t> chart = charts_of(model.mesh);
  bring_near(model, chart, 0, model.mesh.uv0);
  bring_near(model, chart, 1, model.mesh.uv1);
}

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

template <class F>
void keep_triangles(Mesh& mesh, F&& keeps) {
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keeps(t)) continue;
    mesh.triangles[kept] = mesh.triangles[t];
    mesh.triangle_material[kept] = mesh.triangle_material[t];
    mesh.triangle_part[kept] = mesh.triangle_part[t];
    ++kept;
  }
  mesh.triangles.resize(kept);
  mesh.triangle_material.resize(kept);
  mesh.triangle_part.resize(kept);
}

void drop_non_finite_triangles(Model& model, const std::string& file_name) {
  Mesh& mesh = model.mesh;
  std::vector<bool> good(mesh.triangles.size(), true);
  for (std::size_t t = 0; t < good.size(); ++t)
    for (std::uint32_t w : mesh.triangles[t])
      if (!finite(mesh.positions[mesh.wedge_position[w]])) good[t] = false;
  const auto kept = static_cast<std::size_t>(std::count(good.begin(), good.end(), true));
  const std::size_t dropped = good.size() - kept;
  if (dropped && kept == 0)
    throw InputError(file_name, "positions", "some finite ones",
                     "NaN, infinity or more than " + shortest(kLargestCoordinate) + " in every triangle");
  if (kept == 0) throw InputError(file_name, "triangles", "at least one", "none");
  if (!dropped) return;
  keep_triangles(mesh, [&](std::size_t t) { return good[t]; });
  add_warning(model.notes, "non-finite-position", file_name,
              counted(dropped, "triangle") +
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
    add_warning(model.notes, "non-finite-uv", file_name,
                counted(bad, "texture coordinate") + " with NaN or infinity set to 0");
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

/// In white nobody would see the shape.
void show_without_colour(Model& model) {
  constexpr float kGrey = 0.6f;  // linear: what plaster has
  const auto has_none = [](const Material& m) { return m == scan_material(m.name); };
  if (!model.mesh.colours.empty() || !std::ranges::all_of(model.materials, has_none)) return;
  for (Material& m : model.materials) m.base_colour = {kGrey, kGrey, kGrey, 1};
  if (model.notes.empty())  // else they say what is missing
    add_info(model.notes, "no-colour", "", "the scan has no colour and is shown in light grey");
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
  if (options.up > UpAxis::kKeep) turn_up(model.mesh, enum_name(options.up)[0]);
}

void finish_scan(Model& model, const std::string& file_name, const ImportOptions& options,
                 const RunContext& context) {
  show_without_colour(model);
  finish_model(model, file_name, options);
  judge_alpha(model, context);
}

namespace {

/// Finds triangles on the three points of another one, turned round.
class Twins {
 public:
  explicit Twins(const Model& model) : model_(model), mesh_(model.mesh) {}

  /// Triangles that another one before them hides from both sides.
  std::vector<bool> hidden() {
    std::vector<std::uint64_t> keys;  // hash, number
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
      if (material_of(t).alpha_mode != AlphaMode::kBlend) keys.push_back(hash_of(t) << 32 | t);
    std::sort(keys.begin(), keys.end());
    std::vector<bool> hidden(mesh_.triangles.size());
    for (std::size_t i = 1; i < keys.size(); ++i)
      for (std::size_t j = i; j-- > 0 && i - j <= kMostLooks && keys[j] >> 32 == keys[i] >> 32;) {
        const auto later = static_cast<std::uint32_t>(keys[i]), earlier = static_cast<std::uint32_t>(keys[j]);
        if (hidden[earlier] || !hides(earlier, later)) continue;
        hidden[later] = true;
        break;
      }
    return hidden;
  }

  /// Of them those that look otherwise than the one that hides them.
  std::uint64_t others() const { return others_; }

 private:
  static constexpr std::size_t kMostLooks = 32;

  Vec3f point(std::uint32_t t, std::size_t k) const {
    return mesh_.positions[mesh_.wedge_position[mesh_.triangles[t][k]]];
  }
  const Material& material_of(std::uint32_t t) const { return model_.materials[mesh_.triangle_material[t]]; }

  std::uint64_t hash_of(std::uint32_t t) const {
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f p = point(t, k) + Vec3f{0, 0, 0};  // -0 becomes 0
      std::uint64_t hash = 0;
      for (const float x : {p.x, p.y, p.z}) hash = hash_with(hash, std::bit_cast<std::uint32_t>(x));
      sum += hash;
    }
    return sum >> 32;
  }

  bool hides(std::uint32_t earlier, std::uint32_t later) {
    const Material &a = material_of(earlier), &b = material_of(later);
    if (!a.double_sided) return false;
    for (std::size_t k = 0; k < 3; ++k) {  // the corner of `later` that is the first of `earlier`
      const std::size_t after = (k + 1) % 3, before = (k + 2) % 3;
      if (!(point(later, k) == point(earlier, 0) && point(later, before) == point(earlier, 1) &&
            point(later, after) == point(earlier, 2)))
        continue;
      const bool same_look = &a == &b && same_uvs(earlier, later, {k, before, after});
      if (a.alpha_mode == AlphaMode::kOpaque ? b.alpha_mode != AlphaMode::kOpaque : !same_look) return false;
      others_ += !same_look;
      return true;
    }
    return false;
  }

  bool same_uvs(std::uint32_t a, std::uint32_t b, std::array<std::size_t, 3> corner_of_b) const {
    for (const auto* uvs : {&mesh_.uv0, &mesh_.uv1})
      for (std::size_t k = 0; k < 3 && !uvs->empty(); ++k)
        if (!((*uvs)[mesh_.triangles[a][k]] == (*uvs)[mesh_.triangles[b][corner_of_b[k]]])) return false;
    return true;
  }

  const Model& model_;
  const Mesh& mesh_;
  std::uint64_t others_ = 0;
};

}  // namespace

void drop_hidden_twins(Model& model, const std::string& file_name, Lost& lost) {
  const auto shows_both_sides = [](const Material& m) {
    return m.double_sided && m.alpha_mode != AlphaMode::kBlend;
  };
  if (std::none_of(model.materials.begin(), model.materials.end(), shows_both_sides)) return;
  Twins twins(model);
  const std::vector<bool> hidden = twins.hidden();
  const auto dropped = static_cast<std::size_t>(std::count(hidden.begin(), hidden.end(), true));
  if (dropped == 0) return;
  if (twins.others() > 0)
    lost["triangles with another look behind one that shows both sides"] = twins.others();
  add_info(model.notes, "hidden-twin", "",
           counted(dropped, "triangle") +
               " left out that are another one turned round, whose material shows both sides");
  keep_triangles(model.mesh, [&](std::size_t t) { return !hidden[t]; });
  drop_unused_vertices(model);
  drop_unused_materials(model);
  drop_unused_parts(model.mesh);
  drop_unused_images(model, file_name);
}

}  // namespace texmesh
