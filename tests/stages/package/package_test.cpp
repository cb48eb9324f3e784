#include "stages/package/package.h"

#include <gtest/gtest.h>

#include "tests/stages/package/package_inputs.h"

namespace texmesh::package_test {

using namespace testing;  // NOLINT: fixtures

TEST(Package, ThePosterStandsBehindTheTables) {
  Inputs inputs(1);
  EXPECT_FALSE(manifest_of(inputs.assemble()).poster);
  inputs.poster = {fake_jpeg(900, 'x'), 512, 512};
  const Bytes package = inputs.assemble();
  const Manifest m = manifest_of(package);
  ASSERT_TRUE(m.poster);
  EXPECT_EQ(part(package, *m.poster), inputs.poster.file);
  EXPECT_EQ(m.poster->width_px, 512u);
  const std::vector<EntryRef> index = read_index(part(package, m.index));
  const auto poster = std::ranges::find(index, std::string(kPosterPath), &EntryRef::path);
  ASSERT_NE(poster, index.end());
  EXPECT_EQ(std::prev(poster)->path, kTablesPath);
}

TEST(Package, EveryReferenceLeadsToItsBytes) {
  for (const std::size_t planes : {0u, 1u, 3u}) {
    const Inputs inputs(planes);
    const Bytes package = inputs.assemble();
    const Manifest m = manifest_of(package);
    const std::vector<EntryRef> index = read_index(part(package, m.index));
    auto entries = read_container(*memory_source(package));
    std::erase_if(entries,
                  [](const ContainerEntry& e) { return e.path == kManifestPath || e.path == kIndexPath; });
    ASSERT_EQ(index.size(), entries.size());
    for (std::size_t i = 0; i < index.size(); ++i) {
      EXPECT_EQ(index[i].path, entries[i].path);
      EXPECT_EQ(index[i].offset, entries[i].offset);
      EXPECT_EQ(sha256(part(package, index[i])), index[i].digest) << index[i].path;
    }
    for (const EntryRef& ref : {static_cast<EntryRef>(m.index), static_cast<EntryRef>(m.tables), m.textures,
                                m.quality, m.provenance, m.scales[0].glb, m.scales[2].glb})
      EXPECT_EQ(sha256(part(package, ref)), ref.digest) << ref.path;
    for (const PagedRef& ref : {m.index, m.tables})
      EXPECT_EQ(sha256(memory_source(package)->read(ref.offset, ref.head_bytes)), ref.head_digest);
    EXPECT_EQ(part(package, m.provenance), (Bytes{'{', '"', 't', 'e', 'x', 'm', 'e', 's', 'h', '"', ':', '"',
                                                  't', 'e', 's', 't', '"', '}'}));
  }
}

TEST(Package, FilesForViewersOfGltfStandLastInAnIndexOfTheirOwn) {
  Inputs inputs(2);
  const Bytes without = inputs.assemble();
  inputs.gltf.files = {{gltf_image_path(1, 0), fake_jpeg(700, 'x')},
                       {gltf_scale_path(4), glb_container(R"({"asset":{}})", {})}};
  const Bytes package = inputs.assemble();
  const Manifest before = manifest_of(without), m = manifest_of(package);
  EXPECT_EQ(std::pair(before.minor, m.minor), std::pair(0, 1));
  EXPECT_FALSE(before.gltf);
  ASSERT_TRUE(m.gltf);
  EXPECT_EQ(m.index.bytes, before.index.bytes);
  std::vector<std::string> last;
  for (const auto& e : read_container(*memory_source(package)))
    if (e.offset > m.provenance.offset) last.push_back(e.path);
  EXPECT_EQ(last, (std::vector<std::string>{"gltf/001-r00.jpg", "gltf/index.bin", "gltf/s04.glb"}));
  const std::vector<EntryRef> files = read_gltf_index(part(package, *m.gltf));
  ASSERT_EQ(files.size(), 2u);
  for (std::size_t k = 0; k < files.size(); ++k) {
    EXPECT_EQ(files[k].path, inputs.gltf.files[k].path);
    EXPECT_EQ(part(package, files[k]), inputs.gltf.files[k].bytes);
    EXPECT_EQ(sha256(part(package, files[k])), files[k].digest);
  }
}

TEST(Package, OrderIsStreamingOrder) {
  std::vector<std::string> paths;
  for (const auto& e : read_container(*memory_source(Inputs(2).assemble()))) paths.push_back(e.path);
  EXPECT_EQ(paths, (std::vector<std::string>{"manifest.json", "mesh/s09.glb", "index.bin", "textures.json",
                                             "quality.json", "texture/0/tables.pack", "texture/1/tables.pack",
                                             "tables.bin", "about.json", "preview/000.jpg", "preview/001.jpg",
                                             "texture/0/r00.pack", "texture/1/r00.pack", "mesh/s04.glb",
                                             "texture/0/r01.pack", "texture/1/r01.pack", "mesh/s00.glb",
                                             "thesis.bin", "provenance.json"}));
  EXPECT_EQ(streaming_order(paths), paths);
}

TEST(Package, PacksHoldFragmentsByImportance) {
  const Inputs inputs(1);
  const Bytes package = inputs.assemble();
  const Manifest m = manifest_of(package);
  std::vector<TextureInfo> textures = read_textures(part(package, m.textures));
  resolve_textures(textures, read_index(part(package, m.index)));
  const PlaneTables t = read_tables(part(package, m.tables)).planes[0];
  EXPECT_EQ(t.order, inputs.tables.planes[0].order);
  for (std::size_t r = 0; r < 2; ++r) {
    const Bytes pack = part(package, textures[0].rungs[r]);
    std::size_t at = 0;
    for (const std::uint16_t f : t.order) {
      const std::size_t bytes = t.size_bytes[r * 6 + f];
      EXPECT_EQ(truncated(sha256(std::span(pack).subspan(at, bytes))), t.digest[r * 6 + f]);
      at += bytes;
    }
    EXPECT_EQ(at, pack.size());
  }
  EXPECT_EQ(textures[0].name, "wall.jpg");
  EXPECT_EQ(textures[0].colour_space, "srgb");
}

TEST(Package, ManifestDescribesTheModel) {
  const Manifest m = manifest_of(Inputs(1).assemble());
  ASSERT_EQ(m.scales.size(), 3u);
  EXPECT_EQ(m.scales[1].triangles, 96u);
  EXPECT_EQ(m.scales[1].error_max, 0.04);
  EXPECT_EQ(m.scales[1].p95, 0.05);
  EXPECT_EQ(m.scales[2].p99, 0.3);
  EXPECT_FALSE(m.scales[1].major);
  EXPECT_EQ(m.scales[0].display_px_edge, kAnyDisplayPx);
  EXPECT_EQ(m.origin, (Vec3d{5e6, 0, -5e6}));
  EXPECT_EQ(m.bounds_max.x - m.bounds_min.x, 2);
  // The finer of both rules: each scale up to the smaller of its two sizes.
  EXPECT_EQ(m.steps, (std::vector<ManifestStep>{{128, 9}, {512, 4}, {kAnyDisplayPx, 0}}));
}

TEST(Package, StepsLeaveOutScalesThatAreNeverTheAnswer) {
  Inputs inputs(0);
  inputs.quality.display_px_flip = {1e9f, 128, 181};  // S_4 accepts less than the coarser S_9
  EXPECT_EQ(manifest_of(inputs.assemble()).steps, (std::vector<ManifestStep>{{181, 9}, {kAnyDisplayPx, 0}}));
  inputs.quality.display_px_flip = {1e9f, 1024, 1024};
  EXPECT_EQ(manifest_of(inputs.assemble()).steps, (std::vector<ManifestStep>{{1024, 9}, {kAnyDisplayPx, 0}}));
  inputs.quality.display_px_flip = {1e9f, 0, 0};  // neither serves
  EXPECT_EQ(manifest_of(inputs.assemble()).steps, (std::vector<ManifestStep>{{kAnyDisplayPx, 0}}));
  inputs.quality.display_px_flip.pop_back();
  EXPECT_THROW(inputs.assemble(), StageError);
}

TEST(Package, DeterministicAndReproducedFromItsOwnEntries) {
  const Bytes package = Inputs(3).assemble();
  EXPECT_EQ(Inputs(3).assemble(), package);
  // pack: the same entries in index order give the same bytes.
  const auto source = memory_source(package);
  Bytes again;
  ContainerWriter writer(
      [&](std::span<const std::uint8_t> p) { again.insert(again.end(), p.begin(), p.end()); });
  std::vector<PackageEntry> files;
  for (const ContainerEntry& e : read_container(*source)) {
    writer.add(e.path, source->read(e.offset, e.bytes));
    files.push_back({e.path, source->read(e.offset, e.bytes)});
  }
  writer.finish();
  EXPECT_EQ(again, package);
  // write_package from parsed documents and shuffled files, too.
  const Manifest m = manifest_of(package);
  const auto textures = read_textures(part(package, m.textures));
  std::erase_if(files, [](const PackageEntry& e) {
    return e.path == kManifestPath || e.path == kIndexPath || e.path == kTexturesPath;
  });
  std::ranges::reverse(files);
  EXPECT_EQ(write_package(m, textures, files), package);
}

About about_of(const Bytes& package) { return read_about(part(package, manifest_of(package).about)); }

TEST(Package, AboutIsWhatTheSourceSaysWithThePublishersWordsOverIt) {
  Inputs inputs(1);
  for (ScaleFile& file : inputs.files.files) file.glb = glb_container(R"({"asset":{}})", {});
  inputs.about.title = "of the source";
  inputs.about.licence = "CC0-1.0";
  inputs.about.metres_per_unit = 1;
  inputs.about.unit = "metre";
  EXPECT_EQ(about_of(inputs.assemble()), inputs.about);
  EXPECT_EQ(manifest_of(inputs.assemble()).title, "of the source");
  inputs.options.meta = R"({"title":"of the museum","creator":"A. Smith"})";
  EXPECT_EQ(about_of(inputs.assemble()).title, "of the museum");
  EXPECT_EQ(about_of(inputs.assemble()).licence, "CC0-1.0");
  inputs.options.title = "of the command line";
  const Bytes package = inputs.assemble();
  EXPECT_EQ(about_of(package).title, "of the command line");
  EXPECT_EQ(about_of(package).creator, "A. Smith");
  EXPECT_EQ(manifest_of(package).title, "of the command line");
}

TEST(Package, TheFilesOfScalesSayWhatTheSourceSaysWhateverThePublisherAdds) {
  Inputs inputs(1);
  const std::string json = R"({"asset":{"version":"2.0"}})";
  for (ScaleFile& file : inputs.files.files) file.glb = glb_container(json, {});
  const Bytes silent = inputs.assemble();
  EXPECT_EQ(part(silent, manifest_of(silent).scales[0].glb), inputs.files.files[0].glb);
  inputs.about.attribution = "A. Smith";
  const auto first_glb = [&] {
    const Bytes package = inputs.assemble();
    return part(package, manifest_of(package).scales[0].glb);
  };
  const Bytes said = first_glb();
  const std::string text(said.begin(), said.end());
  EXPECT_NE(text.find(R"("copyright":"A. Smith")"), std::string::npos);
  inputs.options.meta = R"({"attribution":"B. Jones","licence":"CC-BY-4.0"})";
  EXPECT_EQ(first_glb(), said);
}

TEST(Package, HundredsOfPlanesStillBootstrapInOneRead) {
  const Bytes package = Inputs(220).assemble();
  const Manifest m = manifest_of(package);
  EXPECT_EQ(m.plane_count, 220u);
  EXPECT_EQ(read_index_head(part(package, m.index)).pages.size(), 221u);
}

/// Turns the last planes into mips 1 and 2 of plane 0.
Inputs inputs_with_mips(std::size_t full) {
  Inputs inputs(full + 2);
  for (std::uint32_t mip : {1u, 2u}) {
    const std::size_t p = full + mip - 1;
    TexturePlane& plane = inputs.fragments.planes[p];
    plane.image = 0;
    plane.mip = mip;
    plane.base = 0;
    plane.width_px = 760 >> mip;
    plane.height_px = 500 >> mip;
    plane.fragment_width_px = plane.fragment_height_px = mip == 1 ? 128 : 64;
    plane.fragment_height_px = mip == 1 ? 128 : 64;
    inputs.previews.planes[p].file.clear();
  }
  return inputs;
}

TEST(Package, TablesHaveTheRowsOfTheStoredScales) {
  const Inputs inputs(2);
  const Bytes package = inputs.assemble();
  const Manifest m = manifest_of(package);
  const PackageTables tables = read_tables(part(package, m.tables));
  const std::vector<float>& all = inputs.tables.planes[1].quality;
  EXPECT_EQ(tables.planes[1].quality, (std::vector<float>{all[0], all[4], all[9]}));
  ASSERT_TRUE(m.thesis.has_value());
  EXPECT_EQ(read_thesis(part(package, *m.thesis)).tables.planes[1].quality, all);
  EXPECT_GT(m.thesis->offset, m.scales.back().glb.offset);
  const Bytes untextured = Inputs(0).assemble();
  const ThesisTables none = read_thesis(part(untextured, *manifest_of(untextured).thesis)).tables;
  EXPECT_TRUE(none.planes.empty());
  EXPECT_FALSE(none.perceptual.empty());

  Inputs few(1);
  few.tables.planes[0] = select_scales(few.tables, {0, 1, 2, 3}).planes[0];
  EXPECT_THROW(few.assemble(), StageError);
}

TEST(Package, MipsShareTheirBasesPreview) {
  const Bytes package = inputs_with_mips(2).assemble();
  const Manifest m = manifest_of(package);
  EXPECT_TRUE(m.required_features.empty());
  EXPECT_EQ(m.plane_count, 4u);
  std::vector<TextureInfo> textures = read_textures(part(package, m.textures));
  const auto index = read_index(part(package, m.index));
  resolve_textures(textures, index);
  EXPECT_EQ(textures[3].preview, textures[0].preview);
  EXPECT_EQ(textures[3].mip, 2u);
  EXPECT_TRUE(std::ranges::none_of(index, [](const EntryRef& e) { return e.path == preview_path(2); }));
  EXPECT_LE(textures[3].tables.offset + textures[3].tables.bytes, m.tables.offset);

  Inputs wrong = inputs_with_mips(1);
  wrong.fragments.planes[1].base = 1;
  EXPECT_THROW(wrong.assemble(), StageError);
  wrong = inputs_with_mips(1);
  wrong.previews.planes[1].file = fake_jpeg(30, 'p');
  EXPECT_THROW(wrong.assemble(), StageError);
}

TEST(Package, HundredsOfPlanesWithMipsStillBootstrapInOneRead) {
  const Manifest m = manifest_of(inputs_with_mips(300).assemble());
  EXPECT_EQ(m.plane_count, 302u);
}

TEST(Package, SourcesStandBehindTheRungsAndRungsOfSourcesAreNamed) {
  Inputs inputs(2);
  inputs.images[0].bytes = {1, 2, 3};
  inputs.images[0].format = ImageFormat::kTiff;
  inputs.ladder.planes[0].source = SourceFile::kOtherColours;
  inputs.ladder.planes[1].source_rung = true;
  const Bytes package = inputs.assemble();
  const Manifest m = manifest_of(package);
  EXPECT_TRUE(m.required_features.empty());
  auto textures = read_textures(part(package, m.textures));
  const std::vector<EntryRef> index = read_index(part(package, m.index));
  resolve_textures(textures, index);
  EXPECT_EQ(textures[0].source.path, "source/000.tif");
  EXPECT_FALSE(textures[0].source_colours);
  EXPECT_FALSE(textures[0].source_rung);
  EXPECT_TRUE(textures[1].source_rung);
  EXPECT_EQ(textures[1].source_extension, "");
  EXPECT_EQ(part(package, textures[0].source), (Bytes{1, 2, 3}));
  EXPECT_EQ(index[index.size() - 3].path, "source/000.tif");
  EXPECT_EQ(index[index.size() - 2].path, kThesisPath);
  EXPECT_EQ(index.back().path, kProvenancePath);
  // On the page of the index that belongs to no plane.
  const Bytes bytes = part(package, m.index);
  const IndexHead head = read_index_head(bytes);
  const auto page = read_index_page(head, 0, std::span(bytes).subspan(head.bytes, head.pages[0].bytes));
  EXPECT_TRUE(std::ranges::any_of(page, [](const EntryRef& e) { return e.path == "source/000.tif"; }));
}

}  // namespace texmesh::package_test
