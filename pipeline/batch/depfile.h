#pragma once
#include <string>
#include <vector>

namespace texmesh {

/// A dependency file that GNU make and Ninja (deps = gcc) read alike: `target: dependencies`, then an
/// empty rule per dependency, so that removing one does not stop make. Blanks, # and $ are escaped.
/// InputError for a path with a line break or a backslash before a character that is escaped, which
/// neither of them can express.
std::string write_depfile(const std::string& target, const std::vector<std::string>& dependencies);

}  // namespace texmesh
