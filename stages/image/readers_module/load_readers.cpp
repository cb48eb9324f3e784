#include <dlfcn.h>

#include "stages/image/readers_module/readers.h"

namespace texmesh {
namespace {

constexpr const char* kModule = "texmesh_readers.so";

struct ReaderModule {
  const ModuleReaders* readers = nullptr;
  std::string problem;
};

// OpenImageIO brings 200 shared libraries with it, DCMTK among them. Loading them takes .2 s, and most models
// need none of them.
ReaderModule load_module() {
  // By name alone: the run path of this program or library tells the folder. Never closed, since errors that
  // the module throws outlive any call.
  void* const module = ::dlopen(kModule, RTLD_NOW | RTLD_LOCAL);
  if (module)
    if (void* const symbol = ::dlsym(module, kReadersSymbol))
      return {reinterpret_cast<const ModuleReaders* (*)()>(symbol)(), ""};
  const char* const why = ::dlerror();
  return {nullptr, why ? why : "an error without a message"};
}

}  // namespace

const ModuleReaders& module_readers(const std::string& name, const std::string& what,
                                    const std::string& package) {
  static const ReaderModule module = load_module();
  if (module.readers) return *module.readers;
  throw InputError(name, "",
                   "a reader for " + what + ": " + kModule +
                       ", which is installed with texmesh, and Debian's package " + package,
                   module.problem);
}

}  // namespace texmesh
