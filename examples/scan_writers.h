#pragma once
#include <string>

#include "examples/scan_model.h"

namespace texmesh {

// Write a made scan to disk; InputError when a file cannot be written. Files beside the named one (MTL,
// textures, grid) take its stem.

void write_scan_glb(const Model& model, const std::string& path);
void write_scan_obj(const Model& model, const std::string& path);
/// Binary PLY with texture coordinates per face and a TextureFile comment (base colour only), as MeshLab
/// writes it.
void write_scan_ply(const Model& model, const std::string& path);
/// JSON, a 16-bit PGM grid and a JPEG; see schemas/range-scan.v1.schema.json.
void write_range_scan(const MadeRangeScan& scan, int jpeg_quality, const std::string& path);

}  // namespace texmesh
