#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "format/vec.h"

namespace texmesh {

/// Sum of weighted squared distances to planes (Garland and Heckbert): p' A p + 2 b' p + c.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, bx = 0, by = 0, bz = 0, c = 0;
  double weight = 0;  // sum of the planes' weights

  /// The plane n . p + d = 0 with unit normal n.
  void add_plane(Vec3d n, double d, double w) {
    xx += w * n.x * n.x, xy += w * n.x * n.y, xz += w * n.x * n.z;
    yy += w * n.y * n.y, yz += w * n.y * n.z, zz += w * n.z * n.z;
    bx += w * d * n.x, by += w * d * n.y, bz += w * d * n.z;
    c += w * d * d;
    weight += w;
  }
  void add(const Quadric& o) {
    xx += o.xx, xy += o.xy, xz += o.xz, yy += o.yy, yz += o.yz, zz += o.zz;
    bx += o.bx, by += o.by, bz += o.bz, c += o.c, weight += o.weight;
  }
  /// Never negative: rounding below zero is cut off.
  double at(Vec3d p) const {
    const double r = p.x * (xx * p.x + 2 * (xy * p.y + xz * p.z + bx)) +
                     p.y * (yy * p.y + 2 * (yz * p.z + by)) + p.z * (zz * p.z + 2 * bz) + c;
    return r > 0 ? r : 0;
  }
};

/// Per wedge, how far K attributes (texture coordinates, colours) at a point are from the linear functions
/// that the wedge's triangles carry (Hoppe 1999): sum over triangles t and channels k of area_t (g_tk . p +
/// d_tk - s_k)^2.
class AttributeQuadrics {
 public:
  explicit AttributeQuadrics(std::size_t channels = 0) : channels_(channels), stride_(11 + 4 * channels) {}
  std::size_t channels() const { return channels_; }
  void resize(std::size_t wedges) { data_.resize(wedges * stride_); }
  /// Adds one channel of a triangle to a wedge; the area is added once per triangle with add_area.
  void add_channel(std::size_t wedge, std::size_t k, Vec3d g, double d, double area) {
    double* q = &data_[wedge * stride_];
    q[0] += area * g.x * g.x, q[1] += area * g.x * g.y, q[2] += area * g.x * g.z;
    q[3] += area * g.y * g.y, q[4] += area * g.y * g.z, q[5] += area * g.z * g.z;
    q[6] += area * d * g.x, q[7] += area * d * g.y, q[8] += area * d * g.z, q[9] += area * d * d;
    double* c = q + 11 + 4 * k;
    c[0] += area * g.x, c[1] += area * g.y, c[2] += area * g.z, c[3] += area * d;
  }
  void add_area(std::size_t wedge, double area) { data_[wedge * stride_ + 10] += area; }
  void add(std::size_t to, std::size_t from) {
    double* a = &data_[to * stride_];
    const double* b = &data_[from * stride_];
    for (std::size_t i = 0; i < stride_; ++i) a[i] += b[i];
  }
  /// A new wedge with the quadric of `from`; returns nothing, its index is the count before.
  void push_copy(std::size_t from) {
    const std::size_t at = data_.size();
    data_.resize(at + stride_);
    for (std::size_t i = 0; i < stride_; ++i) data_[at + i] = data_[from * stride_ + i];
  }
  double at(std::size_t wedge, Vec3d p, const double* s) const {
    const double* q = &data_[wedge * stride_];
    double r = p.x * (q[0] * p.x + 2 * (q[1] * p.y + q[2] * p.z + q[6])) +
               p.y * (q[3] * p.y + 2 * (q[4] * p.z + q[7])) + p.z * (q[5] * p.z + 2 * q[8]) + q[9];
    for (std::size_t k = 0; k < channels_; ++k) {
      const double* c = q + 11 + 4 * k;
      r += s[k] * (q[10] * s[k] - 2 * (c[0] * p.x + c[1] * p.y + c[2] * p.z + c[3]));
    }
    return r > 0 ? r : 0;
  }

 private:
  std::size_t channels_, stride_;
  std::vector<double> data_;  // per wedge: 6 of G, 3 of b, c, area, then (g, d) per channel
};

}  // namespace texmesh
