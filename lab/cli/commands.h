#pragma once

namespace texmesh {

class Command;

// Each adds one command of the laboratory to its program.
void add_study_command(Command& app);
void add_experiment_command(Command& app);
void add_picture_command(Command& app);

}  // namespace texmesh
