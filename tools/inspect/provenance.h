#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

/// provenance.json (schemas/provenance.v1.schema.json): what a package was made from and with. No
/// dates, hosts, paths.
struct Provenance {
  struct Input {
    std::string role, uri, sha256;  // role: model, or file for what the model refers to by `uri`
    std::uint64_t bytes = 0;
  };
  std::string tool;  // "texmesh 1.2.3"
  int format_major = 0, format_minor = 0;
  std::vector<Input> inputs;                              // the model first
  std::shared_ptr<const nlohmann::ordered_json> options;  // a profile with every option, never null
  std::map<std::string, int> stages;                      // versions by name
  std::map<std::string, std::string> libraries;           // versions by name
};

/// Strict for what version 1 defines, ignores unknown fields. FormatError names the JSON pointer.
Provenance read_provenance(std::span<const std::uint8_t> json);

/// An option of a package that is not what this build would take by itself.
struct OptionChange {
  std::string name;      // "ladder.rungs"
  std::string value;     // JSON text
  std::string fallback;  // JSON text; "" where this build has no such option
};
/// `profile`: every option of a package, as its provenance holds them.
std::vector<OptionChange> changed_options(const nlohmann::ordered_json& profile);

}  // namespace texmesh
