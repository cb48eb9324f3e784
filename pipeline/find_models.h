#pragma once
#include <string>
#include <vector>

namespace texmesh {

/// A model to compile and where its package goes.
struct ModelPath {
  std::string input, output;
};

/// The models that `inputs` name: files as they are; of a folder every .glb .gltf .obj .ply .stl and every
/// range-scan JSON beneath it, sorted by path. One input file with an `output` that ends in .texmesh gives
/// that package; otherwise `output` is a folder, and a model's package stands in it under the same relative
/// path. Two models that would share a package (a.glb beside a.obj) keep their extension in its name
/// (a.glb.texmesh). InputError for what is not there.
std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output);

}  // namespace texmesh
