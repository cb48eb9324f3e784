#pragma once
#include <string>

namespace texmesh {

/// The executable that has every stage in it, texmesh-core: beside this one, or in ../libexec/texmesh, where
/// installing puts it. The `texmesh` that people call loads none of the stages' libraries, so that a build
/// with nothing to do ends at once; it starts this one for everything else. InputError when it is not there.
std::string core_executable();

/// What tells this build of texmesh-core from others: the build id that the linker has put into it, the same
/// for every copy; where there is none, size and time of the file.
std::string core_build();

}  // namespace texmesh
