#include "tools/inspect/dump/dump_textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "format/documents/tables.h"
#include "format/rules/allocation.h"
#include "pipeline/io/text_table.h"
#include "tools/inspect/dump/dump_cells.h"
#include "tools/inspect/dump/package_figures.h"

namespace texmesh {
namespace {

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

std::string allocation_text(const PlaneTables& t, const std::vector<ManifestScale>& scales,
                            std::optional<double> gamma) {
  TextTable table;
  for (const char* header : {"scale", "Q_i", "Gamma", "q_i min", "mean", "max", "D_i kB", "Gamma 0 kB",
                             "0.25 kB", "0.5 kB", "0.75 kB", "1 kB"})
    table.column(header);
  for (std::size_t s = 0; s < t.scale_count(); ++s) {
    const AllocationFigures f = allocation_figures(t, s, gamma);
    std::vector<std::string> row{fmt::format("S_{}", scales[s].scale),
                                 fixed(static_cast<double>(t.quality[s]), 1),
                                 fixed(f.gamma, 3),
                                 fixed(f.quality_min, 1),
                                 fixed(f.quality_mean, 1),
                                 fixed(f.quality_max, 1),
                                 kilobytes(f.bytes)};
    for (const double g : {0.0, 0.25, 0.5, 0.75, 1.0}) row.push_back(kilobytes(bytes_asked_for(t, s, g)));
    table.row(std::move(row));
  }
  return table.text();
}

/// q_i(x, y) and d_i(x, y) of every stored fragment and scale at one Gamma.
std::string gamma_text(const PlaneTables& t, const std::vector<ManifestScale>& scales, double gamma) {
  TextTable table;
  table.column("fragment");
  std::vector<AllocationFigures> rows;
  for (std::size_t s = 0; s < t.scale_count(); ++s) {
    table.column(fmt::format("q_{}", scales[s].scale));
    table.column(fmt::format("d_{} B", scales[s].scale));
    rows.push_back(allocation_figures(t, s, gamma));
  }
  for (const std::uint16_t i : t.order) {
    std::vector<std::string> row{std::to_string(i)};
    for (const AllocationFigures& f : rows) {
      row.push_back(fixed(static_cast<double>(f.fragment_quality[i]), 1));
      row.push_back(std::to_string(f.fragment_bytes[i]));
    }
    table.row(std::move(row));
  }
  return fmt::format(
             "  fragments by falling importance at Gamma {}: quality, 0 = skipped, and bytes at S_i\n",
             shortest(gamma)) +
         table.text();
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

std::string fraction(float value) { return fixed(static_cast<double>(value), 4); }

std::string geometry_text(const QualityTable& q) {
  TextTable table;
  table.column("scale");
  for (const char* what : {"FLIP", "p95", "1-SSIM"})
    for (const std::uint32_t px : q.sizes_px) table.column(fmt::format("{} {} px", what, px));
  for (std::size_t s = 0; s < q.scales.size(); ++s) {
    std::vector<std::string> row{fmt::format("S_{}", q.scales[s])};
    for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim})
      for (const PictureLosses& losses : q.geometry) row.push_back(fraction((losses.*list)[s]));
    table.row(std::move(row));
  }
  return table.text();
}

std::string groups_text(const QualityTable& q) {
  TextTable table;
  table.column("planes", Align::kLeft);
  table.column("px");
  table.column("shown as", Align::kLeft);
  for (const char* header : {"texels' 1-SSIM", "FLIP", "p95", "1-SSIM"}) table.column(header);
  const auto add = [&](const GroupLosses& group, std::uint32_t px, std::vector<std::string> how,
                       const PictureLosses& losses, std::size_t i) {
    std::vector<std::string> row{std::string(enum_name(group.group)), std::to_string(px)};
    row.insert(row.end(), how.begin(), how.end());
    for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim})
      row.push_back(fraction((losses.*list)[i]));
    table.row(std::move(row));
  };
  for (const GroupLosses& group : q.groups)
    for (std::size_t i = 0; i < group.sizes.size(); ++i) {
      const TextureLosses& t = group.sizes[i];
      for (std::size_t k = 0; k < t.texel_dssim.size(); ++k)
        add(group, q.sizes_px[i], {"coded", fraction(t.texel_dssim[k])}, t.coded, k);
      add(group, q.sizes_px[i], {"previews", ""}, t.preview, 0);
      for (std::size_t l = 0; l < t.finer.size(); ++l)
        add(group, q.sizes_px[i], {l == 0 ? "mips" : fmt::format("{} mips finer", l), ""}, t.finer, l);
      for (std::size_t l = 0; l < t.coarser.size(); ++l)
        add(group, q.sizes_px[i], {fmt::format("{} mips coarser", l + 1), ""}, t.coarser, l);
    }
  return q.groups.empty() ? "" : table.text();
}

std::string measured_text(const QualityTable& q) {
  return fmt::format("lit pictures against S_0 with the source's textures ({} views)\n", q.views) +
         geometry_text(q) + groups_text(q) +
         fmt::format("losses add up with exponent {}; mean error of that {} %\n",
                     fixed(static_cast<double>(q.exponent), 2), percent(static_cast<double>(q.error), 1));
}

}  // namespace

std::string fragments_text(PackageReader& p) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const PlaneTables& t = p.tables().planes[k];
    const PlaneThesis* thesis = p.plane_thesis(k);
    const std::vector<float> eta = eta_of(t, 0);
    TextTable table;
    for (const char* header :
         {"rank", "fragment", "column", "row", "covered %", "surface %", "eta", "VQP", "q_0", "d_0 B"})
      table.column(header);
    const AllocationFigures finest = allocation_figures(t, 0);
    for (const int q : info.rung_quality) table.column(fmt::format("q{} B", q));
    const double texels = static_cast<double>(info.fragment_width_px) * info.fragment_height_px;
    for (std::size_t rank = 0; rank < t.order.size(); ++rank) {
      const std::size_t i = t.order[rank];
      std::vector<std::string> row{
          std::to_string(rank),
          std::to_string(i),
          std::to_string(i % t.columns),
          std::to_string(i / t.columns),
          percent(t.covered_texels[i] / texels),
          percent(static_cast<double>(t.surface_fraction[i]), 2),
          fixed(static_cast<double>(eta[i]), 3),
          thesis && i < thesis->vqp.size() ? fixed(static_cast<double>(thesis->vqp[i]), 3) : std::string(),
          fixed(static_cast<double>(finest.fragment_quality[i]), 1),
          std::to_string(finest.fragment_bytes[i])};
      for (std::size_t r = 0; r < t.rung_count(); ++r)
        row.push_back(std::to_string(t.size_bytes[r * t.fragment_count() + i]));
      table.row(std::move(row));
    }
    s += plane_title(info, k);
    s += "grid: " + printable(info.grid_reason) + "\neta of S_0 in tenths, . = not stored\n";
    s += eta_map(t, eta) +
         "fragments by falling importance; q_0, d_0: quality and bytes that the tables ask for at S_0\n" +
         table.text() + "\n";
  }
  return s.empty() ? "no textures\n" : s;
}

std::string ladder_text(PackageReader& p) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    TextTable table;
    for (const char* header :
         {"rung", "quality", "kB", "tables B", "mean MSE", "mean SSIM", "surface SSIM", "bits/texel"})
      table.column(header);
    const PlaneTables& t = p.tables().planes[k];
    double texels = 0;
    for (const std::uint16_t i : t.order) texels += t.covered_texels[i];
    const auto figures = rung_figures(t);
    for (std::size_t r = 0; r < figures.size(); ++r)
      table.row({std::to_string(r), std::to_string(figures[r].quality), kilobytes(figures[r].bytes),
                 std::to_string(figures[r].table_bytes), fixed(figures[r].mse, 2), fixed(figures[r].ssim, 4),
                 fixed(figures[r].surface_ssim, 4),
                 texels > 0 ? fixed(8 * static_cast<double>(figures[r].bytes) / texels, 3) : ""});
    const TextureInfo& info = p.textures()[k];
    s += plane_title(info, k) + table.text();
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

std::string tables_text(PackageReader& p, std::optional<double> gamma) {
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
    s += allocation_text(t, p.manifest().scales, gamma) +
         (gamma ? gamma_text(t, p.manifest().scales, *gamma) : "") + "\n";
  }
  return s + measured_text(p.quality());
}

}  // namespace texmesh
