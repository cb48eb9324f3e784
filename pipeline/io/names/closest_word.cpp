#include "pipeline/io/names/closest_word.h"

#include <algorithm>

namespace texmesh {
namespace {

constexpr std::size_t kMostLetters = 64;

std::string letters_of(std::string_view word) {
  std::string letters;
  for (const char c : word.substr(0, kMostLetters))
    if (c != ' ' && c != '-' && c != '_') letters += lower_letter(c);
  return letters;
}

/// Damerau's distance between neighbouring strings ("optimal string alignment").
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

}  // namespace

std::string in_lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), lower_letter);
  return text;
}

std::string_view closest_word(std::string_view written, std::span<const std::string_view> words) {
  const std::string letters = letters_of(written);
  std::string_view closest;
  std::size_t least = letters.size() / 3 + 1;
  for (const std::string_view word : words) {
    const std::size_t d = distance(letters, letters_of(word));
    if (d < least && d < word.size()) least = d, closest = word;
  }
  const auto begins = [&](std::string_view word) { return letters_of(word).starts_with(letters); };
  if (const auto longer = std::ranges::find_if(words, begins);
      closest.empty() && letters.size() >= 3 && longer != words.end())
    closest = *longer;
  return closest;
}

}  // namespace texmesh
