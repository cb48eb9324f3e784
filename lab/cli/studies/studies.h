#pragma once

namespace texmesh {

class Command;

// Each adds one study to texmesh-lab study.
void add_fragments_study(Command& study);  // study_fragments.cpp
void add_quality_study(Command& study);    // study_quality.cpp
void add_method_study(Command& study);     // study_method.cpp
void add_prediction_study(Command& study);
void add_rungs_study(Command& study);  // study_prediction.cpp
void add_thesis_study(Command& study);

}  // namespace texmesh
