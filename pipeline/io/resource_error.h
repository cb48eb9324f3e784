#pragma once
#include "format/base/errors.h"

namespace texmesh {

/// The machine, not the model: a file cannot be written (full disk, no permission) or cannot be read now (I/O
/// error, too many open files). Another moment or another place may do, so it is never remembered as a known
/// failure of the model.
struct ResourceError : InputError {
  using InputError::InputError;
};

}  // namespace texmesh
