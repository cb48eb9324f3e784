#include "pipeline/import/foreign_file.h"

#include <algorithm>

#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

struct Beginning {
  std::string_view magic;
  const char* what;
};

// Text in any case, blanks before it left out.
constexpr Beginning kTexts[] = {
    {"version https://git-lfs.github.com/", "a Git LFS pointer (git lfs pull fetches the file)"},
    {"/annex/objects/", "a git-annex pointer (git annex get fetches the file)"},
    {"<!doctype html", "an HTML page, as servers send in the place of a file"},
    {"<html", "an HTML page, as servers send in the place of a file"},
    {"<?xml", "an XML file"},
    {"outs:", "a DVC pointer (dvc pull fetches the file)"},
    {"; fbx", "an FBX file (export it as glTF)"},
    {"#usda", "a USD file (export it as glTF)"},
    {"off\n", "an OFF file (convert it to PLY)"}};

/// With the NULs in it.
template <std::size_t kSize>
constexpr std::string_view whole(const char (&magic)[kSize]) {
  return {magic, kSize - 1};
}
constexpr Beginning kBytes[] = {
    {whole("PK\3\4"), "a ZIP archive (unpack it first)"},
    {whole("\x1f\x8b"), "a gzip archive (unpack it first)"},
    {whole("7z\xbc\xaf\x27\x1c"), "a 7z archive (unpack it first)"},
    {whole("Rar!\x1a\7"), "a RAR archive (unpack it first)"},
    {whole("BZh"), "a bzip2 archive (unpack it first)"},
    {whole("\xfd"
           "7zXZ"),
     "an xz archive (unpack it first)"},
    {whole("\x28\xb5\x2f\xfd"), "a Zstandard archive (unpack it first)"},
    {whole("%PDF-"), "a PDF"},
    {whole("Kaydara FBX Binary"), "an FBX file (export it as glTF)"},
    {whole("BLENDER"), "a Blender file (export it as glTF)"},
    {whole("PXR-USDC"), "a USD file (export it as glTF)"},
    {whole("LASF"), "a point cloud (LAS): texmesh reads surfaces; mesh it first"},
    {whole("ASTM-E57"), "a point cloud (E57): texmesh reads surfaces; mesh it first"},
    {whole("NGSP"), "Gaussian splats: texmesh reads surfaces"}};

}  // namespace

std::string foreign_file(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kHeadBytes = 512;
  std::string_view text = text_of(bytes.first(std::min(bytes.size(), kHeadBytes)));
  for (const Beginning& b : kBytes)
    if (text.starts_with(b.magic)) return b.what;
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  const std::string words = lower(trim(text));
  for (const Beginning& b : kTexts)
    if (words.starts_with(b.magic)) return b.what;
  return "";
}

}  // namespace texmesh
