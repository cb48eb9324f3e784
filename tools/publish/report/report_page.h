#pragma once
#include <string>

#include "tools/publish/report/report.h"

namespace texmesh {

// Inside the room only: the sections of the page, HTML. Pictures that a section shows are appended to the
// report's files.

std::string header_section(PackageReader& package, Report& report);
std::string switch_section(PackagePictures& pictures, Report& report);
std::string source_section(PackagePictures& pictures, const RenderedModel& source, Vec3d offset,
                           Report& report);
std::string curve_section(PackageReader& package, const Report& report);
std::string bytes_section(PackageReader& package);
std::string fragment_section(PackageReader& package, Report& report);
std::string step_section(PackageReader& package);
/// "" for a package without proxies.
std::string proxy_section(PackageReader& package, PackagePictures& pictures, Report& report);
std::string method_section(PackageReader& package, const Report& report);

}  // namespace texmesh
