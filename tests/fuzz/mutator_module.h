#pragma once
// mutate() as a library of its own, without sanitizers and counters: what the fuzzer does to inputs of JSON
// and containers took two thirds of its time.
#include <cstddef>
#include <cstdint>

namespace texmesh::fuzz {
struct Target;
}

extern "C" {
/// `change`: libFuzzer's, on `size` bytes of a buffer of `most`; returns the new size. `take` gets the
/// result. Not for Shape::kBytes: what Target::mend of the program allocates would be freed by this
/// library's allocator.
void texmesh_fuzz_mutate(const texmesh::fuzz::Target* target, const std::uint8_t* data, std::size_t size,
                         unsigned seed,
                         std::size_t (*change)(std::uint8_t* data, std::size_t size, std::size_t most),
                         void (*take)(const std::uint8_t* data, std::size_t size));
}
