#pragma once
#include "format/base/vec.h"

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

}  // namespace texmesh
