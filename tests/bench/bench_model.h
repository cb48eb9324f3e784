#pragma once
// A real model up to its texture planes, for programs that measure the texture stages.
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/condition/condition.h"
#include "stages/fragmentation/fragmentation.h"

namespace texmesh {

struct BenchModel {
  std::vector<Image> images;
  std::vector<Material> materials;
  Fragments fragments;  // without mips and feature points: eta is 0 everywhere
};

inline BenchModel load_bench_model(const std::string& path, const RunContext& context) {
  FileResolver resolver(std::filesystem::path(path).parent_path());
  ImportedModel m = import_model(std::filesystem::path(path).filename().string(),
                                 read_input_file(path, 1ull << 32), resolver, {}, context);
  const ConditionedMesh mesh = condition_mesh(m.model.mesh, m.normals_by_specification, {}, context);
  ScaleMap scale_map;
  scale_map.persistence.assign(mesh.mesh.positions.size(), 0);
  scale_map.crossing.assign(mesh.mesh.positions.size(), 0);
  BenchModel out;
  out.images = std::move(m.model.images);
  out.materials = std::move(m.model.materials);
  FragmentationOptions options;
  options.mips = false;
  out.fragments = fragment_textures(mesh, out.materials, out.images, scale_map, options, context);
  return out;
}

/// What is worth measuring: the planes that show as colours.
inline std::vector<std::size_t> colour_planes(const Fragments& fragments) {
  std::vector<std::size_t> out;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    if (fragments.planes[p].role == TextureRole::kBaseColour) out.push_back(p);
  return out;
}

/// Name of a model in a table: its file without folders and ending.
inline std::string model_name(const std::string& path) { return std::filesystem::path(path).stem().string(); }

}  // namespace texmesh
