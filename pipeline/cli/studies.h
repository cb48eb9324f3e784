#pragma once

namespace texmesh {

class Command;

// Each adds one study to texmesh study.
void add_fragments_study(Command& study);  // study_fragments.cpp
void add_quality_study(Command& study);    // study_quality.cpp

}  // namespace texmesh
