#include "stages/quality/shots.h"

#include "stages/base/parallel.h"
#include "stages/data/stage.h"

namespace texmesh {
namespace {

bool ended(const Shot& shot, const Losses& so_far) {
  return shot.ends_beyond &&
         !std::ranges::all_of(so_far, [&](const Loss& l) { return shot.ends_beyond->hold(l); });
}

/// Of what views show of the object, on average: more say hardly more.
constexpr double kEnoughPixels = 30000;
/// In units of kBandPx: of 96 rows 76 are compared.
constexpr std::uint32_t kBandTiles = 3, kLeastBands = 2;

std::uint32_t tiles_of(std::uint32_t side_px) { return (side_px + kBandPx - 1) / kBandPx; }

struct TileRange {
  std::uint32_t first = 0, end = 0;
};
TileRange shown_tiles(const ShownRows& view, std::uint32_t side_px) {
  const double side = side_px;
  const auto tile = [&](double row) { return static_cast<std::uint32_t>(row) / kBandPx; };
  return {tile(view.first * side), std::min(tile(view.end * side) + 1, tiles_of(side_px))};
}

/// The share of what a view shows that is compared.
double share_compared(const ShownRows& view, const std::vector<std::uint8_t>& compared) {
  const std::size_t rows = view.pixels.size();
  double sum = 0, all = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    all += view.pixels[i];
    if (compared[(2 * i + 1) * compared.size() / (2 * rows)]) sum += view.pixels[i];
  }
  return all > 0 ? sum / all : 0;
}

/// Of all pixels of all views: where S_0 covers less, the pictures compare next to nothing. A thread across
/// the whole picture, one pixel wide, covers 0.5 %.
constexpr double kLeastCovered = 0.002;

/// The sphere around the place where nearly all positions lie, whatever a few others do.
BoundingSphere crowd_sphere(const Mesh& mesh, const BoundingSphere& bounds) {
  constexpr double kCrowd = 0.98, kMargin = 1.25;
  const std::size_t n = mesh.positions.size();
  BoundingSphere s;
  std::vector<double> values(n);
  const auto at_rank = [&](std::size_t rank) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank), values.end());
    return values[rank];
  };
  for (int k = 0; k < 3; ++k) {
    for (std::size_t p = 0; p < n; ++p) values[p] = static_cast<double>(mesh.positions[p][k]);
    s.centre[k] = at_rank(n / 2);
  }
  for (std::size_t p = 0; p < n; ++p) values[p] = length(to_double(mesh.positions[p]) - s.centre);
  s.radius = kMargin * at_rank(static_cast<std::size_t>(kCrowd * static_cast<double>(n - 1)));
  return s.radius > 0 && s.radius < bounds.radius ? s : bounds;
}

struct Seen {
  std::uint64_t pixels = 0, of = 0;
  std::vector<ShownRows> rows;
  std::vector<std::uint32_t> first_levels;
};

ShownRows shown_rows(const Visibility& view) {
  ShownRows out;
  out.pixels.resize(view.side_px);
  for (std::size_t i = 0; i + 1 < view.first.size(); ++i)
    out.pixels[i / view.side_px] += view.first[i] < view.first[i + 1];
  const auto shows = [](std::uint32_t pixels) { return pixels > 0; };
  const auto first = std::ranges::find_if(out.pixels, shows);
  if (first == out.pixels.end()) return out;
  const auto last = std::find_if(out.pixels.rbegin(), out.pixels.rend(), shows);
  const double side = view.side_px;
  out.first = static_cast<double>(first - out.pixels.begin()) / side;
  out.end = static_cast<double>(out.pixels.rend() - last) / side;
  return out;
}

Seen look_around(const RenderScene& scene, const PictureFrame& frame, const TextureSizes& sizes, int views,
                 double largest_px, const RunContext& context) {
  Seen seen;
  WantedMips levels(sizes.size());
  const double height_px = looked_at_px(scene.triangles->size());
  for (int v = 0; v < views; ++v) {
    context.check_cancelled();
    const PicturePlace place = place_picture(frame, v, views, height_px);
    const Visibility view = look(scene, place.camera, place.side_px, context);
    seen.rows.push_back(shown_rows(view));
    for (const std::uint32_t pixels : seen.rows.back().pixels) seen.pixels += pixels;
    seen.of += static_cast<std::uint64_t>(place.side_px) * place.side_px;
    levels.add(scene, view, sizes, largest_px / height_px);
  }
  seen.first_levels = levels.first_levels();
  return seen;
}

std::string count_outside(const Mesh& mesh, const BoundingSphere& sphere) {
  const auto outside = std::count_if(mesh.positions.begin(), mesh.positions.end(), [&](Vec3f p) {
    return length(to_double(p) - sphere.centre) > sphere.radius;
  });
  return std::to_string(outside) + " of " + std::to_string(mesh.positions.size());
}

}  // namespace

std::size_t shown_scale(const std::vector<RenderScene>& scenes, std::size_t scale, double displayed_px) {
  constexpr std::size_t kLarge = 1'000'000;
  constexpr double kTrianglesPerPixel = 4;
  const double least = kTrianglesPerPixel * displayed_px * displayed_px;
  if (scenes[0].triangles->size() <= kLarge) return scale;
  while (scale + 1 < scenes.size() && static_cast<double>(scenes[scale + 1].triangles->size()) >= least)
    ++scale;
  return scale;
}

std::vector<SizePictures::ScaleShots> SizePictures::by_scale(const std::vector<Shot>& shots,
                                                             const std::vector<std::size_t>& taken) {
  std::vector<ScaleShots> out;
  for (const std::size_t i : taken) {
    auto found = std::ranges::find(out, shots[i].scale, &ScaleShots::scale);
    if (found == out.end()) found = out.insert(out.end(), {shots[i].scale, {}});
    found->shots.push_back(i);
  }
  return out;
}

/// One picture per list of materials.
PictureVariants SizePictures::pictures(std::size_t scale, const PictureView& at,
                                       const std::vector<const ShotMaterials*>& materials,
                                       const RunContext& context) {
  const std::size_t shown = shown_scale(studio_.scenes, scale, displayed_px_);
  RenderScene scene = studio_.scenes[shown];
  scene.materials = materials.front();
  scene.texture_count = studio_.textures.size();
  const auto shaded = [&](const Visibility& seen) {
    return shade_variants(scene, seen, materials, studio_.textures, studio_.environment, context);
  };
  const auto look_here = [&] {
    return look(scene, at.place.camera, at.place.side_px, context, at.bands.rendered);
  };
  if (shown > 0) return shaded(look_here());
  const auto [found, is_new] = finest_.try_emplace(at.view);
  if (is_new) found->second = look_here();
  return shaded(found->second);
}

Loss SizePictures::compare(const Reference& reference, const Picture& test) const {
  const PixelSpans spans = shown_spans(test);
  Loss loss{compare_flip(reference.flip, test, spans), 0};
  if (with_ssim_) {
    const PictureDifference d = compare_luma(reference.luma, prepare_luma(test, spans));
    loss.dssim = static_cast<double>(d.pixels) - d.ssim;
  }
  return loss;
}

/// Writes one loss of each shot that was taken. The reference is rendered together with shots of S_0, which
/// share most of the work.
void SizePictures::compare_view(std::size_t view, const std::vector<Shot>& shots,
                                const std::vector<std::size_t>& taken, std::vector<Losses>& out,
                                const RunContext& context) {
  PictureView at{
      view, place_picture(studio_.frame, static_cast<int>(view), studio_.views.views, displayed_px_), {}};
  at.bands = choose_bands(studio_.rows[view], at.place.side_px,
                          studio_.pixels_of_unit * displayed_px_ * displayed_px_);
  const auto put = [&at](const PictureVariants& shown, std::size_t i, Picture& to) {
    shown.put(i, to);
    at.bands.cut(to);
  };
  const auto compare_group = [&](const ScaleShots& group, const Reference* seen, const RunContext& run) {
    std::vector<const ShotMaterials*> materials;
    if (!seen) materials.push_back(&source_);
    for (const std::size_t i : group.shots) materials.push_back(shots[i].materials);
    if (materials.empty()) return;
    const PictureVariants shown = pictures(group.scale, at, materials, run);
    const std::size_t first = seen ? 0 : 1;
    if (!seen) {
      Picture source;
      put(shown, 0, source);
      seen = &(seen_[view] = {with_ssim_ ? prepare_luma(source) : LumaPicture{}, prepare_flip(source)});
    }
    parallel_for(run, group.shots.size(), 1, [&](std::size_t begin, std::size_t end) {
      Picture picture;
      for (std::size_t i = begin; i < end; ++i) {
        put(shown, first + i, picture);
        out[group.shots[i]][view] = compare(*seen, picture);
      }
    });
  };
  std::vector<ScaleShots> groups = by_scale(shots, taken);
  ScaleShots finest;
  if (const auto found = std::ranges::find(groups, 0u, &ScaleShots::scale); found != groups.end()) {
    finest = std::move(*found);
    groups.erase(found);
  }
  const auto known = seen_.find(view);
  compare_group(finest, known == seen_.end() ? nullptr : &known->second, context);
  const Reference& seen = seen_.at(view);
  RunContext serial = context;
  serial.threads = 1;
  parallel_each(context, groups.size(), 1, [&](std::size_t g) { compare_group(groups[g], &seen, serial); });
}

std::vector<Losses> SizePictures::take(const std::vector<Shot>& shots, const RunContext& context) {
  const auto views = static_cast<std::size_t>(studio_.views.views);
  std::vector<Losses> out(shots.size(), Losses(views));
  for (std::size_t v = 0; v < views; ++v) {
    std::vector<std::size_t> taken;
    for (std::size_t i = 0; i < shots.size(); ++i)
      if (studio_.views.has(v, shots[i].views) && !ended(shots[i], out[i])) taken.push_back(i);
    if (!taken.empty()) compare_view(v, shots, taken, out, context);
    context.report(static_cast<double>(v + 1) / static_cast<double>(views));
  }
  return out;
}

bool ShotLimits::hold(const Loss& loss) const {
  constexpr double kPart = 0.95;
  return loss.flip.mean() <= mean && loss.flip.percentile(kPart) <= p95;
}

void Loss::add(const Loss& other) {
  flip.add(other.flip);
  dssim += other.dssim;
}

double Loss::mean_dssim() const {
  return flip.pixels ? std::clamp(dssim / static_cast<double>(flip.pixels), 0.0, 1.0) : 0;
}

Loss pooled(const Losses& losses) {
  Loss sum;
  for (const Loss& loss : losses) sum.add(loss);
  return sum;
}

Loss pooled(const Losses& losses, const Losses& like) {
  Loss sum;
  for (std::size_t v = 0; v < losses.size(); ++v)
    if (like[v].flip.pixels > 0) sum.add(losses[v]);
  return sum;
}

void Bands::cut(Picture& picture) const {
  for (std::size_t y = 0; y < compared.size(); ++y)
    if (!compared[y]) std::fill_n(picture.covered.data() + y * picture.side_px, picture.side_px, 0);
}

Bands choose_bands(const ShownRows& view, std::uint32_t side_px, double pixels) {
  const TileRange shown = shown_tiles(view, side_px);
  const auto enough = static_cast<std::uint32_t>(std::clamp(pixels / kEnoughPixels, 1.0, 1e6));
  const std::uint32_t period = std::min(enough, (shown.end - shown.first) / (kBandTiles * kLeastBands));
  if (period <= 1) return {};
  const std::uint32_t tiles = tiles_of(side_px), cycle = period * kBandTiles;
  // A band lies in the middle of what is shown.
  const std::uint32_t begin = (shown.first + shown.end - kBandTiles) / 2 % cycle;
  Bands out;
  for (std::uint32_t t = 0; t < tiles; ++t) out.rendered.push_back((t + cycle - begin) % cycle < kBandTiles);
  constexpr std::uint32_t kReach = kFilterReach;
  for (std::uint32_t y = 0; y < side_px; ++y) {
    const std::uint32_t first = y - std::min(y, kReach), last = std::min(y + kReach, side_px - 1);
    out.compared.push_back(out.rendered[first / kBandPx] && out.rendered[last / kBandPx]);
  }
  if (share_compared(view, out.compared) < 0.4 / period) return {};  // of 76 rows in 96
  return out;
}

ViewChoice choose_views(int views, int large_views) {
  ViewChoice out{views, std::vector<ViewPart>(static_cast<std::size_t>(views), ViewPart::kAll)};
  const int wanted = std::min(views, large_views);
  for (int i = 0; i < wanted; ++i)
    out.part[static_cast<std::size_t>((2 * i + 1) * views / (2 * wanted))] =
        i % 2 == 0 ? ViewPart::kLargest : ViewPart::kLarge;
  return out;
}

PicturePlace place_picture(const PictureFrame& frame, int view, int views, double displayed_px) {
  constexpr double kLargestSide = 8192;
  PicturePlace out{perspective_camera(camera_of(view, views, frame.sphere.centre, frame.sphere.radius)), 0};
  const double distance = length(out.camera.eye - frame.sphere.centre);
  const double side = displayed_px * 2 * distance * out.camera.tan_half_fov / frame.extent;
  out.side_px = static_cast<std::uint32_t>(std::clamp(std::ceil(side), 1.0, kLargestSide));
  // A little more is seen than the frame, so that the height is exact.
  out.camera.tan_half_fov *= out.side_px / std::clamp(side, 0.5, kLargestSide);
  return out;
}

double looked_at_px(std::size_t triangles) {
  constexpr std::size_t kFewTriangles = 5000;
  return triangles <= kFewTriangles ? 96 : 192;
}

Coverage frame_object(const RenderScene& scene, const TextureSizes& sizes, double extent, int views,
                      double largest_px, Notes& notes, const RunContext& context) {
  Coverage out{{sphere_around(*scene.mesh, "quality"), extent}, 0, {}, {}};
  // A sphere around a box is at most so much wider than its longest side: O_V of other positions than these
  // would ask for huge pictures.
  out.frame.extent = std::max(extent, 1.15 * out.frame.sphere.radius);
  Seen seen = look_around(scene, out.frame, sizes, views, largest_px, context);
  if (static_cast<double>(seen.pixels) < kLeastCovered * static_cast<double>(seen.of)) {
    const BoundingSphere crowd = crowd_sphere(*scene.mesh, out.frame.sphere);
    const PictureFrame closer{crowd, 2 * crowd.radius};
    if (crowd.radius < out.frame.sphere.radius) {
      Seen more = look_around(scene, closer, sizes, views, largest_px, context);
      if (more.pixels > seen.pixels) {
        out.frame = closer;
        add_warning(notes, "far-outliers", "",
                    "quality was measured without the " + count_outside(*scene.mesh, crowd) +
                        " positions that lie so far from all others that pictures of the whole object show "
                        "next to nothing");
        seen = std::move(more);
      }
    }
  }
  out.pixels = seen.pixels;
  out.rows = std::move(seen.rows);
  out.first_levels = std::move(seen.first_levels);
  return out;
}

}  // namespace texmesh
