#include <cmath>
#include <functional>
#include <tuple>

#include "delivery/cpp/decide/texture_budget.h"
#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "format/rules/proxy_choice.h"
#include "tests/delivery/by_credit.h"
#include "tests/delivery/vector_decisions.h"

namespace texmesh::vectors_decisions_test {

Json upgrades() {
  Json cases = Json::array();
  for (const bool incremental : {false, true}) {
    const auto offers = vector_offers(16, 5, 60);
    std::vector<std::int32_t> rungs;
    for (std::size_t i = 0; i < offers.size(); ++i) rungs.push_back(static_cast<std::int32_t>(i % 6) - 1);
    Json order = Json::array();
    for (const Upgrade& u : upgrades_in_order(offers, rungs, incremental))
      order.push_back({u.offer, u.rung, u.bytes, u.gain_per_byte});
    cases.push_back({{"name", incremental ? "incremental rungs" : "independent rungs"},
                     {"incremental", incremental},
                     {"offers", offers_json(offers)},
                     {"rungs", rungs},
                     {"offer_rung_bytes_gain", order}});
  }
  return cases;
}

Json proxies() {
  Json cases = Json::array();
  const auto add = [&](const char* name, const std::vector<double>& sizes,
                       std::vector<ManifestProxy> proxies) {
    Manifest m;
    m.proxy_sizes_px = sizes;
    m.proxies = std::move(proxies);
    Json listed = Json::array(), answers = Json::array();
    for (std::size_t k = 0; k < m.proxies.size(); ++k) {
      const ManifestProxy& p = m.proxies[k];
      listed.push_back({{"offset", p.glb.offset},
                        {"bytes", p.glb.bytes},
                        {"flip", p.flip},
                        {"flip_p95", p.flip_p95},
                        {"bytes_beyond_start", proxy_bytes_beyond_start(m, k)}});
    }
    for (const double px : {0.0, 1.0, 60.0, 128.0, 200.0, 256.0, 300.5, 511.0, 512.0, 700.0, 1e4, 1e9}) {
      Json losses = Json::array();
      for (std::size_t k = 0; k < m.proxies.size(); ++k) {
        const ProxyLoss loss = proxy_loss(m, k, px);
        losses.push_back({loss.flip, loss.flip_p95});
      }
      const auto serving = serving_proxy(m, px);
      answers.push_back({px, losses, serving ? Json(*serving) : Json(-1)});
    }
    cases.push_back(
        {{"name", name}, {"sizes_px", sizes}, {"proxies", listed}, {"px_losses_serving", answers}});
  };
  const auto proxy = [](std::uint64_t offset, std::uint64_t bytes, std::vector<double> flip,
                        std::vector<double> p95) {
    return ManifestProxy{{"", offset, bytes, {}}, 1, 1, 0, std::move(flip), std::move(p95)};
  };
  add("three sizes", {128, 256, 512},
      {proxy(8192, 20000, {0.06, 0.09, 0.17}, {0.2, 0.3, 0.45}),
       proxy(40000, 45056, {0.03, 0.05, 0.11}, {0.1, 0.16, 0.3}),
       proxy(200000, 150000, {0.02, 0.03, 0.048}, {0.07, 0.1, 0.15})});
  add("one size", {300}, {proxy(8192, 36000, {0.05}, {0.15})});
  add("none", {}, {});
  return cases;
}

/// Three proxies before a package of some 5 MB with two scales besides the coarsest.
Manifest stepped_manifest() {
  Manifest m;
  m.proxy_sizes_px = {128, 512};
  m.proxies = {{{"", 4096, 20000, {}}, 800, 900, 192, {0.25, 0.34}, {0.5, 0.7}},
               {{"", 260000, 50000, {}}, 2000, 2100, 224, {0.16, 0.24}, {0.3, 0.5}},
               {{"", 310000, 150000, {}}, 8000, 7000, 416, {0.09, 0.13}, {0.2, 0.3}}};
  m.index = {{"", 26000, 4000, {}}, 700, {}};
  m.tables = {{"", 52000, 27000, {}}, 600, {}};
  m.provenance = {"", 5'000'000, 2800, {}};
  for (const auto& [scale, bytes, offset] :
       {std::tuple{0, 300000, 600000}, {5, 160000, 900000}, {16, 90000, 170000}}) {
    ManifestScale s;
    s.scale = scale;
    s.glb = {"", static_cast<std::uint64_t>(offset), static_cast<std::uint64_t>(bytes), {}};
    m.scales.push_back(s);
  }
  return m;
}

Json proxy_steps() {
  const Manifest m = stepped_manifest();
  Json entry{{"name", "on the way to a scale"},
             {"sizes_px", m.proxy_sizes_px},
             {"document_bytes", document_bytes(m)}};
  const auto range = [](const EntryRef& e) { return Json{{"offset", e.offset}, {"bytes", e.bytes}}; };
  for (const ManifestProxy& p : m.proxies) {
    entry["proxies"].push_back(range(p.glb));
    entry["proxies"].back().update({{"flip", p.flip}, {"flip_p95", p.flip_p95}});
  }
  for (const ManifestScale& s : m.scales) {
    entry["scales"].push_back(range(s.glb));
    entry["scales"].back()["scale"] = s.scale;
  }
  entry["index"] = range(m.index), entry["tables"] = range(m.tables),
  entry["provenance"] = range(m.provenance);
  for (const int wanted : {0, 5, 16})
    for (const double px : {100.0, 600.0})
      for (const double bytes_s : {1e4, 3e4, 1e5, 2.5e5, 1e6, 2e7})
        for (const double left_s : {0.0, 0.7, 4.5, 12.0}) {
          const auto step = proxy_step(m, wanted, px, {bytes_s, 0.04, left_s});
          entry["wanted_px_bytes_s_left_s_step"].push_back(
              {wanted, px, bytes_s, left_s, step ? Json(*step) : Json(-1)});
        }
  return entry;
}

/// Blocks of 4 x 4 texels of a texture with all its mip levels: the browser client alone stores textures so.
std::uint64_t blocks_of(std::uint32_t width_px, std::uint32_t height_px) {
  std::uint64_t blocks = 0;
  for (std::uint32_t longest = std::max(width_px, height_px), level = 0; longest > 0; longest >>= 1, ++level)
    blocks +=
        (std::max(1u, width_px >> level) + 3) / 4 * std::uint64_t{(std::max(1u, height_px >> level) + 3) / 4};
  return blocks;
}

/// [width, height, RGBA, blocks of 8 bytes, of 16] and [vertices, triangles, bytes].
Json gpu_sizes() {
  Json textures = Json::array(), meshes = Json::array();
  for (const auto& [w, h] :
       {std::pair{0u, 0u}, {1u, 1u}, {5u, 3u}, {256u, 256u}, {1000u, 3u}, {4096u, 2048u}})
    textures.push_back({w, h, gpu_texture_bytes(w, h), 8 * blocks_of(w, h), 16 * blocks_of(w, h)});
  for (const auto& [v, t] : {std::pair{0u, 0u}, {3u, 1u}, {71831u, 98516u}})
    meshes.push_back({v, t, gpu_mesh_bytes(v, t)});
  return {{"name", "bytes on the GPU"}, {"textures", textures}, {"meshes", meshes}};
}

TEST(Vectors, Proxies) {
  Json cases = proxies();
  cases.push_back(proxy_steps());
  cases.push_back(gpu_sizes());
  expect_file("proxies.json",
              "FLIP of proxies by displayed height, the smallest one that is enough, the larger one on the "
              "way to a scale; bytes on the GPU",
              cases);
}
TEST(Vectors, StepsAreTakenOnSlowLinksAlone) {
  const Manifest m = stepped_manifest();
  EXPECT_TRUE(proxy_step(m, 0, 600, {2.5e5, 0.04, 12}));    // 2 Mbit/s
  EXPECT_FALSE(proxy_step(m, 0, 600, {2.5e5, 0.04, 4.5}));  // the last picture would be worse
  EXPECT_FALSE(proxy_step(m, 0, 600, {2e7, 0.04, 12}));     // scales are there as soon
  EXPECT_FALSE(proxy_step(m, 0, 600, {1e4, 0.04, 0.7}));    // no proxy comes in the time
  EXPECT_FALSE(proxy_step(m, 0, 600, {2.5e5, 0.04, 0}));
  Manifest same = m;
  for (ManifestProxy& p : same.proxies) p.flip = {0.2, 0.2};
  EXPECT_FALSE(proxy_step(same, 0, 600, {2.5e5, 0.04, 12}));  // none looks better
}
TEST(Vectors, HarmonicTime) {
  expect_cases("harmonic-time.json", harmonic_time(by_credit), [](Json& c) {
    c["result"].erase("theorem");
    const Json& o = c["options"];
    VectorOptions options{o["policy"], o["order"], o["throughput"]["estimator"]};
    return by_credit(options);
  });
}
TEST(Vectors, Throughput) {
  const auto last = [](const std::string& estimator, int) -> Estimate {
    if (estimator != "last") return {};
    return [](double bytes, double seconds, Throughput& t) {
      t.add(bytes, seconds);
      return t.recent_bytes_s(1);
    };
  };
  expect_cases("throughput.json", throughput(last),
               [](Json& c) { return c["options"]["estimator"] == "last"; });
}
TEST(Vectors, Upgrades) {
  expect_file("upgrades.json", "upgrades_in_order: offer, rung, bytes, gain per byte", upgrades());
}
TEST(Vectors, PortableMath) {
  expect_cases("portable-math.json", portable_math(),
               [](Json& c) { return c["name"] != "acuity" && c["name"] != "gaze_weight"; });
}

}  // namespace texmesh::vectors_decisions_test
