#pragma once
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "format/base/sha256.h"

namespace texmesh {

/// Raise when the way keys are made changes.
inline constexpr int kKeySchema = 1;

/// Everything that a stage run depends on, as labelled parts. The key's digest is the SHA-256 over the
/// length-prefixed labels and values in order. The parts are kept beside each cache entry, so that a miss can
/// be explained.
class Key {
 public:
  Key(std::string_view stage, int stage_version);
  Key& add(std::string label, std::string value);
  /// An input artefact: role, digest and size. Downstream keys hold *output* digests, so an equal result
  /// stops the wave.
  Key& add_input(std::string_view role, const Sha256& digest, std::uint64_t bytes);
  Sha256 digest() const;
  const std::vector<std::pair<std::string, std::string>>& parts() const { return parts_; }
  /// The parts behind those that the constructor made (schema, stage, version).
  std::vector<std::pair<std::string, std::string>> added_parts() const;
  /// The parts as a JSON object of strings.
  std::string preimage() const;

 private:
  Key() = default;
  friend std::optional<Key> key_from_json(const nlohmann::ordered_json& json);
  std::vector<std::pair<std::string, std::string>> parts_;
};

/// A key from its preimage, with the same parts in the same order; nothing when it is no preimage.
std::optional<Key> key_from_preimage(const std::string& preimage);
std::optional<Key> key_from_json(const nlohmann::ordered_json& json);

/// The keys that the stages of one model had, by stage name.
using StageKeys = std::map<std::string, Sha256>;

/// The digest of a key that has these parts.
Sha256 digest_of_parts(const std::vector<std::pair<std::string, std::string>>& parts);

}  // namespace texmesh
