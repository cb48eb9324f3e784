#include "stages/image/readers_module/other_pictures.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh::readers_test {

TEST(ReadersModule, TheModuleIsFoundByItsNameAndShowsOneSymbol) {
  void* const module = ::dlopen("texmesh_readers.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(module, nullptr) << ::dlerror();
  EXPECT_NE(::dlsym(module, kReadersSymbol), nullptr);
  EXPECT_EQ(::dlsym(module, "texmesh_readers_2"), nullptr) << "the module of another build";
}

TEST(ReadersModule, ItsErrorsAreThoseOfTheProgram) {
  void* const module = ::dlopen("texmesh_readers.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(module, nullptr) << ::dlerror();
  const auto reader = reinterpret_cast<const ModuleReaders* (*)()>(::dlsym(module, kReadersSymbol));
  ASSERT_NE(reader, nullptr);
  const Bytes no_tiff{'I', 'I', 42, 0, 1};
  try {
    reader()->read_tiff_exr_header("broken.tif", ImageFormat::kTiff, no_tiff, {});
    FAIL() << "five bytes were read as a TIFF";
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "broken.tif");
    EXPECT_FALSE(e.found().empty());
  }
}

}  // namespace texmesh::readers_test
