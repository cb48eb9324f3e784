#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace texmesh {

/// What a file is by its first bytes, where it is neither a model nor a picture that texmesh reads, and what
/// to do about it: "a Git LFS pointer (git lfs pull fetches the file)". "" for anything else.
std::string foreign_file(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
