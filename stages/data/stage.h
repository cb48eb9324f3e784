#pragma once
// What the public header of every stage needs: format/base/fields.h describes options, and the context in
// which a stage runs is known by name. Callers include stages/base/run_context.h.
#include "format/base/fields.h"

namespace texmesh {

struct RunContext;

/// In `fields`, before the text: profiles may set the option, the command line has no flag for it. The
/// method's own constants, which the thesis or a test sets.
struct ProfileOnly {};

}  // namespace texmesh
