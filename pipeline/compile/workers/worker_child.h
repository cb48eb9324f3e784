#pragma once

namespace texmesh {

/// The worker's side of compiling in child processes: reads a job from standard input, writes event lines to
/// standard output, returns the exit code.
int worker_main();

}  // namespace texmesh
