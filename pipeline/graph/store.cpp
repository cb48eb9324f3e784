#include "pipeline/graph/store.h"

#include <nlohmann/json.hpp>

namespace texmesh {

/// added_parts() begins behind these three.
Key::Key(std::string_view stage, int stage_version) {
  add("key schema", std::to_string(kKeySchema));
  add("stage", std::string(stage));
  add("stage version", std::to_string(stage_version));
}

Key& Key::add(std::string label, std::string value) {
  parts_.emplace_back(std::move(label), std::move(value));
  return *this;
}

Key& Key::add_input(std::string_view role, const Sha256& digest, std::uint64_t bytes) {
  return add("input " + std::string(role), to_hex(digest) + " " + std::to_string(bytes));
}

std::vector<std::pair<std::string, std::string>> Key::added_parts() const {
  return {parts_.begin() + 3, parts_.end()};
}

Sha256 Key::digest() const { return digest_of_parts(parts_); }

Sha256 digest_of_parts(const std::vector<std::pair<std::string, std::string>>& parts) {
  Bytes all;
  auto put = [&all](const std::string& s) {
    for (int i = 0; i < 8; ++i) all.push_back(static_cast<std::uint8_t>(s.size() >> (8 * i)));
    all.insert(all.end(), s.begin(), s.end());
  };
  for (const auto& [label, value] : parts) {
    put(label);
    put(value);
  }
  return sha256(all);
}

std::optional<Key> key_from_preimage(const std::string& preimage) {
  return key_from_json(nlohmann::ordered_json::parse(preimage, nullptr, false));
}

std::optional<Key> key_from_json(const nlohmann::ordered_json& json) {
  if (!json.is_object()) return std::nullopt;
  Key key;
  for (const auto& [label, value] : json.items()) {
    if (!value.is_string()) return std::nullopt;
    key.add(label, value.get<std::string>());
  }
  return key;
}

std::string Key::preimage() const {
  nlohmann::ordered_json j = nlohmann::ordered_json::object();
  for (const auto& [label, value] : parts_) j[label] = value;
  return j.dump(1);
}

}  // namespace texmesh
