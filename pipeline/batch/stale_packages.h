#pragma once
#include <set>

#include "pipeline/batch/plan.h"

namespace texmesh {

/// Packages beneath the output folder of a plan of the whole collection that none of its models makes: models
/// have gone, or have other names. Paths within the folder, sorted. Hidden files and links do not count. Of
/// 100,000 models the folder is listed, and next to nothing is opened.
std::vector<std::string> stale_packages(const BatchPlan& plan);

/// The file of an output folder that lists its stale packages for `site`, a line each, paths within the
/// folder. There is none where no package is stale.
inline constexpr const char* kStaleList = ".texmesh-stale";
/// Writes the file, or removes it. ResourceError.
void list_stale(const std::string& folder, const std::vector<std::string>& packages);
/// What the file lists; empty where it is not there or cannot be read.
std::set<std::string> listed_stale(const std::string& folder);

/// Removes packages. ResourceError for the first that cannot be removed.
void remove_stale(const std::string& folder, const std::vector<std::string>& packages);

}  // namespace texmesh
