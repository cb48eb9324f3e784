#pragma once
#include <string>
#include <vector>

#include "pipeline/compile/workers/sandbox/sandbox.h"

namespace texmesh {

/// The places that one model's process has to do with; "" = none.
struct WorkerPlaces {
  std::string input, output, cache;
  std::string program;  // the executable, by whose folder the modules that it loads later are found
  std::vector<std::string> layers;  // folders and URLs
  bool only_looks = false;          // the cache is read only
};

/// What the process keeps: its modules (../stages of a build tree, ../../lib of an installation), the model's
/// folder and the file that the model is a link to are read, the result's folder and the cache are written,
/// layers are read. With layers that are URLs: the network, to the ports of these URLs and of name servers,
/// or to every port where the environment names a proxy.
SandboxRules sandbox_rules(const WorkerPlaces& places);

}  // namespace texmesh
