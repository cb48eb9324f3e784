// Of every texture plane: its grid with what each fragment is worth and takes, its rungs, and the tables by
// which clients choose rungs.
#include "tools/inspect/dump/dump.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/rules/allocation.h"
#include "pipeline/io/table.h"

namespace texmesh {
namespace {

/// The texture quality that the tables ask for at the scale of a row and Gamma.
struct AllocationFigures {
  double gamma = 0, quality_min = 0, quality_mean = 0, quality_max = 0;  // quality 0: skipped
  std::uint64_t bytes = 0;  // of the chosen rungs, table streams not counted
  // Per fragment: q_i(x, y) (with rd: the quality of the rung), its rung, d_i(x, y)
  std::vector<float> fragment_quality;
  std::vector<std::int16_t> fragment_rung;
  std::vector<std::uint32_t> fragment_bytes;
};
/// Without `gamma` (0..1): at the default one, the mean of eta.
AllocationFigures allocation_figures(const PlaneTables& t, std::size_t row, DumpGamma gamma = {}) {
  AllocationFigures f;
  f.gamma = gamma ? *gamma : mean_eta(t, row);
  f.fragment_quality = quality_of(t, row, f.gamma);
  f.fragment_rung = rungs_of(t, row, f.gamma);
  f.fragment_bytes = bytes_of(t, f.fragment_rung);
  f.bytes = sum_of(f.fragment_bytes);
  if (t.order.empty()) return f;
  f.quality_min = 1e9;
  for (const std::uint16_t i : t.order) {
    if (t.allocation == 2)  // what was bought, not what was asked for
      f.fragment_quality[i] =
          f.fragment_rung[i] == kSkipped ? 0 : t.rung_quality[static_cast<std::size_t>(f.fragment_rung[i])];
    const double q = static_cast<double>(f.fragment_quality[i]);
    f.quality_min = std::min(f.quality_min, q);
    f.quality_max = std::max(f.quality_max, q);
    f.quality_mean += q;
  }
  f.quality_mean /= static_cast<double>(t.order.size());
  return f;
}

std::string allocation_name(const PlaneTables& t) {
  return t.allocation == 0 ? "thesis" : t.allocation == 1 ? "log" : t.allocation == 2 ? "rd" : "vqp";
}

/// The title line of a texture plane.
std::string plane_title(const TextureInfo& t, std::size_t plane) {
  const std::string name = t.name.empty() ? "" : " \"" + printable(t.name) + "\"";
  const std::string mip = t.mip == 0 ? "" : fmt::format(", mip {} of plane {}", t.mip, t.base);
  return fmt::format("texture plane {}{}, {}{}: {} x {} px, {} channel{}\n", plane, name, t.role, mip,
                     t.width_px, t.height_px, t.channels, t.channels == 1 ? "" : "s");
}

/// Where texture detail lies: a digit per fragment, eta of S_0 in tenths, '.' where nothing is stored.
std::string eta_map(const PlaneTables& t, const std::vector<float>& eta) {
  std::string map;
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    const int tenth = std::clamp(static_cast<int>(10 * eta[i]), 0, 9);
    map += i % t.columns == 0 ? "  " : " ";
    map += t.covered_texels[i] == 0 ? '.' : static_cast<char>('0' + tenth);
    if (i % t.columns == t.columns - 1) map += '\n';
  }
  return map;
}

Table fragments_table(const TextureInfo& info, const PlaneTables& t, const PlaneThesis* thesis,
                      const std::vector<float>& eta) {
  Table table("fragments by falling importance; q_0, d_0: quality and bytes that the tables ask for at S_0",
              {"rank",
               "fragment",
               "column",
               "row",
               {"covered %", percent_form()},
               {"surface %", percent_form(2)},
               {"eta", 3},
               {"VQP", 3},
               {"q_0", 1},
               "d_0 B"});
  for (const int q : info.rung_quality) table.column(fmt::format("q{} B", q));
  const AllocationFigures finest = allocation_figures(t, 0);
  const double texels = static_cast<double>(info.fragment_width_px) * info.fragment_height_px;
  for (std::size_t rank = 0; rank < t.order.size(); ++rank) {
    const std::size_t i = t.order[rank];
    table.row({rank, i, i % t.columns, i / t.columns, t.covered_texels[i] / texels, t.surface_fraction[i],
               eta[i], thesis && i < thesis->vqp.size() ? Cell(thesis->vqp[i]) : Cell(),
               finest.fragment_quality[i], finest.fragment_bytes[i]});
    for (std::size_t r = 0; r < t.rung_count(); ++r)
      table.rows.back().emplace_back(t.size_bytes[r * t.fragment_count() + i]);
  }
  return table;
}

Table rungs_table(const TextureInfo& info, const PlaneTables& t) {
  Table table("", {{"rung", 0, "rung"},
                   {"quality", 0, "quality"},
                   {"kB", kKilobytes, "bytes"},
                   {"tables B", 0, "table_bytes"},
                   {"mean MSE", 2, "mse"},
                   {"mean SSIM", 4, "ssim"},
                   {"surface SSIM", 4, "surface_ssim"},
                   {"bits/texel", 3},
                   Column::data("path")});
  double texels = 0;
  for (const std::uint16_t i : t.order) texels += t.covered_texels[i];
  const std::vector<RungFigures> figures = rung_figures(t);
  for (std::size_t r = 0; r < figures.size(); ++r) {
    const RungFigures& f = figures[r];
    table.row({r, f.quality, f.bytes, f.table_bytes, f.mse, f.ssim, f.surface_ssim,
               texels > 0 ? Cell(8 * static_cast<double>(f.bytes) / texels) : Cell(), info.rungs[r].path});
  }
  return table;
}

Table allocation_table(const PlaneTables& t, const std::vector<ManifestScale>& scales, DumpGamma gamma) {
  Table table("", {{"scale", kScaleName},
                   {"Q_i", 1},
                   {"Gamma", 3},
                   {"q_i min", 1},
                   {"mean", 1},
                   {"max", 1},
                   {"D_i kB", kKilobytes}});
  for (const char* heading : {"Gamma 0 kB", "0.25 kB", "0.5 kB", "0.75 kB", "1 kB"})
    table.column({heading, kKilobytes});
  for (std::size_t s = 0; s < t.scale_count(); ++s) {
    const AllocationFigures f = allocation_figures(t, s, gamma);
    table.row(
        {scales[s].scale, t.quality[s], f.gamma, f.quality_min, f.quality_mean, f.quality_max, f.bytes});
    for (const double g : {0.0, 0.25, 0.5, 0.75, 1.0})
      table.rows.back().emplace_back(bytes_asked_for(t, s, g));
  }
  return table;
}

/// q_i(x, y) and d_i(x, y) of every stored fragment and scale at one Gamma.
Table gamma_table(const PlaneTables& t, const std::vector<ManifestScale>& scales, double gamma) {
  Table table(
      fmt::format("  fragments by falling importance at Gamma {}: quality, 0 = skipped, and bytes at S_i",
                  shortest(gamma)),
      {"fragment"});
  std::vector<AllocationFigures> rows;
  for (std::size_t s = 0; s < t.scale_count(); ++s) {
    table.column({fmt::format("q_{}", scales[s].scale), 1});
    table.column(fmt::format("d_{} B", scales[s].scale));
    rows.push_back(allocation_figures(t, s, gamma));
  }
  for (const std::uint16_t i : t.order) {
    table.row({i});
    for (const AllocationFigures& f : rows) {
      table.rows.back().emplace_back(f.fragment_quality[i]);
      table.rows.back().emplace_back(f.fragment_bytes[i]);
    }
  }
  return table;
}

Json allocation_json(const PlaneTables& t, int scale, std::size_t row, DumpGamma gamma) {
  const AllocationFigures f = allocation_figures(t, row, gamma);
  Json q = Json::array(), rungs = Json::array(), bytes = Json::array(), total = Json::array();
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    const bool stored = f.fragment_rung[i] != kSkipped;
    q.push_back(stored ? Json(f.fragment_quality[i]) : Json());
    rungs.push_back(stored ? Json(f.fragment_rung[i]) : Json());
    bytes.push_back(stored ? Json(f.fragment_bytes[i]) : Json());
  }
  for (std::size_t g = 0; g < kGammaSteps; ++g)
    total.push_back(bytes_asked_for(t, row, static_cast<double>(g) / (kGammaSteps - 1)));
  return {{"scale", scale},         {"quality", t.quality[row]},
          {"gamma", f.gamma},       {"bytes_at_gamma", f.bytes},
          {"total_bytes", total},   {"fragment_quality", q},
          {"fragment_rung", rungs}, {"fragment_bytes", bytes}};
}

/// The middle one of the fitted models' values.
double median_of(const std::vector<SizeModel>& models, float SizeModel::*value) {
  std::vector<float> values;
  for (const SizeModel& m : models) values.push_back(m.*value);
  std::ranges::sort(values);
  return static_cast<double>(values[values.size() / 2]);
}

std::string size_model_text(const PlaneThesis* thesis) {
  std::vector<SizeModel> models;
  if (thesis)
    std::ranges::copy_if(thesis->models, std::back_inserter(models),
                         [](const SizeModel& m) { return m != SizeModel{}; });
  if (models.empty()) return "  no size model\n";
  return fmt::format(
      "  size model S = A (100 VQP)^(B Q) of {} fragments: medians A {}, B {}, correlation {}\n",
      models.size(), shortest(median_of(models, &SizeModel::a)), shortest(median_of(models, &SizeModel::b)),
      fixed(median_of(models, &SizeModel::correlation), 4));
}

constexpr std::vector<float> PictureLosses::*kLosses[] = {&PictureLosses::flip, &PictureLosses::flip_p95,
                                                          &PictureLosses::dssim};

Table geometry_table(const QualityTable& q) {
  Table table("", {{"scale", kScaleName}});
  for (const char* what : {"FLIP", "p95", "1-SSIM"})
    for (const std::uint32_t px : q.sizes_px) table.column({fmt::format("{} {} px", what, px), 4});
  for (std::size_t s = 0; s < q.scales.size(); ++s) {
    table.row({q.scales[s]});
    for (const auto list : kLosses)
      for (const PictureLosses& losses : q.geometry) table.rows.back().emplace_back((losses.*list)[s]);
  }
  return table;
}

Table groups_table(const QualityTable& q) {
  Table table("", {Column::text("planes"),
                   "px",
                   Column::text("shown as"),
                   {"texels' 1-SSIM", 4},
                   {"FLIP", 4},
                   {"p95", 4},
                   {"1-SSIM", 4}});
  const auto add = [&](const GroupLosses& group, std::uint32_t px, const std::string& how, Cell texel_dssim,
                       const PictureLosses& losses, std::size_t i) {
    table.row({enum_name(group.group), px, how, std::move(texel_dssim)});
    for (const auto list : kLosses) table.rows.back().emplace_back((losses.*list)[i]);
  };
  for (const GroupLosses& group : q.groups)
    for (std::size_t i = 0; i < group.sizes.size(); ++i) {
      const TextureLosses& t = group.sizes[i];
      const std::uint32_t px = q.sizes_px[i];
      for (std::size_t k = 0; k < t.texel_dssim.size(); ++k)
        add(group, px, "coded", t.texel_dssim[k], t.coded, k);
      add(group, px, "previews", {}, t.preview, 0);
      for (std::size_t l = 0; l < t.finer.size(); ++l)
        add(group, px, l == 0 ? "mips" : fmt::format("{} mips finer", l), {}, t.finer, l);
      for (std::size_t l = 0; l < t.coarser.size(); ++l)
        add(group, px, fmt::format("{} mips coarser", l + 1), {}, t.coarser, l);
    }
  return table;
}

std::string measured_text(const QualityTable& q) {
  return fmt::format("lit pictures against S_0 with the source's textures ({} views)\n", q.views) +
         geometry_table(q).text() + (q.groups.empty() ? "" : groups_table(q).text()) +
         fmt::format("losses add up with exponent {}; mean error of that {} %\n",
                     fixed(static_cast<double>(q.exponent), 2), percent(static_cast<double>(q.error)));
}

}  // namespace

std::vector<RungFigures> rung_figures(const PlaneTables& t) {
  std::vector<RungFigures> rungs;
  const std::size_t fragments = t.fragment_count();
  for (std::size_t r = 0; r < t.rung_count(); ++r) {
    RungFigures f{t.rung_quality[r], 0, t.table_bytes[r], 0, 0};
    double texels = 0, dssim = 0;
    for (const std::uint16_t i : t.order) {
      const double weight = t.covered_texels[i];
      f.bytes += t.size_bytes[r * fragments + i];
      f.mse += weight * static_cast<double>(t.mse[r * fragments + i]);
      dssim += weight * static_cast<double>(t.dssim[r * fragments + i]);
      texels += weight;
    }
    if (texels > 0) f.mse /= texels, dssim /= texels;
    f.ssim = 1 - dssim;
    std::vector<std::int16_t> all(fragments, kSkipped);
    for (const std::uint16_t i : t.order) all[i] = static_cast<std::int16_t>(r);
    f.surface_ssim = 1 - surface_dssim(t, all);
    rungs.push_back(f);
  }
  return rungs;
}

std::string fragments_text(PackageReader& p, DumpGamma) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const PlaneTables& t = p.tables().planes[k];
    const std::vector<float> eta = density_of(t, 0);
    s += plane_title(info, k) + "grid: " + printable(info.grid_reason) +
         "\neta of S_0 in tenths, . = not stored\n" + eta_map(t, eta) +
         fragments_table(info, t, p.plane_thesis(k), eta).text() + "\n";
  }
  return s.empty() ? "no textures\n" : s;
}

Json fragments_json(PackageReader& p, DumpGamma) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const PlaneTables& t = p.tables().planes[k];
    const std::vector<float> eta = density_of(t, 0);
    Json fragments = Json::array();
    const PlaneThesis* thesis = p.plane_thesis(k);
    for (const std::uint16_t i : t.order) {
      Json bytes = Json::array(), features = Json::array();
      for (std::size_t r = 0; r < t.rung_count(); ++r)
        bytes.push_back(t.size_bytes[r * t.fragment_count() + i]);
      for (std::size_t row = 0; row < t.scale_count(); ++row)
        features.push_back(t.features[row * t.fragment_count() + i]);
      Json& j = fragments.emplace_back(Json{{"fragment", i},
                                            {"column", i % t.columns},
                                            {"row", i / t.columns},
                                            {"covered_texels", t.covered_texels[i]},
                                            {"surface_fraction", t.surface_fraction[i]},
                                            {"eta", eta[i]},
                                            {"features", features},
                                            {"bytes", bytes}});
      if (thesis && i < thesis->vqp.size())
        j.update(Json{{"vqp", thesis->vqp[i]},
                      {"z", thesis->z[i]},
                      {"i", thesis->i[i]},
                      {"zeta", thesis->zeta[i]},
                      {"m", thesis->m[i]}});
      if (thesis && i < thesis->models.size())
        if (const SizeModel& model = thesis->models[i]; model != SizeModel{})
          j["size_model"] = {{"a", model.a}, {"b", model.b}, {"correlation", model.correlation}};
    }
    planes.push_back({{"plane", k},
                      {"columns", info.columns},
                      {"rows", info.rows},
                      {"fragment_width_px", info.fragment_width_px},
                      {"fragment_height_px", info.fragment_height_px},
                      {"grid_reason", info.grid_reason},
                      {"rung_quality", info.rung_quality},
                      {"fragments", fragments}});
  }
  return {{"fragments", planes}};
}

std::string ladder_text(PackageReader& p, DumpGamma) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    s += plane_title(info, k) + rungs_table(info, p.tables().planes[k]).text();
    if (info.source_rung) s += "  the last rung holds the source's coefficients\n";
    if (!info.source_extension.empty())
      s += fmt::format("  {}: the source as it was, {} B{}\n", info.source.path, info.source.bytes,
                       info.source_colours ? "" : ", whose colours were converted for this plane");
    s += fmt::format(
        "  preview {} x {} px, {} B; means over covered texels, surface SSIM over the object's surface\n\n",
        info.preview_width_px, info.preview_height_px, info.preview.bytes);
  }
  return s.empty() ? "no textures\n" : s;
}

Json ladder_json(PackageReader& p, DumpGamma) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    planes.push_back({{"plane", k},
                      {"codec", codec_traits(info.codec).id},
                      {"preview_width_px", info.preview_width_px},
                      {"preview_height_px", info.preview_height_px},
                      {"preview_bytes", info.preview.bytes},
                      {"rungs", rungs_table(info, p.tables().planes[k]).json()}});
  }
  return {{"ladder", planes}};
}

std::string tables_text(PackageReader& p, DumpGamma gamma) {
  const std::vector<ManifestScale>& scales = p.manifest().scales;
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const PlaneTables& t = p.tables().planes[k];
    s += plane_title(p.textures()[k], k);
    s += size_model_text(p.plane_thesis(k));
    s += fmt::format(
        "  allocation {}, width {}, q within {} .. {}; D_i at {}, then by Gamma\n", allocation_name(t),
        shortest(
            static_cast<double>(t.allocation == 0 || t.allocation == kByVqp ? t.quality_width : t.log_width)),
        shortest(static_cast<double>(t.quality_min)), shortest(static_cast<double>(t.quality_max)),
        gamma ? "the Gamma asked for" : "the default Gamma");
    s += allocation_table(t, scales, gamma).text() + (gamma ? gamma_table(t, scales, *gamma).text() : "") +
         "\n";
  }
  return s + measured_text(p.quality());
}

Json tables_json(PackageReader& p, DumpGamma gamma) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const PlaneTables& t = p.tables().planes[k];
    Json scales = Json::array();
    for (std::size_t row = 0; row < t.scale_count(); ++row)
      scales.push_back(allocation_json(t, p.manifest().scales[row].scale, row, gamma));
    planes.push_back({{"plane", k},
                      {"allocation", allocation_name(t)},
                      {"quality_width", t.quality_width},
                      {"log_width", t.log_width},
                      {"quality_min", t.quality_min},
                      {"quality_max", t.quality_max},
                      {"scales", scales}});
    const PlaneThesis* thesis = p.plane_thesis(k);
    if (!thesis) continue;
    Json& chain = planes.back()["thesis"]["chain"] = Json::array();  // D_i(Gamma) of all scales
    for (std::size_t s = 0; s < thesis->quality.size(); ++s) {
      const auto begin = thesis->total_bytes.begin() + static_cast<std::ptrdiff_t>(s * kGammaSteps);
      chain.push_back({{"scale", s},
                       {"quality", thesis->quality[s]},
                       {"total_bytes", std::vector<std::uint64_t>(begin, begin + kGammaSteps)}});
    }
  }
  return {{"tables", planes}, {"measured_quality", Json::parse(write_quality(p.quality()))}};
}

}  // namespace texmesh
