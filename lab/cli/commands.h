#pragma once

namespace texmesh {

class Command;
struct ConditionedMesh;
struct NestedScales;
struct PaintedModel;
struct Skeleton;

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
void add_picture_command(Command& app);       // picture_quantities.cpp

// Results of the method's stages as `picture` shows them.

/// The curve skeleton as lines inside the shape.
PaintedModel paint_skeleton(const ConditionedMesh& mesh, const Skeleton& skeleton);
/// R(v), the distance to the skeleton. StageError where the skeleton is of another mesh.
PaintedModel paint_radius(const ConditionedMesh& mesh, const Skeleton& skeleton);
/// At which error a vertex was removed; logarithmic.
/// |R_R - R_C| / R_C of the collapse that removed a vertex; 0 where none did.
PaintedModel paint_perceptual(const NestedScales& scales, const Skeleton& skeleton);
PaintedModel paint_collapse_error(const NestedScales& scales);

}  // namespace texmesh
