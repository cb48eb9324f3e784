#pragma once
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// The last part of a path, also where a slash stands behind it.
std::string last_name(const std::string& path);

/// Title of a page about the package: what the package calls itself, or its file. Plain text.
std::string package_title(PackageReader& package);

/// A paragraph of HTML: whose the object is, and the licence as a link to where it can be read; "" where
/// nothing is known.
std::string rights_line(const About& about);

}  // namespace texmesh
