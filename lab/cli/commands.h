#pragma once

namespace texmesh {

class Command;

// Each adds one command of the laboratory, in the source of its name.
void add_fragments_study(Command& study);
void add_quality_study(Command& study);
void add_method_study(Command& study);
void add_prediction_study(Command& study);
void add_rungs_study(Command& study);
void add_thesis_study(Command& study);
void add_make_experiment(Command& experiment);
void add_fit_experiment(Command& experiment);
void add_lab_simulate_command(Command& app);  // command_simulate.cpp
void add_picture_command(Command& app);

}  // namespace texmesh
