#include "pipeline/import/obj/obj_material.h"

#include "pipeline/import/import_images.h"
#include "pipeline/import/material_images.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxObjMaterials = 65000, kMaxWordBytes = 24;

// Numbers at the front of `rest`, at most `most`; `rest` moves past them. The last token is never taken: a
// file may be named "1".
std::vector<double> leading_numbers(std::string_view& rest, std::size_t most) {
  std::vector<double> numbers;
  while (numbers.size() < most) {
    std::string_view after = rest;
    double x = 0;
    if (!parse_number(next_token(after), x) || trim(after).empty()) break;
    numbers.push_back(x);
    rest = after;
  }
  return numbers;
}

double or_default(double x, double fallback) { return std::isfinite(x) ? x : fallback; }

// One option with its arguments; false when the text does not begin with an option.
bool consume_option(std::string_view& rest, MtlTexture& texture) {
  std::string_view after = rest;
  const std::string option = lower(next_token(after));
  if (option.size() < 2 || option[0] != '-') return false;
  if (option == "-s" || option == "-o" || option == "-t") {
    const std::vector<double> n = leading_numbers(after, 3);
    Vec2d& target = option == "-s" ? texture.scale : texture.offset;
    if (!n.empty() && option != "-t") target.x = or_default(n[0], target.x);
    if (n.size() > 1 && option != "-t") target.y = or_default(n[1], target.y);
  } else if (option == "-mm") {
    leading_numbers(after, 2);
  } else if (option == "-bm") {
    double bump = 1;
    if (parse_number(next_token(after), bump)) texture.bump = or_default(bump, 1);
  } else if (option == "-clamp") {
    texture.clamp = same_word(next_token(after), "on");
  } else if (option == "-blendu" || option == "-blendv" || option == "-boost" || option == "-cc" ||
             option == "-imfchan" || option == "-texres" || option == "-type" || option == "-colorspace") {
    next_token(after);
  } else {
    return false;
  }
  rest = after;
  return true;
}

std::optional<MtlTexture> read_texture(std::string_view rest, std::size_t line) {
  MtlTexture texture;
  texture.line = line;
  while (consume_option(rest, texture)) {
  }
  texture.file = trim(rest);
  return texture.file.empty() ? std::nullopt : std::optional(texture);
}

class MtlReader {
 public:
  MtlReader(const std::string& name, std::string_view text, Notes& notes)
      : name_(name), lines_(text), notes_(notes) {}

  MtlFile read() {
    std::string_view line;
    while (lines_.next(line)) {
      std::string_view rest = line;
      const std::string_view word = next_token(rest);
      if (!word.empty() && word.front() == '#') {
        if (lower(line.substr(0, 200)).find("meshlab") != std::string::npos) file_.by_meshlab = true;
      } else if (same_word(word, "newmtl")) {
        begin(std::string(trim(rest)));
      } else if (!file_.materials.empty()) {
        statement(lower(word), rest, file_.materials[current_]);
      }
    }
    return std::move(file_);
  }

 private:
  /// A name that is there already goes on, as in most readers: later statements stand.
  void begin(const std::string& material) {
    const auto [at, is_new] = number_of_.try_emplace(material, file_.materials.size());
    current_ = at->second;
    if (!is_new && !std::exchange(repeated_, true))
      add_warning(notes_, "repeated-material", name_ + " " + lines_.place(),
                  "material " + quote(material) +
                      " is there already; what stands here is added to it, or set over it");
    if (!is_new) return;
    if (file_.materials.size() >= kMaxObjMaterials)
      throw InputError(name_, lines_.place(), "at most " + std::to_string(kMaxObjMaterials) + " materials",
                       "more");
    file_.materials.emplace_back().name = material;
  }

  std::optional<double> number(std::string_view rest) {
    double x = 0;
    std::string_view token = next_token(rest);
    if (token == "-halo") token = next_token(rest);  // `d -halo 0.5`
    if (parse_number(token, x) && std::isfinite(x)) return x;
    warn(token);
    return std::nullopt;
  }

  std::optional<Vec3d> colour(std::string_view rest) {
    Vec3d c;
    for (int i = 0; i < 3; ++i) {
      const std::string_view token = next_token(rest);
      if (token.empty() && i > 0) {
        c[i] = c[0];  // `Kd 0.5` is grey
      } else if (!parse_number(token, c[i]) || !std::isfinite(c[i])) {
        warn(token);
        return std::nullopt;
      }
    }
    return c;
  }

  void warn(std::string_view token) {
    if (warned_) return;
    warned_ = true;
    add_warning(notes_, "odd-material", name_ + " " + lines_.place(),
                "expected a number, found " + quote(token));
  }

  void statement(const std::string& word, std::string_view rest, MtlMaterial& m) {
    using M = MtlMaterial;
    static const std::map<std::string, std::optional<Vec3d> M::*> colours{{"kd", &M::diffuse},
                                                                          {"ke", &M::emission}};
    static const std::map<std::string, std::optional<double> M::*> numbers{
        {"d", &M::opacity}, {"tr", &M::transparency}, {"pr", &M::roughness}, {"pm", &M::metallic}};
    static const std::map<std::string, std::optional<MtlTexture> M::*> textures{
        {"map_kd", &M::map_kd},       {"map_ka", &M::map_ka}, {"map_ke", &M::map_ke},
        {"map_emissive", &M::map_ke}, {"map_d", &M::map_d},   {"map_opacity", &M::map_d},
        {"map_pr", &M::map_pr},       {"map_pm", &M::map_pm}, {"norm", &M::norm},
        {"map_kn", &M::norm},         {"bump", &M::bump},     {"map_bump", &M::bump}};
    static const std::set<std::string> of_other_lights{
        "", "ka", "ks", "ns", "ni", "tf", "illum", "km", "ps", "sharpness", "pc", "pcr", "aniso", "anisor"};
    static const std::set<std::string> left_out{"map_ks",   "map_ns", "map_ps", "disp",
                                                "map_disp", "decal",  "refl",   "map_refl"};
    if (const auto c = colours.find(word); c != colours.end())
      m.*c->second = colour(rest);
    else if (const auto n = numbers.find(word); n != numbers.end())
      m.*n->second = number(rest);
    else if (const auto t = textures.find(word); t != textures.end())
      m.*t->second = read_texture(rest, lines_.number());
    else if (left_out.contains(word))
      m.left_out.push_back(word + " line " + std::to_string(lines_.number()));
    else if (!of_other_lights.contains(word))
      count_lost(file_.unread, word.substr(0, kMaxWordBytes));
  }

  const std::string& name_;
  LineReader lines_;
  Notes& notes_;
  MtlFile file_;
  std::map<std::string, std::size_t> number_of_;  // of materials
  std::size_t current_ = 0;
  bool warned_ = false, repeated_ = false;
};

// ---- to glTF

// uv' = scale * uv + offset with v upwards, said with v downwards.
UvTransform transform_of(const MtlTexture& texture) {
  UvTransform t;
  t.scale = {static_cast<float>(texture.scale.x), static_cast<float>(texture.scale.y)};
  t.offset = {static_cast<float>(texture.offset.x),
              static_cast<float>(1 - texture.scale.y - texture.offset.y)};
  return t;
}

struct Converter {
  const MtlMaterial& mtl;
  const std::string& mtl_name;
  Model& model;
  Resolver& resolver;
  const ImportOptions& options;

  std::string place(const MtlTexture& t) const {
    return "material " + quote(mtl.name) + " line " + std::to_string(t.line);
  }

  TextureRef texture(const std::optional<MtlTexture>& t) const {
    TextureRef ref;
    if (!t) return ref;
    ref.image = add_image(model, {t->file, mtl_name, false}, resolver, mtl_name, place(*t), options);
    if (!ref.used()) return {};
    ref.transform = transform_of(*t);
    if (t->clamp) ref.wrap_s = ref.wrap_t = Wrap::kClamp;
    return ref;
  }

  void base_colour(Material& out) const {
    out.base_colour_texture = texture(mtl.map_kd ? mtl.map_kd : mtl.map_ka);
    if (mtl.diffuse && (!out.base_colour_texture.used() || options.obj_kd == KdPolicy::kMultiply)) {
      const Vec3d kd = *mtl.diffuse;
      out.base_colour = {linear_from_srgb(kd.x), linear_from_srgb(kd.y), linear_from_srgb(kd.z), 1};
    }
  }

  static bool same_place(const MtlTexture& a, const MtlTexture& b) {
    return a.scale == b.scale && a.offset == b.offset && a.clamp == b.clamp;
  }

  void separate_alpha(Material& out) const {
    const TextureRef alpha = texture(mtl.map_d);
    if (!alpha.used()) return;
    if (mtl.map_kd && !same_place(*mtl.map_kd, *mtl.map_d)) {
      add_warning(model.notes, "separate-alpha-map", mtl_name + " " + place(*mtl.map_d),
                  "map_d lies elsewhere than map_Kd (-s, -o, -clamp) and is not used");
      return;
    }
    const std::int32_t colour = out.base_colour_texture.image;
    out.base_colour_texture = alpha;
    out.base_colour_texture.image = combine_alpha(model, colour, alpha.image);
    out.alpha_mode = AlphaMode::kBlend;
  }

  void roughness_metallic(Material& out) const {
    TextureRef rough = texture(mtl.map_pr), metal = texture(mtl.map_pm);
    if (rough.used() && metal.used() && !same_place(*mtl.map_pr, *mtl.map_pm)) {
      add_warning(model.notes, "separate-metallic-map", mtl_name + " " + place(*mtl.map_pm),
                  "map_Pm lies elsewhere than map_Pr (-s, -o, -clamp) and is not used");
      metal = {};
    }
    if (!rough.used() && !metal.used()) return;
    out.metallic_roughness_texture = rough.used() ? rough : metal;
    out.metallic_roughness_texture.image = combine_roughness_metallic(model, rough.image, metal.image);
    // The map says it all: Pr beside it is what viewers without maps show.
    if (rough.used()) out.roughness = 1;
    if (metal.used()) out.metallic = 1;
  }

  double opacity(bool by_meshlab) const {
    if (mtl.opacity) return *mtl.opacity;
    if (!mtl.transparency) return 1;
    if (by_meshlab) return *mtl.transparency;
    if (*mtl.transparency < 1) return 1 - *mtl.transparency;
    add_info(model.notes, "transparency-read-as-opaque", mtl_name,
             "material " + quote(mtl.name) + ": Tr 1 without d is read as opaque");
    return 1;
  }

  void alpha(Material& out, bool by_meshlab) const {
    const double d = opacity(by_meshlab);
    out.base_colour.w = static_cast<float>(std::clamp(d, 0.0, 1.0));
    if (d < 1) out.alpha_mode = AlphaMode::kBlend;
    if (d <= 0)
      add_warning(model.notes, "invisible-material", mtl_name,
                  "material " + quote(mtl.name) + " has no opacity");
    if (mtl.map_d && !(mtl.map_kd && mtl.map_kd->file == mtl.map_d->file)) separate_alpha(out);
  }

  void normal(Material& out) const {
    const std::optional<MtlTexture>& source = mtl.norm ? mtl.norm : mtl.bump;
    if (!source) return;
    const TextureRef ref = texture(source);
    if (!ref.used()) return;
    if (model.images[static_cast<std::size_t>(ref.image)].channels < 3)
      return add_info(model.notes, "height-map", mtl_name + " " + place(*source),
                      source->file + " is no normal map; height maps are not shown");
    out.normal_texture = ref;
    out.normal_scale = static_cast<float>(source->bump);
  }

  void emission(Material& out) const {
    out.emissive_texture = texture(mtl.map_ke);
    const Vec3d ke = mtl.emission.value_or(Vec3d{});
    out.emissive = {linear_from_srgb(ke.x), linear_from_srgb(ke.y), linear_from_srgb(ke.z)};
    if (out.emissive_texture.used() && out.emissive == Vec3f{}) out.emissive = {1, 1, 1};
  }
};

std::string without_comment(std::string_view name) {
  return std::string(trim(name.substr(0, name.find(" #"))));
}

}  // namespace

MtlMaterial of_tile(MtlMaterial material, std::uint16_t tile) {
  for_each_map(material, [&](std::string& file) { file = name_of_tile(std::move(file), tile); });
  material.name += "." + std::to_string(tile);
  return material;
}

std::vector<std::string> names_of_libraries(std::string_view rest) {
  std::vector<std::string> names;
  while (!(rest = trim(rest)).empty() && rest.front() != '#') {
    const std::size_t end = rest.front() == '"' ? rest.find('"', 1) : rest.npos;
    if (end == rest.npos) {
      names.emplace_back(next_token(rest));
    } else {
      names.emplace_back(rest.substr(0, end + 1));
      rest.remove_prefix(end + 1);
    }
  }
  return names;
}

MtlFile read_mtl(const std::string& name, std::span<const std::uint8_t> bytes, Notes& notes) {
  const SourceText text(text_of(bytes), name, notes);
  return MtlReader(name, text.text(), notes).read();
}

LoadedLibrary::LoadedLibrary(std::string library_name, MtlFile library_file)
    : name(std::move(library_name)), file(std::move(library_file)) {
  for (std::size_t i = 0; i < file.materials.size(); ++i) by_name.try_emplace(file.materials[i].name, i);
  for (std::size_t i = 0; i < file.materials.size(); ++i)
    by_name.try_emplace(without_comment(file.materials[i].name), i);
}

const MtlMaterial* LoadedLibrary::find(const std::string& wanted) const {
  auto it = by_name.find(wanted);
  if (it == by_name.end()) it = by_name.find(without_comment(wanted));
  return it == by_name.end() ? nullptr : &file.materials[it->second];
}

FoundMaterial find_material(const std::vector<LoadedLibrary>& libraries, const std::string& name) {
  for (const LoadedLibrary& library : libraries)
    if (const MtlMaterial* material = library.find(name)) return {material, &library};
  return {};
}

LibraryLoader::LibraryLoader(const std::string& file, Model& model, Resolver& resolver,
                             const ImportOptions& options)
    : own_name_(file.substr(0, file.rfind('.')) + ".mtl"),
      model_(model),
      resolver_(resolver),
      max_bytes_(static_cast<std::uint64_t>(options.max_file_bytes)) {}

void LibraryLoader::load(const std::string& line_names, std::size_t line) {
  place_ = "line " + std::to_string(line);
  const std::vector<std::string> names = names_of_libraries(line_names);
  if (names.empty()) return;
  const std::string whole = load_one(line_names);
  if (whole.empty() || names.size() == 1) return missing(line_names, whole);
  std::vector<std::pair<std::string, std::string>> absent;
  for (const std::string& name : names)
    if (const std::string looked_for = load_one(name); !looked_for.empty())
      absent.emplace_back(name, looked_for);
  if (absent.size() == names.size()) return missing(line_names, whole);
  for (const auto& [name, looked_for] : absent) missing(name, looked_for);
}

/// Where it was looked for; "" when it was found.
std::string LibraryLoader::load_one(const std::string& name) {
  NamedFile found = find_file({name, "", false}, resolver_, max_bytes_, model_.notes, place_);
  if (!found.bytes) return found.looked_for;
  if (const std::string foreign = foreign_file(*found.bytes); !foreign.empty())
    return quote(found.name) + " is " + foreign;
  loaded_.emplace_back(found.name, read_mtl(found.name, *found.bytes, model_.notes));
  return "";
}

/// Who renames a model and its library forgets the line that names it.
void LibraryLoader::missing(const std::string& name, const std::string& looked_for) {
  if (looked_for.empty()) return;
  if (loaded_.empty() && load_one(own_name_).empty())
    return add_warning(model_.notes, "renamed-mtl", place_,
                       "material library " + quote(name) + " is not there; " + quote(loaded_[0].name) +
                           ", which is named after the model, is taken");
  any_missing_ = true;
  add_warning(
      model_.notes, "missing-mtl", place_,
      "material library " + quote(name) + " not found: " + looked_for + "; its materials stay untextured");
}

Material material_from_mtl(const MtlMaterial& mtl, const MtlFile& file, const std::string& mtl_name,
                           Model& model, Resolver& resolver, const ImportOptions& options) {
  Material out = scan_material(mtl.name);
  const Converter converter{mtl, mtl_name, model, resolver, options};
  converter.base_colour(out);
  converter.alpha(out, file.by_meshlab);
  converter.normal(out);
  converter.emission(out);
  if (mtl.roughness) out.roughness = static_cast<float>(std::clamp(*mtl.roughness, 0.0, 1.0));
  if (mtl.metallic) out.metallic = static_cast<float>(std::clamp(*mtl.metallic, 0.0, 1.0));
  converter.roughness_metallic(out);
  for (const std::string& statement : mtl.left_out)
    add_warning(model.notes, "unsupported-map", mtl_name + " material " + quote(mtl.name),
                statement + " has no counterpart in glTF and is left out");
  return out;
}

}  // namespace texmesh
