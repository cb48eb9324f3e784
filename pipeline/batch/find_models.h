#pragma once
#include <string>
#include <vector>

namespace texmesh {

/// A model to compile and where its package goes.
struct ModelPath {
  std::string input, output;
  bool unread = false;  // a .json of a folder: a model only where is_range_scan() says so
};

/// The models that `inputs` name: files as they are; of a folder every .glb .gltf .obj .ply .stl and .json
/// beneath it, sorted by path. One input file with an `output` that ends in .texmesh gives that package;
/// otherwise `output` is a folder, and a model's package stands in it under the same relative path. Two
/// models that would share a package (a.glb beside a.obj) keep their extension in its name (a.glb.texmesh);
/// a .json keeps it beside any other, which does not keep it for the .json. What a .json holds does not
/// count: a shard of a run opens its own ones only. InputError for what is not there.
std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output);

/// The files beneath a folder that find_models finds there: paths relative to it, sorted. InputError when the
/// folder is not there or holds no model.
std::vector<std::string> list_models(const std::string& folder);

/// By its name: only what it holds tells whether it is a model.
bool is_json(const std::string& path);

/// A JSON file that says within its first bytes that it is a range scan; other JSON files are collections.
bool is_range_scan(const std::string& path);

}  // namespace texmesh
