#pragma once

namespace texmesh {

class Command;

void add_make_experiment(Command& experiment);  // experiment_make.cpp
void add_fit_experiment(Command& experiment);   // experiment_fit.cpp

}  // namespace texmesh
