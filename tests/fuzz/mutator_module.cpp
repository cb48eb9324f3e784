#include "tests/fuzz/mutator_module.h"

#include "tests/fuzz/mutate.h"

void texmesh_fuzz_mutate(const texmesh::fuzz::Target* target, const std::uint8_t* data, std::size_t size, unsigned seed,
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
