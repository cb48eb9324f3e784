#pragma once
#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <string_view>
#include <vector>

namespace texmesh {

/// The texts that `text_of` gives for more than one of the items; the views point to what it gives.
/// 8 bytes an item: a map of the texts of 100,000 models took a sixth of a run that does nothing.
template <class Item, class TextOf>
std::set<std::string_view> repeated_texts(const std::vector<Item>& items, const TextOf& text_of) {
  const std::hash<std::string_view> hash;
  std::vector<std::size_t> hashes;
  hashes.reserve(items.size());
  for (const Item& item : items) hashes.push_back(hash(text_of(item)));
  std::sort(hashes.begin(), hashes.end());
  std::set<std::size_t> shared;
  for (auto at = hashes.begin(); (at = std::adjacent_find(at, hashes.end())) != hashes.end(); ++at)
    shared.insert(*at);
  std::set<std::string_view> seen, repeated;
  if (shared.empty()) return repeated;
  for (const Item& item : items)
    if (const std::string_view text = text_of(item); shared.contains(hash(text)) && !seen.insert(text).second)
      repeated.insert(text);
  return repeated;
}

/// The first item whose text an earlier one has, and that one; nulls when there is none.
template <class Item, class TextOf>
std::pair<const Item*, const Item*> first_repetition(const std::vector<Item>& items, const TextOf& text_of) {
  const std::set<std::string_view> repeated = repeated_texts(items, text_of);
  std::map<std::string_view, const Item*> taken;
  if (repeated.empty()) return {};
  for (const Item& item : items) {
    if (!repeated.contains(text_of(item))) continue;
    const auto [earlier, fresh] = taken.emplace(text_of(item), &item);
    if (!fresh) return {&item, earlier->second};
  }
  return {};
}

}  // namespace texmesh
