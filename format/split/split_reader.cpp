#include "format/split/split_reader.h"

#include "format/base/bytes.h"
#include "format/base/numbering.h"
#include "format/base/sha256.h"
#include "format/split/split_codec.h"
#include "format/split/split_head.h"

namespace texmesh {

// The reader of mesh/stream.bin: what a block says becomes part of a SplitMesh, points that were lost are
// placed among their neighbours, and split_model() makes a Mesh of the whole.

namespace {

/// A neighbour in the chart of the point: texture coordinates relative to the point's, and its place.
struct Neighbour {
  std::uint32_t point;
  double u, v;
};

/// The point's neighbours over the corners that have this wedge, each once.
std::vector<Neighbour> neighbours_in_chart(const SplitMesh& mesh, std::size_t k, std::uint32_t point,
                                           std::uint32_t wedge) {
  const std::vector<std::int32_t>& uv = mesh.values(k);
  std::vector<Neighbour> out;
  mesh.each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
    if (mesh.wedge_at(face, corner) != wedge) return;
    for (std::uint32_t i = 1; i <= 2; ++i) {
      const std::uint32_t w = mesh.wedge_at(face, corner + i), p = mesh.point_at(face, corner + i);
      if (std::ranges::find(out, p, &Neighbour::point) != out.end()) continue;
      out.push_back({p, static_cast<double>(uv[2 * w]) - uv[2 * wedge],
                     static_cast<double>(uv[2 * w + 1]) - uv[2 * wedge + 1]});
    }
  });
  return out;
}

/// The wedge that most corners of the point have (ties: the first met).
std::uint32_t main_wedge(const SplitMesh& mesh, std::uint32_t point) {
  std::vector<std::pair<std::uint32_t, int>> counts;
  mesh.each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
    const std::uint32_t w = mesh.wedge_at(face, corner);
    const auto it = std::ranges::find(counts, w, [](const auto& c) { return c.first; });
    if (it == counts.end())
      counts.emplace_back(w, 1);
    else
      ++it->second;
  });
  if (counts.empty()) return kNoIndex;
  return std::ranges::max_element(counts, {}, [](const auto& c) { return c.second; })->first;
}

/// Puts a point where its texture coordinates lie among those of its neighbours (SplitFill::kTexture); leaves
/// it where it is when they say nothing.
void fill_lost_point(const SplitStreamHead& head, SplitMesh& mesh, std::uint32_t point) {
  std::size_t k = 0;
  while (k < head.attributes.size() && head.attributes[k].kind != SplitKind::kUv0) ++k;
  const std::uint32_t wedge = main_wedge(mesh, point);
  if (k == head.attributes.size() || wedge == kNoIndex) return;
  const std::vector<Neighbour> ring = neighbours_in_chart(mesh, k, point, wedge);
  if (ring.size() < 3) return;
  // Least squares of place = c + a u + b v with weights 1 / distance^2: c is the place at the point. The
  // normal equations are solved for c alone, by Cramer's rule.
  double w0 = 0, wu = 0, wv = 0, wuu = 0, wuv = 0, wvv = 0;
  std::array<double, 3> p0{}, pu{}, pv{};
  for (const Neighbour& n : ring) {
    const double w = 1 / (n.u * n.u + n.v * n.v + 1);
    w0 += w, wu += w * n.u, wv += w * n.v;
    wuu += w * n.u * n.u, wuv += w * n.u * n.v, wvv += w * n.v * n.v;
    for (std::size_t i = 0; i < 3; ++i) {
      const double x = mesh.points()[n.point][i];
      p0[i] += w * x, pu[i] += w * n.u * x, pv[i] += w * n.v * x;
    }
  }
  const double a = wuu * wvv - wuv * wuv, b = wuv * wv - wu * wvv, c = wu * wuv - wuu * wv;
  const double determinant = w0 * a + wu * b + wv * c;
  // Coordinates that lie on a line, or on one side of the point only, would be extrapolated.
  if (!(determinant > 1e-3 * w0 * wuu * wvv)) return;
  const std::int32_t largest = (1 << head.position.bits) - 1;
  SplitMesh::Point place{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double x = (p0[i] * a + pu[i] * b + pv[i] * c) / determinant;
    double low = 1e300, high = -1e300;
    for (const Neighbour& n : ring) {
      low = std::min<double>(low, mesh.points()[n.point][i]);
      high = std::max<double>(high, mesh.points()[n.point][i]);
    }
    place[i] = std::clamp(static_cast<std::int32_t>(std::floor(std::clamp(x, low, high) + 0.5)), 0, largest);
  }
  mesh.point(point) = place;
}

/// Numbers things in the order of their first use.
class Numbering {
 public:
  explicit Numbering(std::size_t count) : number_(count, kNoIndex) {}
  std::uint32_t of(std::uint32_t old) { return numbered(number_[old], used_, old); }
  const std::vector<std::uint32_t>& used() const { return used_; }

 private:
  std::vector<std::uint32_t> number_, used_;
};

void add_attribute(const SplitAttribute& a, const std::vector<std::int32_t>& values,
                   const std::vector<std::uint32_t>& wedges, Mesh& out) {
  const auto components = static_cast<std::size_t>(split_components(a.kind));
  const float one = static_cast<float>((std::uint32_t{1} << a.grid.bits) - 1);
  for (const std::uint32_t w : wedges) {
    const std::int32_t* v = values.data() + w * components;
    if (a.kind == SplitKind::kNormal) {
      const auto n = octahedral_normal(v[0], v[1], a.grid.bits);
      out.normals.push_back({n[0], n[1], n[2]});
    } else if (a.kind == SplitKind::kColour) {
      const auto part = [&](std::size_t k) { return static_cast<float>(v[k]) / one; };
      out.colours.push_back({part(0), part(1), part(2), part(3)});
    } else {
      (a.kind == SplitKind::kUv1 ? out.uv1 : out.uv0)
          .push_back({a.grid.value(v[0], 0), a.grid.value(v[1], 1)});
    }
  }
}

/// Decodes the values of one part. Where the part was left out every residual is 0.
class PartDecoder {
 public:
  void start(ByteSpan bytes, const std::vector<std::uint8_t>& models) {
    present_ = !bytes.empty();
    if (!present_) return;
    for (std::size_t i = 0; i < models.size(); ++i)
      residuals_.models.all[i] = {static_cast<std::uint16_t>(models[i] << 8), ValueModels::kPrior};
    residuals_.start(bytes[0] * 2);
    bits_ = BitDecoder(bytes.subspan(1));
  }
  void values(std::int32_t* out, const std::int32_t* guess, int components, int bits) {
    const std::int32_t largest = (1 << bits) - 1;
    for (int i = 0; i < components; ++i) {
      const std::int32_t residual = present_ ? residuals_.residual(*this, i, 0) : 0;
      out[i] = (std::clamp(guess[i], 0, largest) + residual) & largest;
    }
  }
  bool present() const { return present_; }
  bool same() { return present_ && residuals_.same(*this, false); }

  // What ResidualCodec asks of its bits:
  bool bit(BitModel& model, bool) { return bits_.decode(model, ValueModels::kValueLimit); }
  std::uint32_t raw(std::uint32_t, int count) { return bits_.decode_raw(count); }

 private:
  bool present_ = false;
  BitDecoder bits_;
  ResidualCodec residuals_;
};

/// The reader's side of SplitCodec. Blocks of patches have no splits: what their points lack stays predicted.
class DecodingChannel {
 public:
  DecodingChannel(const SplitStreamHead& head, SplitFill fill)
      : head_(head), fill_(fill), parts_(head.attributes.size() + 1) {}
  void start(std::span<const ByteSpan> parts) {
    connectivity_ = BitDecoder(parts[0]);
    for (std::size_t i = 0; i < parts_.size(); ++i) parts_[i].start(parts[i + 1], head_.models[i]);
  }
  bool bit(BitModel& model, auto&&) { return connectivity_.decode(model, SplitModels::kModelLimit); }
  std::uint32_t raw(int count, auto&&) { return connectivity_.decode_raw(count); }
  void update_truth(auto&&) {}
  void point(SplitMesh::Point& point, const SplitMesh::Point& guess, auto&&) {
    parts_[0].values(point.data(), guess.data(), 3, head_.position.bits);
  }
  void finish_point(SplitMesh& mesh, std::uint32_t point) {
    if (parts_[0].present()) return;
    lost_.push_back(point);
    if (fill_ == SplitFill::kTexture) fill_lost_point(head_, mesh, point);
  }
  const std::vector<std::uint32_t>& lost() const { return lost_; }
  bool same(std::size_t k, auto&&) { return parts_[k + 1].same(); }
  void value(std::size_t k, std::int32_t* value, const std::array<std::int32_t, 4>& guess, auto&&) {
    const SplitAttribute& a = head_.attributes[k];
    parts_[k + 1].values(value, guess.data(), split_components(a.kind), a.grid.bits);
  }
  std::array<std::int32_t, 4> mean(std::size_t k, SplitMesh& mesh, const std::vector<std::uint32_t>& wedges) {
    return split_mean(head_.attributes[k], k, mesh, wedges);
  }

 private:
  const SplitStreamHead& head_;
  SplitFill fill_;
  std::vector<std::uint32_t> lost_;
  BitDecoder connectivity_;
  std::vector<PartDecoder> parts_;
};

std::vector<int> components_of(const SplitStreamHead& head) {
  std::vector<int> components;
  for (const SplitAttribute& a : head.attributes) components.push_back(split_components(a.kind));
  return components;
}

/// A mesh never grows beyond what the head announces, and that not beyond the reader's limits.
SplitLimits checked_limits(const SplitStreamHead& head, const SplitLimits& limits) {
  const SplitScale& last = head.scales.at(head.scales.size() - 1);
  if (last.points > limits.points)
    fail_split_stream("L09", "points", "at most " + std::to_string(limits.points),
                      std::to_string(last.points));
  if (last.faces > limits.faces)
    fail_split_stream("L09", "faces", "at most " + std::to_string(limits.faces), std::to_string(last.faces));
  if (last.wedges > limits.wedges)
    fail_split_stream("L09", "wedges", "at most " + std::to_string(limits.wedges),
                      std::to_string(last.wedges));
  return {last.points, last.faces, last.wedges};
}

}  // namespace

Mesh split_model(const SplitStreamHead& head, const SplitMesh& mesh) {
  Mesh out;
  Numbering points(mesh.points().size()), wedges(mesh.wedge_point().size());
  std::uint16_t parts = 0;
  for (const std::uint32_t f : mesh.visible_faces()) {
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = wedges.of(mesh.wedge_at(f, static_cast<std::uint32_t>(k)));
    const SplitGroup group = head.groups[mesh.face_group()[f]];
    out.triangles.push_back(t);
    out.triangle_material.push_back(group.material);
    out.triangle_part.push_back(group.part);
    parts = std::max(parts, group.part);
  }
  for (const std::uint32_t w : wedges.used()) out.wedge_position.push_back(points.of(mesh.wedge_point()[w]));
  for (const std::uint32_t p : points.used()) {
    const SplitMesh::Point& place = mesh.points()[p];
    out.positions.push_back({head.position.value(place[0], 0), head.position.value(place[1], 1),
                             head.position.value(place[2], 2)});
  }
  for (std::size_t k = 0; k < head.attributes.size(); ++k)
    add_attribute(head.attributes[k], mesh.values(k), wedges.used(), out);
  out.part_names.resize(parts + std::size_t{1});
  return out;
}

std::array<std::int32_t, 4> split_mean(const SplitAttribute& attribute, std::size_t k, SplitMesh& mesh,
                                       const std::vector<std::uint32_t>& wedges) {
  std::array<std::int64_t, 4> sum{};
  const int components = split_components(attribute.kind);
  if (attribute.kind == SplitKind::kNormal) {
    std::array<std::int64_t, 3> direction{};
    for (std::uint32_t w : wedges) {
      const std::int32_t* v = mesh.value(k, w);
      const OctahedralVector o = octahedral_vector(v[0], v[1], attribute.grid.bits);
      for (std::size_t i = 0; i < 3; ++i) direction[i] += o[i];
    }
    const auto place = octahedral_place(direction, attribute.grid.bits);
    return {place[0], place[1], 0, 0};
  }
  for (std::uint32_t w : wedges)
    for (int i = 0; i < components; ++i) sum[static_cast<std::size_t>(i)] += mesh.value(k, w)[i];
  const auto count = static_cast<std::int64_t>(wedges.size());
  std::array<std::int32_t, 4> mean{};
  for (std::size_t i = 0; i < 4; ++i) mean[i] = static_cast<std::int32_t>((2 * sum[i] + count) / (2 * count));
  return mean;
}

struct SplitStreamReader::State {
  State(SplitStreamHead h, SplitLimits limits, SplitFill fill)
      : head(std::move(h)),
        mesh(components_of(head)),
        channel(head, fill),
        codec(mesh, channel, head.groups.size(), checked_limits(head, limits)) {}
  SplitStreamHead head;
  SplitMesh mesh;
  DecodingChannel channel;
  SplitCodec<DecodingChannel> codec;
  std::size_t block = 0, scale = 0;
  bool complete = true;  // no part of positions was left out
};

SplitStreamReader::SplitStreamReader(SplitStreamHead head, SplitLimits limits, SplitFill fill)
    : state_(std::make_unique<State>(std::move(head), limits, fill)) {}
SplitStreamReader::~SplitStreamReader() = default;
SplitStreamReader::SplitStreamReader(SplitStreamReader&&) noexcept = default;
SplitStreamReader& SplitStreamReader::operator=(SplitStreamReader&&) noexcept = default;

const SplitStreamHead& SplitStreamReader::head() const { return state_->head; }
const SplitMesh& SplitStreamReader::mesh() const { return state_->mesh; }

void SplitStreamReader::add_block(ByteSpan block) {
  State& s = *state_;
  const std::string place = "block " + std::to_string(s.block);
  if (s.block >= s.head.blocks.size()) fail_split_stream("S08", place, "no more blocks", "one");
  const SplitBlock& b = s.head.blocks[s.block];
  if (block.size() != b.bytes())
    fail_split_stream("S08", place, std::to_string(b.bytes()) + " bytes", std::to_string(block.size()));
  const Sha256 digest = sha256(block);
  if (!std::equal(b.digest.begin(), b.digest.end(), digest.begin()))
    fail_split_stream("S09", place, "bytes of the digest in the head", "others");
  std::vector<ByteSpan> parts;
  std::size_t at = 0;
  for (std::uint32_t size : b.parts) {
    parts.push_back(block.subspan(at, size));
    at += size;
  }
  add_parts(parts);
}

void SplitStreamReader::add_parts(std::span<const ByteSpan> parts) {
  State& s = *state_;
  const std::string place = "block " + std::to_string(s.block);
  if (s.block >= s.head.blocks.size()) fail_split_stream("S08", place, "no more blocks", "one");
  const SplitBlock& b = s.head.blocks[s.block];
  if (parts.size() != b.parts.size())
    fail_split_stream("S08", place, std::to_string(b.parts.size()) + " parts", std::to_string(parts.size()));
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (parts[i].size() != b.parts[i] && (i == 0 || !parts[i].empty()))
      fail_split_stream("S08", place, std::to_string(b.parts[i]) + " bytes", std::to_string(parts[i].size()));
  if (parts[1].size() != b.parts[1]) s.complete = false;
  if (s.block == 0 || s.block == s.head.scales[s.scale].blocks) {
    if (s.block > 0) ++s.scale;
    s.codec.begin_chapter();
  }
  s.channel.start(parts);
  if (b.is_patch)
    s.codec.code_patch(b.count);
  else
    s.codec.code_splits(b.count);
  ++s.block;
  const SplitScale& scale = s.head.scales[s.scale];
  if (s.block != scale.blocks) return;
  const auto require = [&](const char* what, std::size_t expected, std::size_t found) {
    if (expected != found)
      fail_split_stream("S19", "scale " + std::to_string(scale.scale), std::to_string(expected) + " " + what,
                        std::to_string(found));
  };
  require("points", scale.points, s.mesh.points().size());
  require("wedges", scale.wedges, s.mesh.wedge_point().size());
  require("faces", scale.faces, s.mesh.face_count());
  if (s.complete) require("triangles", scale.triangles, s.mesh.visible_faces().size());
}

const std::vector<std::uint32_t>& SplitStreamReader::lost_points() const { return state_->channel.lost(); }

void SplitStreamReader::refill_lost_points() {
  for (const std::uint32_t point : state_->channel.lost()) fill_lost_point(state_->head, state_->mesh, point);
}

void SplitStreamReader::read_to_scale(std::size_t index, ByteSpan stream) {
  const std::size_t end = state_->head.scales.at(index).blocks;
  while (state_->block < end) {
    const SplitBlock& b = state_->head.blocks[state_->block];
    if (b.offset > stream.size() || b.bytes() > stream.size() - b.offset)
      fail_split_stream("S08", "block " + std::to_string(state_->block),
                        "bytes up to " + std::to_string(b.offset + b.bytes()), std::to_string(stream.size()));
    add_block(stream.subspan(static_cast<std::size_t>(b.offset), static_cast<std::size_t>(b.bytes())));
  }
}

}  // namespace texmesh
