// One broken package per rule, caught by that rule: documents, index and tables.
#include <gtest/gtest.h>

#include <algorithm>

#include "format/container/layout.h"
#include "stages/data/fragments.h"
#include "tests/support/images.h"
#include "tests/tools/inspect/verify/verify_support.h"

namespace texmesh::verify_test {

TEST(Verify, ASoundPackageHasNoFindings) {
  const Bytes package = make_package_parts().build();
  const VerifyReport report = verify(package);
  EXPECT_EQ(all_of(report), "");
  EXPECT_EQ(report.meshes, 2u);
  EXPECT_EQ(report.previews, 1u);
  EXPECT_EQ(report.fragments, 6u);
  EXPECT_EQ(report.entries, 14u);
}

Bytes with_proxies(const std::function<void(PackageParts&)>& change) {
  return built_with([&](PackageParts& p) {
    testing::add_proxies(p);
    change(p);
  });
}

TEST(Verify, ASoundPackageWithProxiesHasNoFindings) {
  const VerifyReport report = verify(with_proxies([](PackageParts&) {}));
  EXPECT_EQ(all_of(report), "");
  EXPECT_EQ(report.meshes, 4u);
}

TEST(Verify, Proxies) {
  const auto caught = [](const std::string& check, const std::function<void(PackageParts&)>& change) {
    return catches_only(with_proxies(change), check, proxy_path(1));
  };
  EXPECT_TRUE(caught("mesh-counts", [](PackageParts& p) { ++p.manifest.proxies[1].triangles; }));
  EXPECT_TRUE(caught("mesh-counts", [](PackageParts& p) { ++p.manifest.proxies[1].vertices; }));
  EXPECT_TRUE(caught("mesh-images", [](PackageParts& p) { ++p.manifest.proxies[1].texture_px; }));
  EXPECT_TRUE(caught("mesh-bounds", [](PackageParts& p) {
    Mesh large = testing::fine_mesh();
    for (Vec3f& v : large.positions) v.x *= 1.1f;
    p.proxies[1] = testing::make_glb(large, p.streams[preview_path(0)]).glb();
  }));
  EXPECT_TRUE(caught("glb-reference", [](PackageParts& p) {
    GlbParts named = testing::make_glb(testing::fine_mesh(), p.streams[preview_path(0)]);
    testing::name_previews(named);  // a proxy stands alone
    p.proxies[1] = named.glb();
  }));
  EXPECT_TRUE(caught("glb-container", [](PackageParts& p) { p.proxies[1].resize(p.proxies[1].size() - 4); }));
  // The digest is that of the bytes, the place that of the index.
  const PackageParts sound = parts_with([](PackageParts& p) { testing::add_proxies(p); });
  EXPECT_TRUE(
      catches(PackagePatcher(sound.build()).edit(proxy_path(0), [](Bytes& b) { b.back() ^= 1; }).package(),
              "entry-digest", proxy_path(0)));
  EXPECT_TRUE(catches(
      PackagePatcher(sound.build()).seal([](Manifest& m) { m.proxies[0].glb.digest.fill(1); }).package(),
      "reference", kManifestPath));
  EXPECT_TRUE(catches(PackagePatcher(sound.build()).seal([](Manifest& m) { m.proxies.pop_back(); }).package(),
                      "entry-set", proxy_path(1)));
}

TEST(Verify, ThePatcherItselfKeepsAPackageSound) {
  EXPECT_EQ(all_of(verify(PackagePatcher(make_package_parts().build()).seal().package())), "");
}

TEST(Verify, UntexturedPackage) {
  const Bytes package = built_with([](PackageParts& p) {
    p.textures.clear();
    p.streams.clear();
    p.tables.planes.clear();
    p.thesis.planes.clear();
    p.quality.groups.clear();
    p.manifest.plane_count = 0;
    p.meshes[0] = testing::make_glb(testing::fine_mesh(), {}).glb();
    p.meshes[5] = testing::make_glb(testing::coarse_mesh(), {}).glb();
  });
  EXPECT_EQ(all_of(verify(package)), "");
}

TEST(Verify, SameFindingsForAnyThreads) {
  const Bytes package = PackagePatcher(make_package_parts().build())
                            .edit(rung_path(0, 1),
                                  [](Bytes& b) {
                                    for (std::size_t i = 40; i < b.size(); i += 50) b[i] ^= 0x55;
                                  })
                            .package();
  EXPECT_GT(verify(package, 1).findings.size(), 2u);
  EXPECT_EQ(verify(package, 1).findings, verify(package, 8).findings);
}

// Container and index

TEST(Verify, Container) {
  Bytes package = make_package_parts().build();
  package.push_back(0);
  EXPECT_TRUE(catches_only(package, "container", ""));
  for (const std::size_t keep : {std::size_t{0}, std::size_t{100}, package.size() / 2, package.size() - 2})
    EXPECT_TRUE(
        catches(Bytes(package.begin(), package.begin() + static_cast<std::ptrdiff_t>(keep)), "container", ""))
        << keep;
}

TEST(Verify, Manifest) {
  EXPECT_TRUE(catches_only(PackagePatcher(make_package_parts().build())
                               .edit(kManifestPath, [](Bytes& b) { b[0] = '['; })
                               .package(),
                           "manifest", kManifestPath));
  EXPECT_TRUE(catches_only(sealed_with([](Manifest& m) { m.object_height = 3; }), "manifest", kManifestPath));
}

TEST(Verify, Index) {
  EXPECT_TRUE(catches(PackagePatcher(make_package_parts().build())
                          .edit(kIndexPath, [](Bytes& b) { b[b.size() - 3] ^= 1; })
                          .package(),
                      "index", kIndexPath));
  EXPECT_TRUE(catches_only(sealed_with([](Manifest& m) { m.index.head_digest[3] ^= 1; }), "reference",
                           kManifestPath));
}

TEST(Verify, EntryDigest) {
  for (const std::string& path :
       {mesh_path(0), mesh_path(5), preview_path(0), rung_path(0, 1), table_streams_path(0),
        std::string(kTablesPath), std::string(kTexturesPath), std::string(kQualityPath),
        std::string(kAboutPath), std::string(kProvenancePath)})
    EXPECT_TRUE(catches(PackagePatcher(make_package_parts().build())
                            .edit(path, [](Bytes& b) { b[b.size() / 2] ^= 4; })
                            .package(),
                        "entry-digest", path))
        << path;
}

TEST(Verify, EntryCrc) {
  Bytes package = make_package_parts().build();
  const auto source = memory_source(package);
  const auto entries = read_container(*source);
  package[entries.back().offset + 5] ^= 0x10;
  EXPECT_TRUE(catches(package, "entry-crc", entries.back().path));
}

/// The package with its entries in another order or with others among them; digests and offsets fit.
Bytes rearranged(const std::function<void(std::vector<std::pair<std::string, Bytes>>&)>& change,
                 bool reindex) {
  const Bytes package = built_with([](PackageParts& p) { p.thesis = {}; });
  PackagePatcher old(package);
  std::vector<std::pair<std::string, Bytes>> entries;
  const auto source = memory_source(package);
  for (const ContainerEntry& e : read_container(*source)) entries.emplace_back(e.path, old.entry(e.path));
  change(entries);
  Bytes out;
  ContainerWriter writer([&](std::span<const std::uint8_t> b) { out.insert(out.end(), b.begin(), b.end()); });
  for (const auto& [path, bytes] : entries) writer.add(path, bytes);
  writer.finish();
  if (!reindex) return out;
  PackagePatcher patcher(out);
  const auto at = [&](const std::string& path) {
    return std::find_if(writer.entries().begin(), writer.entries().end(),
                        [&](const ContainerEntry& e) { return e.path == path; })
        ->offset;
  };
  patcher.seal_index([&](std::vector<EntryRef>& index) {
    for (EntryRef& e : index) e.offset = at(e.path);
    std::sort(index.begin(), index.end(),
              [](const EntryRef& a, const EntryRef& b) { return a.offset < b.offset; });
  });
  return patcher
      .seal([&](Manifest& m) {
        m.provenance.offset = at(kProvenancePath);
        m.scales[0].glb.offset = at(mesh_path(0));
      })
      .package();
}

TEST(Verify, EntrySet) {
  EXPECT_TRUE(catches_only(
      rearranged([](auto& entries) { entries.emplace_back("notes.txt", Bytes(10, 'x')); }, false),
      "entry-set", "notes.txt"));
  EXPECT_TRUE(
      catches(rearranged([](auto& entries) { entries.pop_back(); }, false), "entry-set", kProvenancePath));
  EXPECT_TRUE(catches(sealed_with([](Manifest& m) { m.quality.bytes -= 1; }), "entry-set", kQualityPath));
}

TEST(Verify, EntryOrder) {
  const Bytes package = rearranged(
      [](auto& entries) { std::swap(entries[entries.size() - 1], entries[entries.size() - 2]); }, true);
  EXPECT_TRUE(catches_only(package, "entry-order", kIndexPath));
}

TEST(Verify, Bootstrap) {
  EXPECT_TRUE(
      catches(rearranged([](auto& entries) { std::swap(entries[0], entries[1]); }, false), "bootstrap", ""));
}

TEST(Verify, EntryUnknown) {
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.streams["extra.bin"] = Bytes(5, 1); }),
                           "entry-unknown", "extra.bin"));
}

void keep_source(PackageParts& p, const Bytes& image) {
  p.textures[0].source_extension = "png";
  p.streams[source_path(0, "png")] = image;
}

TEST(Verify, Source) {
  EXPECT_EQ(
      all_of(verify(built_with([](PackageParts& p) { keep_source(p, testing::png_bytes(64, 48, 3)); }))), "");
  const std::string path = source_path(0, "png");
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { keep_source(p, testing::png_bytes(64, 47, 3)); }),
                           "source", path));
  EXPECT_TRUE(catches_only(
      built_with([](PackageParts& p) { keep_source(p, testing::jpeg_bytes(64, 48, 3)); }), "source", path));
  Bytes cut = testing::png_bytes(64, 48, 3);
  cut.resize(cut.size() / 2);
  EXPECT_TRUE(catches_only(built_with([&](PackageParts& p) { keep_source(p, cut); }), "source", path));
  EXPECT_TRUE(catches_only(
      built_with([](PackageParts& p) { p.streams[source_path(0, "png")] = testing::png_bytes(64, 48, 3); }),
      "entry-set", path));
}

TEST(Verify, References) {
  EXPECT_TRUE(
      catches(sealed_with([](Manifest& m) { m.quality.digest[0] ^= 1; }), "reference", kManifestPath));
  EXPECT_TRUE(
      catches(sealed_with([](Manifest& m) { m.tables.head_digest[0] ^= 1; }), "reference", kManifestPath));
  EXPECT_TRUE(
      catches_only(sealed_with([](Manifest& m) { m.scales[0].glb.bytes -= 1; }), "reference", kManifestPath));
}

// Figures of the manifest

TEST(Verify, ScalesAndSteps) {
  EXPECT_TRUE(
      catches_only(sealed_with([](Manifest& m) { m.scales[1].error_rms = 0.5; }), "scale", kManifestPath));
  EXPECT_TRUE(
      catches_only(sealed_with([](Manifest& m) { m.steps[0].up_to_px = 201; }), "step", kManifestPath));
  EXPECT_TRUE(catches_only(sealed_with([](Manifest& m) { m.scales[1].display_px_flip = 150; }), "step",
                           kManifestPath));
}

// Documents

TEST(Verify, Textures) {
  EXPECT_TRUE(catches(sealed_with([](Manifest& m) { m.plane_count = 0; }), "textures", kTexturesPath));
  EXPECT_TRUE(catches(PackagePatcher(make_package_parts().build())
                          .edit(kTexturesPath, [](Bytes& b) { b[2] = 'x'; })
                          .seal()
                          .package(),
                      "textures", kTexturesPath));
}

TEST(Verify, TablesAgainstTextures) {
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) {
                             p.textures[0].fragment_width_px = 64;
                             p.textures[0].columns = 1;
                           }),
                           "tables-grid", kTablesPath));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) {
                        p.textures[0].rung_quality = {20, 71};
                      }),
                      "tables-rungs", kTablesPath));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) {
                        p.tables = select_scales(p.tables, {0});
                        p.thesis = {};
                      }),
                      "tables-scales", kTablesPath));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) { p.tables.planes[0].size_bytes[0] += 1; }),
                      "tables-size", rung_path(0, 0)));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) { p.tables.planes[0].table_bytes[1] += 1; }),
                      "tables-size", table_streams_path(0)));
}

TEST(Verify, Tables) {
  EXPECT_TRUE(catches(PackagePatcher(make_package_parts().build())
                          .edit(kTablesPath, [](Bytes& b) { b[b.size() - 9] ^= 1; })
                          .seal()
                          .package(),
                      "tables", kTablesPath));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) { p.tables.planes[0].covered_texels[0] = 0; }),
                      "tables-coverage", kTablesPath));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.tables.planes[0].covered_texels[1] = 1025; }),
                           "tables", kTablesPath));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.tables.planes[0].surface_fraction[1] = 0.9f; }),
                           "tables", kTablesPath));
  EXPECT_TRUE(catches(built_with([](PackageParts& p) {
                        std::swap(p.tables.planes[0].order[0], p.tables.planes[0].order[1]);
                      }),
                      "tables-order", kTablesPath));
}

TEST(Verify, ThesisTables) {
  const auto caught = [](const std::function<void(PackageParts&)>& change) {
    return catches_only(built_with(change), "thesis", kThesisPath);
  };
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.planes[0].total_bytes[5 * kGammaSteps + 3] += 1; }));
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.planes[0].quality[5] += 1; }));
  EXPECT_TRUE(caught([](PackageParts& p) {
    p.thesis.planes[0].quality.pop_back();
    p.thesis.planes[0].total_bytes.resize(5 * kGammaSteps);
  }));
  EXPECT_TRUE(caught([](PackageParts& p) {
    PlaneThesis& t = p.thesis.planes[0];
    for (auto* v : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp}) v->pop_back();
  }));
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.planes.push_back(p.thesis.planes[0]); }));
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.planes[0].models.pop_back(); }));
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.perceptual.p95[pair_index(6, 0, 5)] *= 1.001f; }));
  EXPECT_TRUE(caught([](PackageParts& p) { p.thesis.perceptual.scale[5] = 6; }));
  // Sizes of a scale that is not stored are the writer's; so is whether there is such an entry.
  EXPECT_EQ(
      all_of(verify(built_with([](PackageParts& p) { p.thesis.planes[0].total_bytes[kGammaSteps] += 1; }))),
      "");
  EXPECT_EQ(all_of(verify(built_with([](PackageParts& p) { p.thesis = {}; }))), "");
}

TEST(Verify, Quality) {
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) {
                             p.quality.scales = {0, 6};
                           }),
                           "quality", kQualityPath));
  EXPECT_TRUE(
      catches_only(built_with([](PackageParts& p) { p.quality.groups.clear(); }), "quality", kQualityPath));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.quality.geometry[0].flip[0] = 0.1f; }),
                           "quality", kQualityPath));
  EXPECT_TRUE(catches_only(sealed_with([](Manifest& m) { m.scales[1].display_px_flip = 400; }), "scale",
                           kManifestPath));
  EXPECT_TRUE(catches_only(PackagePatcher(make_package_parts().build())
                               .edit(kQualityPath, [](Bytes& b) { b[b.size() - 1] = ' '; })
                               .seal()
                               .package(),
                           "quality", kQualityPath));
}

TEST(Verify, Provenance) {
  for (const auto& change : std::vector<std::function<void(nlohmann::json&)>>{
           [](auto& j) { j["format"]["minor"] = 9; },
           [](auto& j) { j["options"]["package"]["title"] = "Another"; },
           [](auto& j) {
             j["options"]["ladder"]["rungs"] = {20, 71};
           },
           [](auto& j) { j["options"]["perceptual_values"]["jnd"] = 0.2; },
           [](auto& j) { j["inputs"] = nlohmann::json::array(); }, [](auto& j) { j["version"] = 2; }})
    EXPECT_TRUE(catches_only(built_with([&](PackageParts& p) { change(p.provenance); }), "provenance",
                             kProvenancePath));
}

TEST(Verify, About) {
  EXPECT_TRUE(catches(sealed_with([](Manifest& m) { m.title = "Another one"; }), "about", kManifestPath));
  const auto with_about = [](const std::string& json) {
    return rearranged(
        [&](auto& entries) {
          for (auto& [path, bytes] : entries)
            if (path == kAboutPath) bytes.assign(json.begin(), json.end());
        },
        false);
  };
  EXPECT_TRUE(catches(with_about("{]"), "about", kAboutPath));
  EXPECT_TRUE(catches(sealed_with([](Manifest& m) { m.about.offset += 64; }), "reference", kManifestPath));
  // The publisher's own members are nobody else's business.
  EXPECT_TRUE(verify_package(*open_container(memory_source(built_with([](PackageParts& p) {
                p.about.extras = R"({"shelf":[1,{"extensions":{"A_b":1}}]})";
              }))),
                             {})
                  .findings.empty());
}

}  // namespace texmesh::verify_test
