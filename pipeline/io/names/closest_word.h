#pragma once
#include <span>
#include <string>
#include <string_view>

namespace texmesh {

/// The word that somebody who wrote `written` may have meant: by the fewest letters that are missing, too
/// many, other or in the place of their neighbour, at most a third of them. Case, blanks, - and _ do not
/// count. Of words as close the first; "" where none is close.
std::string_view closest_word(std::string_view written, std::span<const std::string_view> words);

/// "; did you mean WORD?", or "".
std::string meant_instead(std::string_view written, std::span<const std::string_view> words);

}  // namespace texmesh
