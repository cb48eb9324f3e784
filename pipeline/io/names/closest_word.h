#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace texmesh {

/// Of ASCII letters; others stay.
inline char lower_letter(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }
std::string in_lower_case(std::string text);

/// The word that somebody who wrote `written` may have meant: by the fewest letters that are missing, too
/// many, other or in the place of their neighbour, at most a third of them; else the first of which it is the
/// beginning, where it has three letters. Case, blanks, - and _ do not count. Of words as close the first; ""
/// where none is close.
std::string_view closest_word(std::string_view written, std::span<const std::string_view> words);

/// "; did you mean WORD?", or "".
template <class Words>
std::string meant_instead(std::string_view written, const Words& words) {
  const std::vector<std::string_view> views(std::begin(words), std::end(words));
  const std::string_view closest = closest_word(written, views);
  return closest.empty() ? "" : "; did you mean " + std::string(closest) + "?";
}

}  // namespace texmesh
