#include "tools/cli/options/told_errors.h"

#include <filesystem>
#include <iostream>

#include "format/base/errors.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/options/units.h"

namespace texmesh {

int run_telling_errors(const std::function<int()>& run) {
  try {
    return run();
  } catch (const UsageError& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitUsage;
  } catch (const Error& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitModelFailed;
  } catch (const std::filesystem::filesystem_error& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitModelFailed;
  } catch (const std::exception& e) {
    std::cerr << "texmesh: internal error: " << e.what() << '\n';
    return kExitInternal;
  }
}

}  // namespace texmesh
