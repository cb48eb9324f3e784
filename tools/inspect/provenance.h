#pragma once
#include <map>
#include <memory>

#include "pipeline/io/record.h"

namespace texmesh {

/// provenance.json (schemas/provenance.v1.schema.json): what a package was made from and with. No
/// dates, hosts, paths.
struct Provenance {
  struct Format {
    int major = 0, minor = 0;
    std::string text() const { return std::to_string(major) + "." + std::to_string(minor); }
    static void fields(auto& s, auto&& v) {
      v("major", s.major, Range{0, 65535}, "");
      v("minor", s.minor, Range{0, 65535}, "");
    }
  };
  struct Input {
    std::string role, uri, sha256;  // role: model, or file for what the model refers to by `uri`
    std::uint64_t bytes = 0;
    static void fields(auto& s, auto&& v) {
      v("role", s.role, FieldRule{.words = "model|file"}, "");
      v("uri", s.uri, kMayMiss, "as the model refers to the file");
      v("sha256", s.sha256, FieldRule{.pattern = "^[0-9a-f]{64}$"}, "");
      v("bytes", s.bytes, Range{0, 9007199254740992.0}, "");
    }
  };
  std::string tool;  // "texmesh 1.2.3"
  Format format;
  std::vector<Input> inputs;            // the model first
  std::shared_ptr<const Json> options;  // a profile with every option, never null
  std::map<std::string, int> stages;
  std::map<std::string, std::string> libraries;
  static void fields(auto& s, auto&& v) {
    constexpr Range kText{1, 1e6};
    v("version", Constant{1}, "");
    v("tool", s.tool, kText, "name and version of what made the package");
    v("format", s.format, "");
    v("inputs", s.inputs, FieldRule{.count = Range{1, 1e6}}, "the model, then the files that it refers to");
    v("options", s.options, "every option, after defaults, as a profile (profile.v1)");
    v("stages", s.stages, Range{0, 1 << 30}, "stage name: version");
    v("libraries", s.libraries, kText, "library that can change bytes: version");
  }
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
std::vector<OptionChange> changed_options(const Json& profile);

}  // namespace texmesh
