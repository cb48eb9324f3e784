#pragma once
#include <optional>
#include <string>
#include <vector>

#include "delivery/cpp/decide/gpu_memory.h"
#include "tools/cli/fetch/link_watch.h"

namespace texmesh {

/// What the transfer came to.
struct Fetched {
  int scale = 0;
  std::optional<std::uint32_t> proxy;  // shown instead of the scale
  struct Step {
    std::uint32_t proxy = 0;
    double at_s = 0;
  };
  std::optional<Step> step;  // a larger proxy on the way
  double rtt_s = 0, first_picture_s = 0, mesh_s = 0, end_s = 0;
  std::uint64_t mesh_bytes = 0, texture_bytes = 0;  // mesh: the documents and the first picture, too
  HttpPlace place;
  bool whole_rungs = false;
  LoadReport load;
  std::optional<LoadReport> refined;
  double texture_flip = 0, flip = 0;  // predicted of what has come
  GpuBytes gpu;
  std::vector<std::string> urls;  // in the order of load.mirrors
};

/// One line, schemas/fetch.v1.schema.json.
std::string fetched_json(const Fetched& f, const LinkWatch& watch, double limit_s);
/// For people; ends with a line end.
std::string fetched_text(const Fetched& f, const LinkWatch& watch, double limit_s);

}  // namespace texmesh
