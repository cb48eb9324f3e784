#include "format/container/layout.h"

#include "format/documents/textures.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/container/container.h"

namespace texmesh::layout_test {

TEST(Layout, PathsParseOnlyInTheirCanonicalSpelling) {
  EXPECT_EQ(parse_entry_path(mesh_path(7)).kind, EntryKind::kMesh);
  EXPECT_EQ(parse_entry_path(mesh_path(7)).number, 7u);
  EXPECT_EQ(parse_entry_path(preview_path(1234)).number, 1234u);
  const EntryName rung = parse_entry_path(rung_path(12, 3));
  EXPECT_EQ(rung.kind, EntryKind::kRung);
  EXPECT_EQ(rung.number, 12u);
  EXPECT_EQ(rung.rung, 3u);
  const EntryName file = parse_entry_path(fragment_file_path(1, 2, 33));
  EXPECT_EQ(file.kind, EntryKind::kFragmentFile);
  EXPECT_EQ(file.fragment, 33u);
  const EntryName source = parse_entry_path(source_path(7, "webp"));
  EXPECT_EQ(source.kind, EntryKind::kSource);
  EXPECT_EQ(source.number, 7u);
  EXPECT_EQ(source.extension, "webp");
  EXPECT_EQ(parse_entry_path(proxy_path(3)).kind, EntryKind::kProxy);
  EXPECT_EQ(parse_entry_path(proxy_path(3)).number, 3u);
  for (const char* other :
       {"proxies/3.glb", "proxies/003.glb", "proxies/03.jpg", "source/7.png", "source/007.gif", "source/007.",
        "mesh/s7.glb", "mesh/s007.glb", "mesh/s07.glbx", "preview/1.jpg", "texture/01/r00.pack",
        "texture/0/r0.pack", "texture/0/rx.pack", "texture/99999999999/r00.pack", "a", ""})
    EXPECT_EQ(parse_entry_path(other).kind, EntryKind::kOther) << other;
}

TEST(Layout, StreamingOrder) {
  const std::vector<std::string> order{"manifest.json",
                                       "mesh/s09.glb",
                                       "index.bin",
                                       "textures.json",
                                       "quality.json",
                                       "texture/0/tables.pack",
                                       "texture/1/tables.pack",
                                       "tables.bin",
                                       "poster.jpg",
                                       "about.json",
                                       "preview/000.jpg",
                                       "preview/001.jpg",
                                       "texture/0/r00.pack",
                                       "texture/1/r00.pack",
                                       "texture/0/r01.pack",
                                       "texture/1/r01.pack",
                                       "mesh/s04.glb",
                                       "texture/0/r02.pack",
                                       "texture/1/r02.pack",
                                       "texture/0/r03.pack",
                                       "mesh/s00.glb",
                                       "extra/thing.bin",
                                       "source/000.png",
                                       "provenance.json",
                                       "META-INF/content_credential.c2pa"};
  std::vector<std::string> shuffled = order;
  std::ranges::sort(shuffled);
  EXPECT_EQ(streaming_order(shuffled), order);
  std::ranges::reverse(shuffled);
  EXPECT_EQ(streaming_order(shuffled), order);
  // The stream is the first of the other meshes.
  EXPECT_EQ(streaming_order({"mesh/s00.glb", "mesh/s09.glb", "mesh/stream.bin", "texture/0/r00.pack",
                             "texture/0/r01.pack", "manifest.json"}),
            (std::vector<std::string>{"manifest.json", "mesh/s09.glb", "texture/0/r00.pack",
                                      "mesh/stream.bin", "texture/0/r01.pack", "mesh/s00.glb"}));
  // With proxies the smallest is the first picture; the coarsest GLB and the others stand behind the tables.
  EXPECT_EQ(
      streaming_order({"proxies/02.glb", "mesh/s00.glb", "mesh/s09.glb", "proxies/00.glb", "tables.bin",
                       "about.json", "proxies/01.glb", "index.bin", "manifest.json"}),
      (std::vector<std::string>{"manifest.json", "proxies/00.glb", "index.bin", "tables.bin", "mesh/s09.glb",
                                "proxies/01.glb", "proxies/02.glb", "about.json", "mesh/s00.glb"}));
  // Untextured: meshes from coarse to fine.
  EXPECT_EQ(
      streaming_order({"mesh/s00.glb", "mesh/s02.glb", "mesh/s01.glb", "provenance.json", "manifest.json"}),
      (std::vector<std::string>{"manifest.json", "mesh/s02.glb", "mesh/s01.glb", "mesh/s00.glb",
                                "provenance.json"}));
}

}  // namespace texmesh::layout_test
