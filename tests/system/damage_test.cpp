// Damage of a golden package, byte for byte: every truncation and every flipped byte is found
// (format/SPEC.md, section 18).
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "delivery/cpp/package/package_reader.h"
#include "format/container/container.h"
#include "tests/support/check_crc.h"
#include "tests/support/command.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::damage_test {

namespace fs = std::filesystem;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;

const fs::path kGolden = fs::path(TEXMESH_SOURCE_DIR) / "tests" / "golden";

Bytes read_bytes(const std::string& path) {
  const std::string text = testing::read_text(path);
  return {text.begin(), text.end()};
}
Bytes golden() { return read_bytes((kGolden / "v2.0-webp.texmesh").string()); }

/// The rule by which the container's own rules refuse these bytes, K01 to K10; "" = none of them does.
std::string broken_rule(const Bytes& bytes) {
  try {
    const auto source = memory_source(std::span<const std::uint8_t>(bytes), "damaged");
    for (const ContainerEntry& e : read_container(*source)) check_crc(*source, e);
    return "";
  } catch (const Error& e) {
    const std::string what = e.what();
    return what.size() > 5 && what.back() == ']' ? what.substr(what.size() - 4, 3) : "no rule: " + what;
  }
}

std::vector<Finding> findings_of(const Bytes& bytes) {
  return verify_package(*open_container(memory_source(std::span<const std::uint8_t>(bytes), "damaged")), {})
      .findings;
}
/// Whether verify names the rule that the container's own rules refuse these bytes by: so what holds of
/// broken_rule(), which is cheap enough for every byte, holds of verify.
bool verify_names_the_rule(const Bytes& bytes) {
  const std::string rule = broken_rule(bytes);
  return std::ranges::any_of(findings_of(bytes), [&](const Finding& f) { return f.rule == rule; });
}

TEST(Damage, EveryTruncationBreaksARuleOfTheContainer) {
  const Bytes whole = golden();
  ASSERT_EQ(broken_rule(whole), "");
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    const std::string rule = broken_rule({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes)});
    ASSERT_TRUE(rule == "K01" || rule == "K10") << bytes << " bytes: " << rule;
  }
}

TEST(Damage, EveryFlippedByteBreaksARuleOfTheContainer) {
  Bytes bytes = golden();
  std::set<std::string> rules;
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (const int mask : {1 << at % 8, 0xff}) {
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ mask);
      const std::string rule = broken_rule(bytes);
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ mask);
      ASSERT_EQ(rule.substr(0, 1), "K") << "byte " << at << " ^ " << mask << ": " << rule;
      rules.insert(rule);
    }
  }
  EXPECT_TRUE(rules.contains("K07")) << "entry data";
  EXPECT_TRUE(rules.contains("K02")) << "headers";
}

TEST(Damage, VerifyFindsTruncationsAroundEveryEntry) {
  const Bytes whole = golden();
  const auto source = memory_source(std::span<const std::uint8_t>(whole), "whole");
  std::set<std::uint64_t> sizes;
  for (const ContainerEntry& e : read_container(*source))
    for (const std::uint64_t edge : {e.offset, e.offset + e.bytes})
      for (const int step : {-8, -1, 0, 1, 8}) sizes.insert(edge + static_cast<std::uint64_t>(step));
  ASSERT_TRUE(findings_of(whole).empty());
  for (const std::uint64_t bytes : sizes) {
    if (bytes >= whole.size()) continue;
    EXPECT_TRUE(verify_names_the_rule({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes)}))
        << bytes;
  }
}

TEST(Damage, VerifyFindsFlipsEverywhere) {
  Bytes bytes = golden();
  for (std::size_t at = 0; at < bytes.size(); at += 97) {
    bytes[at] ^= 0x10;
    EXPECT_TRUE(verify_names_the_rule(bytes)) << "byte " << at;
    bytes[at] ^= 0x10;
  }
}

/// How many findings there are in a tree whose manifest had that id; opening it may be refused at once.
std::size_t findings_of_tree(const std::string& tree, const Sha256& id) {
  try {
    const std::size_t findings = verify_package(*open_store(tree), {}).findings.size();
    return findings + (PackageReader(open_store(tree)).id() != id);
  } catch (const Error&) {
    return 1;
  }
}

/// The golden package as a tree, and what stands in it.
struct Tree {
  TemporaryFolder folder;
  std::string path = folder / "tree";
  Sha256 id{};
  std::vector<fs::path> files;
  explicit Tree(std::vector<std::string> options = {}) {
    const std::string package = (kGolden / "v2.0-webp.texmesh").string();
    std::vector<std::string> command{TEXMESH_BINARY, "unpack", package, "-o", path};
    command.insert(command.end(), options.begin(), options.end());
    EXPECT_EQ(testing::run_command(command).exit_code, 0);
    id = PackageReader(open_store(path)).id();
    for (const auto& e : fs::recursive_directory_iterator(path))
      if (e.is_regular_file()) files.push_back(e.path());
  }
  /// Findings while that file has other bytes.
  std::size_t findings_with(const fs::path& file, const Bytes& bytes) const {
    const std::string whole = testing::read_text(file.string());
    testing::write_text(file.string(), std::string(bytes.begin(), bytes.end()));
    const std::size_t findings = findings_of_tree(path, id);
    testing::write_text(file.string(), whole);
    return findings;
  }
};

// In a tree nothing covers manifest.json but the package id (D01); every other file is under a digest.
TEST(Damage, InATreeEveryFileButTheManifestIsUnderADigest) {
  const Tree tree;
  EXPECT_GT(tree.files.size(), 10u);
  for (const fs::path& file : tree.files) {
    const Bytes whole = read_bytes(file.string());
    for (std::size_t at = 0; at < whole.size(); at += std::max<std::size_t>(whole.size() / 3, 1)) {
      Bytes flipped = whole;
      flipped[at] ^= 1;
      EXPECT_GT(tree.findings_with(file, flipped), 0u) << file << ", byte " << at;
      EXPECT_GT(tree.findings_with(file, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(at)}),
                0u)
          << file << ", first " << at << " bytes";
    }
  }
  EXPECT_EQ(findings_of_tree(tree.path, tree.id), 0u);
}

// Files of a tree that are no entries (14.5): harmless by rule (annex C), and found all the same.
TEST(Damage, InATreeFilesThatAreNoEntriesMayChangeButVerifySaysSo) {
  const Tree tree({"--fragments", "files"});
  std::size_t loose = 0;
  for (const fs::path& file : tree.files) {
    const std::string name = fs::relative(file, tree.path).string();
    if (name != "fragments.json" && (!name.starts_with("texture/") || file.extension() == ".pack")) continue;
    ++loose;
    Bytes flipped = read_bytes(file.string());
    flipped[flipped.size() / 2] ^= 1;
    EXPECT_GT(tree.findings_with(file, flipped), 0u) << file;
    EXPECT_GT(tree.findings_with(file, {}), 0u) << file;
  }
  EXPECT_GT(loose, 3u);
}

}  // namespace texmesh::damage_test
