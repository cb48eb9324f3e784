#pragma once
#include "tools/inspect/atlas/atlas_report.h"

namespace texmesh {

/// What costs, the costliest first. Thresholds are where a good photogrammetry atlas is well clear of.
std::vector<AtlasAdvice> advise(const AtlasDiagnosis& diagnosis);
/// Why a model has no atlas.
std::string reason_for_none(const AtlasSubject& subject);

}  // namespace texmesh
