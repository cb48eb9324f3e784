#include <cstdlib>

#include "format/base/bytes.h"
#include "format/split/split_codec.h"
#include "format/split/split_head.h"

namespace texmesh {
namespace {

bool has_grid(SplitKind kind) { return kind == SplitKind::kUv0 || kind == SplitKind::kUv1; }

void write_varint(BytesOut& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out.u8((value & 0x7f) | 0x80);
  out.u8(value);
}

std::uint32_t read_varint(BytesIn& in) {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    const std::uint64_t byte = in.u8();
    value |= (byte & 0x7f) << shift;
    if (byte < 0x80) {
      if (value > 0xffffffffu || (byte == 0 && shift > 0)) break;
      return static_cast<std::uint32_t>(value);
    }
  }
  fail_by("S06", in, "a number of at most 32 bits in its shortest form", "another");
}

std::uint32_t read_sum(BytesIn& in, std::uint32_t before) {
  const std::uint32_t more = read_varint(in);
  if (more > 0xffffffffu - before) fail_by("S05", in, "a count of at most 32 bits", "a larger one");
  return before + more;
}

void write_grid(BytesOut& out, const SplitGrid& grid, std::size_t axes) {
  for (std::size_t k = 0; k < axes; ++k) out.f32(grid.origin[k]);
  out.f32(grid.range);
}

void read_grid(BytesIn& in, SplitGrid& grid, std::size_t axes) {
  for (std::size_t k = 0; k < axes; ++k) {
    grid.origin[k] = in.f32();
    if (!std::isfinite(grid.origin[k])) fail_by("S04", in, "a finite origin", "another");
  }
  grid.range = in.f32();
  if (!std::isfinite(grid.range) || !(grid.range > 0))
    fail_by("S04", in, "a finite range above 0", "another");
}

int read_bits(BytesIn& in, int least) {
  const int bits = in.u8();
  if (bits < least || bits > 24)
    fail_by("S03", in, std::to_string(least) + " to 24 bits", std::to_string(bits));
  return bits;
}

void read_attributes(BytesIn& in, std::size_t count, SplitStreamHead& head) {
  for (std::size_t i = 0; i < count; ++i) {
    SplitAttribute a;
    const int kind = in.u8();
    if (kind > static_cast<int>(SplitKind::kColour))
      fail_by("S03", in, "an attribute kind", std::to_string(kind));
    a.kind = static_cast<SplitKind>(kind);
    if (i > 0 && a.kind <= head.attributes.back().kind)
      fail_by("S03", in, "rising kinds", std::to_string(kind));
    a.grid.bits = read_bits(in, a.kind == SplitKind::kNormal ? 2 : 1);
    if (in.u16() != 0) fail_by("S02", in, "0", "another number");
    if (has_grid(a.kind)) read_grid(in, a.grid, 2);
    head.attributes.push_back(a);
  }
}

void read_scales(BytesIn& in, std::size_t count, std::size_t blocks, SplitStreamHead& head) {
  if (count == 0 || count > kMostScales) fail_by("S05", in, "1 to 100 scales", std::to_string(count));
  for (std::size_t i = 0; i < count; ++i) {
    const SplitScale before = i > 0 ? head.scales.back() : SplitScale{100, 0, 0, 0, 0, 0};
    SplitScale s = before;
    s.scale = in.u8();
    for (std::uint32_t* n : {&s.blocks, &s.points, &s.wedges, &s.faces}) *n = read_sum(in, *n);
    const std::uint32_t hidden = read_varint(in);
    if (s.scale >= before.scale) fail_by("S05", in, "falling scale numbers", std::to_string(s.scale));
    if (s.blocks <= before.blocks || s.blocks > blocks)
      fail_by("S05", in, "a rising number of blocks, at most " + std::to_string(blocks),
              std::to_string(s.blocks));
    if (hidden > s.faces || s.wedges < s.points || s.faces == 0)
      fail_by("S05", in, "counts that can belong together", "others");
    s.triangles = s.faces - hidden;
    head.scales.push_back(s);
  }
  if (head.scales.back().scale != 0 || head.scales.back().blocks != blocks)
    fail_by("S05", in, "S_0 with all blocks", "scale " + std::to_string(head.scales.back().scale));
}

void read_blocks(BytesIn& in, std::size_t count, SplitStreamHead& head) {
  const std::size_t parts = head.attributes.size() + 2;
  if (count > in.left() / (parts + 9))
    fail_by("S08", in, "blocks with an entry in the table", std::to_string(count));
  head.blocks.resize(count);
  for (SplitBlock& b : head.blocks) {
    const std::uint32_t code = read_varint(in);
    b.is_patch = (code & 1) != 0;
    b.count = code >> 1;
    if (b.count == 0 || (!b.is_patch && b.count > kMostSplits))
      fail_by("S07", in, "at least one face or split, at most 4096 splits", std::to_string(b.count));
    b.parts.resize(parts);
    for (std::uint32_t& p : b.parts) p = read_varint(in);
    if (b.bytes() < b.count / kMostPerByte)
      fail_by("S07", in, "at least a byte for every 64", std::to_string(b.bytes()) + " bytes");
    std::ranges::copy(in.raw(8), b.digest.begin());
  }
}

}  // namespace

std::uint64_t SplitBlock::bytes() const {
  std::uint64_t sum = 0;
  for (std::uint32_t p : parts) sum += p;
  return sum;
}

std::vector<std::uint8_t> write_split_head(const SplitStreamHead& head) {
  BytesOut out;
  out.text("TXMS");
  out.u16(kSplitStreamMajor);
  out.u16(kSplitStreamMinor);
  out.u8(static_cast<std::uint64_t>(head.position.bits));
  out.u8(head.attributes.size());
  out.u8(head.scales.size());
  out.u8(0);
  out.u32(head.groups.size());
  out.u32(head.blocks.size());
  write_grid(out, head.position, 3);
  for (const SplitAttribute& a : head.attributes) {
    out.u8(static_cast<std::uint64_t>(a.kind));
    out.u8(static_cast<std::uint64_t>(a.grid.bits));
    out.u16(0);
    if (has_grid(a.kind)) write_grid(out, a.grid, 2);
  }
  for (const SplitGroup& g : head.groups) out.u16(g.material), out.u16(g.part);
  SplitScale before;
  for (const SplitScale& s : head.scales) {
    out.u8(static_cast<std::uint64_t>(s.scale));
    write_varint(out, s.blocks - before.blocks);
    write_varint(out, s.points - before.points);
    write_varint(out, s.wedges - before.wedges);
    write_varint(out, s.faces - before.faces);
    write_varint(out, s.faces - s.triangles);
    before = s;
  }
  for (const auto& m : head.models) out.raw(m);
  for (const SplitBlock& b : head.blocks) {
    write_varint(out, std::uint64_t{b.count} << 1 | (b.is_patch ? 1 : 0));
    for (std::uint32_t p : b.parts) write_varint(out, p);
    out.raw(b.digest);
  }
  return out.finish();
}

static SplitStreamHead read_head(ByteSpan bytes) {
  BytesIn in(bytes, kSplitStreamName);
  under_rule("S01", [&] { in.expect("TXMS", "TXMS"); });
  if (const auto major = in.u16(); major != kSplitStreamMajor)
    fail_by("S01", in, "major version " + std::to_string(kSplitStreamMajor), std::to_string(major));
  in.u16();  // the minor version
  SplitStreamHead head;
  head.position.bits = read_bits(in, 1);
  const std::size_t attributes = in.u8(), scales = in.u8();
  if (in.u8() != 0) fail_by("S02", in, "0", "another number");
  const std::size_t groups = in.u32(), blocks = in.u32();
  read_grid(in, head.position, 3);
  read_attributes(in, attributes, head);
  if (groups == 0 || groups > 65536 || groups > in.left() / 4)
    fail_by("S05", in, "1 to 65536 groups", std::to_string(groups));
  for (std::size_t i = 0; i < groups; ++i) {
    const std::uint16_t material = in.u16();
    head.groups.push_back({material, in.u16()});
  }
  read_scales(in, scales, blocks, head);
  for (std::size_t i = 0; i <= attributes; ++i) {
    const auto raw = in.raw(ValueModels::kCount);
    head.models.emplace_back(raw.begin(), raw.end());
  }
  read_blocks(in, blocks, head);
  head.bytes = in.at();
  std::uint64_t at = head.bytes;
  for (SplitBlock& b : head.blocks) {
    b.offset = at;
    at += b.bytes();
  }
  return head;
}

SplitStreamHead read_split_head(std::span<const std::uint8_t> bytes) {
  return under_rule("S08", [&] { return read_head(bytes); });
}

std::uint64_t split_prefix_bytes(const SplitStreamHead& head, int scale) {
  const auto found = std::ranges::find(head.scales, scale, &SplitScale::scale);
  if (found == head.scales.end())
    throw RuleError("S21", kSplitStreamName, "scales", "scale " + std::to_string(scale), "none");
  const SplitBlock& last = head.blocks.at(found->blocks - 1);
  return last.offset + last.bytes();
}

std::array<float, 3> octahedral_normal(std::int32_t u, std::int32_t v, int bits) {
  const OctahedralVector o = octahedral_vector(u, v, bits);
  const float x = static_cast<float>(o[0]), y = static_cast<float>(o[1]), z = static_cast<float>(o[2]);
  const float length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0)) return {0, 0, 1};
  return {x / length, y / length, z / length};
}

std::array<std::int32_t, 2> octahedral_code(std::array<float, 3> normal, int bits) {
  const double centre = (1 << (bits - 1)) - 1;
  const double sum = std::fabs(static_cast<double>(normal[0])) + std::fabs(static_cast<double>(normal[1])) +
                     std::fabs(static_cast<double>(normal[2]));
  if (!(sum > 0)) return {static_cast<std::int32_t>(centre), static_cast<std::int32_t>(centre)};
  double x = normal[0] / sum, y = normal[1] / sum;
  if (normal[2] < 0) {
    const double fx = (1 - std::fabs(y)) * (x < 0 ? -1 : 1), fy = (1 - std::fabs(x)) * (y < 0 ? -1 : 1);
    x = fx, y = fy;
  }
  const auto u0 = static_cast<std::int32_t>(std::floor((x + 1) * centre));
  const auto v0 = static_cast<std::int32_t>(std::floor((y + 1) * centre));
  std::array<std::int32_t, 2> best{u0, v0};
  double nearest = -2;
  for (std::int32_t u : {u0, u0 + 1})
    for (std::int32_t v : {v0, v0 + 1}) {
      if (u > 2 * centre || v > 2 * centre) continue;
      const auto n = octahedral_normal(u, v, bits);
      const double cosine = static_cast<double>(n[0]) * normal[0] + static_cast<double>(n[1]) * normal[1] +
                            static_cast<double>(n[2]) * normal[2];
      if (cosine > nearest) nearest = cosine, best = {u, v};
    }
  return best;
}

OctahedralVector octahedral_vector(std::int32_t u, std::int32_t v, int bits) {
  const std::int32_t centre = (1 << (bits - 1)) - 1, x = u - centre, y = v - centre;
  const std::int32_t z = centre - std::abs(x) - std::abs(y);
  if (z >= 0) return {x, y, z};
  return {(centre - std::abs(y)) * (x < 0 ? -1 : 1), (centre - std::abs(x)) * (y < 0 ? -1 : 1), z};
}

std::array<std::int32_t, 2> octahedral_place(std::array<std::int64_t, 3> sum, int bits) {
  const std::int64_t centre = (1 << (bits - 1)) - 1;
  const std::int64_t total = std::abs(sum[0]) + std::abs(sum[1]) + std::abs(sum[2]);
  if (total == 0) return {static_cast<std::int32_t>(centre), static_cast<std::int32_t>(centre)};
  // Truncated towards zero, so that both signs of a coordinate are treated alike.
  std::int64_t x = sum[0] * centre / total, y = sum[1] * centre / total;
  if (sum[2] < 0) {
    const std::int64_t fx = (centre - std::abs(y)) * (x < 0 ? -1 : 1),
                       fy = (centre - std::abs(x)) * (y < 0 ? -1 : 1);
    x = fx, y = fy;
  }
  return {static_cast<std::int32_t>(x + centre), static_cast<std::int32_t>(y + centre)};
}

}  // namespace texmesh
