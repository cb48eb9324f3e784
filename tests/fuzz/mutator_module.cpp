#include "tests/fuzz/mutator_module.h"

#include <new>

#include "tests/fuzz/mutate.h"

void texmesh_fuzz_mutate(const texmesh::fuzz::Target* target, const std::uint8_t* data, std::size_t size,
                         unsigned seed,
                         std::size_t (*change)(std::uint8_t* data, std::size_t size, std::size_t most),
                         void (*take)(const std::uint8_t* data, std::size_t size)) {
  const auto change_bytes = [change](texmesh::Bytes input, std::size_t growth) {
    const std::size_t length = input.size();
    input.resize(length + growth);
    input.resize(change(input.data(), length, input.size()));
    return input;
  };
  texmesh::fuzz::Random random{seed};
  const texmesh::Bytes mutated = texmesh::fuzz::mutate(*target, {data, data + size}, random, change_bytes);
  take(mutated.data(), mutated.size());
}

// The sanitizer's allocator was a third of what a mutation took. Nothing allocated here is freed elsewhere,
// or the reverse: the library has libstdc++ in itself.
extern "C" void* __libc_malloc(std::size_t bytes);
extern "C" void __libc_free(void* place);
void* operator new(std::size_t bytes) {
  if (void* place = __libc_malloc(bytes > 0 ? bytes : 1)) return place;
  throw std::bad_alloc();
}
void operator delete(void* place) noexcept { __libc_free(place); }
void operator delete(void* place, std::size_t) noexcept { __libc_free(place); }
