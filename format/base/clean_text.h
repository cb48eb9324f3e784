#pragma once
#include <cstddef>
#include <string>

namespace texmesh {

/// A stranger's text, fit to be stored and shown: bytes that are not UTF-8 and control characters become
/// '?', and what is longer than `max_bytes` is cut at a character.
std::string clean_text(const std::string& text, std::size_t max_bytes);

}  // namespace texmesh
