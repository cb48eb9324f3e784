// Damage of a golden package, byte for byte: every truncation and every flipped byte is found
// (format/SPEC.md, section 18).
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "delivery/cpp/package/package_reader.h"
#include "format/container/container.h"
#include "pipeline/inspect/verify/verify.h"
#include "tests/support/command.h"

namespace texmesh {
namespace {

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

std::size_t findings_of(const Bytes& bytes) {
  return verify_package(*open_container(memory_source(std::span<const std::uint8_t>(bytes), "damaged")), {})
      .findings.size();
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
  ASSERT_EQ(findings_of(whole), 0u);
  for (const std::uint64_t bytes : sizes) {
    if (bytes >= whole.size()) continue;
    EXPECT_GT(findings_of({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes)}), 0u) << bytes;
  }
}

TEST(Damage, VerifyFindsFlipsEverywhere) {
  Bytes bytes = golden();
  for (std::size_t at = 0; at < bytes.size(); at += 97) {
    bytes[at] ^= 0x10;
    EXPECT_GT(findings_of(bytes), 0u) << "byte " << at;
    bytes[at] ^= 0x10;
  }
}

// In a tree nothing covers manifest.json but the package id (D01); every other file is under a digest.
TEST(Damage, InATreeEveryFileButTheManifestIsUnderADigest) {
  TemporaryFolder folder;
  const std::string tree = folder / "tree", texmesh = TEXMESH_BINARY;
  const std::string package = (kGolden / "v2.0-webp.texmesh").string();
  ASSERT_EQ(testing::run_command({texmesh, "unpack", package, "-o", tree}).exit_code, 0);
  const Sha256 id = PackageReader(open_store(tree)).id();
  std::size_t files = 0;
  for (const auto& e : fs::recursive_directory_iterator(tree)) {
    if (!e.is_regular_file()) continue;
    ++files;
    const Bytes whole = read_bytes(e.path().string());
    const auto write = [&](const Bytes& bytes) {
      testing::write_text(e.path().string(), std::string(bytes.begin(), bytes.end()));
    };
    for (std::size_t at = 0; at < whole.size(); at += std::max<std::size_t>(whole.size() / 3, 1)) {
      Bytes flipped = whole;
      flipped[at] ^= 1;
      write(flipped);
      std::size_t findings = 0;
      try {
        findings = verify_package(*open_store(tree), {}).findings.size();
        if (e.path().filename() == "manifest.json" && findings == 0)
          findings = PackageReader(open_store(tree)).id() != id;
      } catch (const Error&) {
        findings = 1;
      }
      EXPECT_GT(findings, 0u) << e.path() << ", byte " << at;
    }
    write(whole);
  }
  EXPECT_GT(files, 10u);
  EXPECT_TRUE(verify_package(*open_store(tree), {}).findings.empty());
}

}  // namespace
}  // namespace texmesh
