#include "lab/experiment/make_experiment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "format/base/errors.h"

#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"

namespace texmesh::make_experiment_test {

namespace fs = std::filesystem;

ExperimentOptions small_options() {
  ExperimentOptions o;
  o.title = "a < b", o.consent = "c";
  o.sizes_px = {24};
  o.levels = {0.1, 0.2, 0.3};
  o.objects = 2, o.repeats = 2, o.catches = 1, o.views = 2;
  return o;
}

Experiment made(const ExperimentOptions& options, int threads = 1) {
  return make_experiment(options, shape_stimuli(options), RunContext{threads, {}, nullptr});
}

std::string text_of(const Experiment& e, const std::string& path) {
  for (const ExperimentFile& f : e.files)
    if (f.path == path) return {f.bytes.begin(), f.bytes.end()};
  return "";
}

Pixels picture(const Experiment& e, const std::string& name) {
  for (const ExperimentFile& f : e.files)
    if (f.path == "stimuli/" + name)
      return decode_image(probe_image(name, f.bytes, {}), FloatEncoding::kSrgb);
  return {};
}

TEST(MakeExperiment, PicturesShowWhatTheTrialsSay) {
  const Experiment e = made(small_options());
  const std::uint32_t side = e.design.conditions[0].frame_px;
  for (const ExperimentTrial& t : e.design.trials) {
    const Pixels reference = picture(e, t.reference), same = picture(e, t.same),
                 changed = picture(e, t.changed);
    EXPECT_EQ(reference.width_px, 2 * side);
    EXPECT_EQ(reference.height_px, side);
    EXPECT_EQ(reference.data, same.data);
    EXPECT_EQ(changed.width_px, reference.width_px);
    EXPECT_NE(reference.data, changed.data);
    EXPECT_NE(reference.data, std::vector<std::uint8_t>(reference.data.size(), reference.data[0]));
  }
}

TEST(MakeExperiment, AMovedObjectShrinksFromPlaceToPlace) {
  ExperimentOptions o = small_options();
  o.move = true, o.sizes_px = {64}, o.objects = 1, o.views = 1;
  const Experiment e = made(o);
  ASSERT_EQ(e.design.conditions.size(), kPlaces);
  EXPECT_EQ(e.design.conditions[kPlacesAnOctave].displayed_px, 32);
  EXPECT_EQ(e.design.conditions.back().displayed_px, 4);
  for (const ExperimentTrial& t : e.design.trials) {
    const Pixels reference = picture(e, t.reference);
    ASSERT_EQ(t.moved.size(), kPlaces);
    for (std::size_t place = 0; place < kPlaces; place += kPlacesAnOctave)
      EXPECT_EQ(picture(e, t.moved[place]).height_px, e.design.conditions[place].frame_px);
    EXPECT_EQ(picture(e, t.moved[0]).data == reference.data, t.is_catch);
  }
}

TEST(MakeExperiment, FilesTellNothingByTheirLength) {
  const Experiment e = made(small_options());
  std::vector<std::size_t> lengths;
  std::vector<std::vector<std::uint8_t>> all;
  for (const ExperimentFile& f : e.files)
    if (f.path.starts_with("stimuli/")) lengths.push_back(f.bytes.size()), all.push_back(f.bytes);
  ASSERT_GT(lengths.size(), 5u);
  EXPECT_EQ(std::ranges::count(lengths, lengths[0]), static_cast<std::ptrdiff_t>(lengths.size()));
  std::ranges::sort(all);
  EXPECT_EQ(std::ranges::adjacent_find(all), all.end());  // the same picture twice is not the same file
}

TEST(MakeExperiment, DisplayedSizeIsTheObjectsLongestSide) {
  ExperimentOptions o = small_options();
  o.sizes_px = {100};
  o.kind = StimulusKind::kEllipsoids;
  o.objects = 1, o.views = 4;
  const Experiment e = made(o);
  const Pixels strip = picture(e, e.design.trials[0].reference);
  const std::uint32_t side = e.design.conditions[0].frame_px;
  std::uint32_t longest = 0;
  for (std::uint32_t v = 0; v < 4; ++v) {
    std::uint32_t least[2] = {side, side}, most[2] = {0, 0};
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        if (std::equal(strip.at(v * side + x, y), strip.at(v * side + x, y) + 3, strip.at(0, 0))) continue;
        least[0] = std::min(least[0], x), most[0] = std::max(most[0], x);
        least[1] = std::min(least[1], y), most[1] = std::max(most[1], y);
      }
    longest = std::max({longest, most[0] + 1 - least[0], most[1] + 1 - least[1]});
  }
  EXPECT_NEAR(longest, 100, 12);  // in perspective, and from above
}

TEST(MakeExperiment, ThePageIsStrictAndEscapesText) {
  ExperimentOptions o = small_options();
  o.post_url = "https://example.org:8443/some/where?x=1";
  const std::string page = text_of(made(o), "index.html");
  EXPECT_TRUE(page.starts_with(kExperimentFirstLine));
  EXPECT_NE(page.find("connect-src 'self' https://example.org:8443;"), std::string::npos);
  EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
  EXPECT_NE(page.find("<title>a &lt; b</title>"), std::string::npos);
  EXPECT_EQ(page.find("{{"), std::string::npos);
  EXPECT_EQ(page.find("style=\""), std::string::npos);  // the policy would refuse it
  o.post_url = "/submit";
  EXPECT_NE(text_of(made(o), "index.html").find("connect-src 'self';"), std::string::npos);
  for (const char* file :
       {"experiment.css", "experiment.js", "display.js", "trial.js", "results.js", "icon.svg"})
    EXPECT_FALSE(text_of(made(o), file).empty()) << file;
}

TEST(MakeExperiment, SameBytesForAnyThreads) {
  const Experiment one = made(small_options(), 1), many = made(small_options(), 8);
  ASSERT_EQ(one.files.size(), many.files.size());
  for (std::size_t k = 0; k < one.files.size(); ++k) {
    EXPECT_EQ(one.files[k].path, many.files[k].path);
    EXPECT_EQ(one.files[k].bytes, many.files[k].bytes) << one.files[k].path;
  }
}

TEST(MakeExperiment, RefusesPicturesThatBrowsersDoNotDecode) {
  ExperimentOptions o = small_options();
  o.sizes_px = {1500};
  o.views = 24;
  try {
    made(o);
    FAIL() << "made";
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "--views");
  }
}

TEST(MakeExperiment, NeverReplacesAnything) {
  const fs::path folder = fs::temp_directory_path() / "texmesh_make_experiment_test";
  fs::remove_all(folder);
  const Experiment e = made(small_options());
  write_experiment(e, folder.string());
  EXPECT_TRUE(fs::exists(folder / "index.html"));
  EXPECT_TRUE(fs::exists(folder / "stimuli" / e.design.trials[0].same));
  EXPECT_THROW(write_experiment(e, folder.string()), InputError);
  EXPECT_THROW(check_experiment_folder(folder.string()), InputError);
  fs::remove_all(folder);
}

TEST(PaddedPng, IsAsLongAsAskedAndShowsTheSame) {
  const Pixels pixels{3, 2, 3, {1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 8, 7, 6, 5, 4, 3, 2, 1}};
  const std::vector<std::uint8_t> png = write_png(pixels);
  for (const std::size_t more : {12u, 13u, 500u}) {
    const std::vector<std::uint8_t> padded = padded_png(png, png.size() + more, 3);
    EXPECT_EQ(padded.size(), png.size() + more);
    EXPECT_EQ(decode_image(probe_image("x.png", padded, {}), FloatEncoding::kSrgb).data, pixels.data);
  }
}

}  // namespace texmesh::make_experiment_test
