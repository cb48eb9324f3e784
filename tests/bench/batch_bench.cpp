// What a run over many models costs beside the models' own work, as ratios and bounds within one run:
//   batch_bench noop        1,000 models of which nothing has changed, against ninja's no-op over as many
//   batch_bench throughput  16 mixed models with one process and with two
//   batch_bench plan        a collection and a folder of 100,000 models, up to the first start
//   batch_bench small       models of 2,000 triangles and one texture of 512 px: models a second
#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

extern char** environ;

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

struct Cost {
  double wall_s = 0, cpu_s = 0, peak_mib = 0;  // the peak is that of the largest process beneath
};

double seconds(const timeval& t) {
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
}

/// Runs a program to its end, its output thrown away; the program ends when that one fails.
Cost run(std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  const auto start = Clock::now();
  pid_t pid = -1;
  int status = 0;
  rusage usage{};
  if (::posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environ) != 0 ||
      ::wait4(pid, &status, 0, &usage) != pid || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::fprintf(stderr, "%s failed\n", argv[0]);
    std::exit(1);
  }
  posix_spawn_file_actions_destroy(&actions);
  return {std::chrono::duration<double>(Clock::now() - start).count(),
          seconds(usage.ru_utime) + seconds(usage.ru_stime), static_cast<double>(usage.ru_maxrss) / 1024};
}

Cost median(std::vector<Cost> costs) {
  const auto by = [&](double Cost::*field) {
    std::sort(costs.begin(), costs.end(), [&](const Cost& a, const Cost& b) { return a.*field < b.*field; });
    return costs[costs.size() / 2].*field;
  };
  return {by(&Cost::wall_s), by(&Cost::cpu_s), by(&Cost::peak_mib)};
}

struct Settings {
  std::string texmesh = TEXMESH_BINARY, make_scan = TEXMESH_MAKE_SCAN, folder;
  int models = 0, repeat = 11;
};

/// Options under which a tiny model costs little more than its process.
std::string write_cheap_profile(const std::string& folder) {
  const std::string file = folder + "/profile.json";
  std::ofstream(file) << R"({"version":1,"skeletonization":{"alpha_divisor":5,"offset_divisor":50,
    "max_wrap_faces":100},"ssf":{"scales":2},"quality":{"views":1,"largest_px":128,"rung_samples":1},
    "ladder":{"rungs":[30]},"perceptual_values":{"samples":100},"scales":{"stream":false}})";
  return file;
}

void noop(const Settings& s) {
  const std::string in = s.folder + "/in", out = s.folder + "/out", cache = s.folder + "/cache",
                    copies = s.folder + "/ninja";
  fs::create_directories(copies);
  const std::string profile = write_cheap_profile(s.folder);
  run({s.make_scan, "--many", std::to_string(s.models), "--triangles", "48", "--texture", "16", "-o", in});
  std::ofstream rules(copies + "/build.ninja");
  rules << "rule copy\n  command = cp $in $out\n";
  int edges = 0;
  for (const auto& e : fs::directory_iterator(in))
    rules << "build " << e.path().stem().string() << ".texmesh: copy " << e.path().string() << "\n", ++edges;
  rules.close();
  const std::vector<std::string> texmesh{s.texmesh, "compile", in,          "-o",   out,
                                         "--cache", cache,     "--profile", profile},
      ninja{"ninja", "-C", copies};
  run(texmesh);
  run(ninja);
  run({"sleep", "2.1"});  // stamps younger than that prove nothing
  run(texmesh);
  std::vector<Cost> ours, theirs;
  for (int i = 0; i < s.repeat; ++i) {
    ours.push_back(run(texmesh));
    theirs.push_back(run(ninja));
  }
  const Cost a = median(ours), b = median(theirs);
  std::printf("no-op over %d models, median of %d runs\n", edges, s.repeat);
  std::printf("  texmesh  %7.2f ms wall  %7.2f ms cpu  %6.1f MiB\n", a.wall_s * 1e3, a.cpu_s * 1e3,
              a.peak_mib);
  std::printf("  ninja    %7.2f ms wall  %7.2f ms cpu  %6.1f MiB\n", b.wall_s * 1e3, b.cpu_s * 1e3,
              b.peak_mib);
  std::printf("  ratio %.2f wall, %.2f cpu; %.4f ms wall, %.4f ms cpu per model\n", a.wall_s / b.wall_s,
              a.cpu_s / b.cpu_s, a.wall_s * 1e3 / edges, a.cpu_s * 1e3 / edges);
}

/// Time that lanes were at work, and time from the first start to the last end, from a trace.
std::pair<double, double> lanes_in(const std::string& trace) {
  std::ifstream in(trace);
  double busy_us = 0, end_us = 0;
  const Json document = Json::parse(in);
  for (const Json& e : document["traceEvents"])
    if (e["ph"] == "X" && e["cat"] == "model") {
      busy_us += e["dur"].get<double>();
      end_us = std::max(end_us, e["ts"].get<double>() + e["dur"].get<double>());
    }
  return {busy_us * 1e-6, end_us * 1e-6};
}

void throughput(const Settings& s) {
  const std::string in = s.folder + "/mixed";
  fs::create_directories(in);
  for (int i = 0; i < 16; ++i) {
    static constexpr int kTriangles[] = {300, 1000, 3000, 8000}, kTexture[] = {128, 512, 256, 64, 1024};
    run({s.make_scan, "--triangles", std::to_string(kTriangles[i % 4]), "--texture",
         std::to_string(kTexture[i % 5]), "--seed", std::to_string(i + 1), "-o",
         in + "/m" + std::to_string(i) + ".glb"});
  }
  std::vector<Cost> costs[2];
  double utilisation = 0;
  for (int round = 0; round < s.repeat; ++round)
    for (int jobs : {1, 2}) {
      const std::string trace = s.folder + "/trace.json";
      fs::remove_all(s.folder + "/mixed-out");
      costs[jobs - 1].push_back(run({s.texmesh, "compile", in, "-o", s.folder + "/mixed-out", "--no-cache",
                                     "--jobs", std::to_string(jobs), "--trace", trace}));
      const auto [busy, span] = lanes_in(trace);
      if (jobs == 2) utilisation = std::max(utilisation, busy / span / 2);
    }
  const Cost one = median(costs[0]), two = median(costs[1]);
  double load[1] = {0};
  ::getloadavg(load, 1);
  std::printf("16 mixed models, median of %d runs each (load of the machine now: %.1f)\n", s.repeat, load[0]);
  std::printf("  --jobs 1  %7.2f s wall  %7.2f s cpu\n  --jobs 2  %7.2f s wall  %7.2f s cpu\n", one.wall_s,
              one.cpu_s, two.wall_s, two.cpu_s);
  std::printf(
      "  throughput %.2f times by wall; lanes busy %.0f %% of the time, cpu %.2f times: %.2f times on a "
      "quiet "
      "machine\n",
      one.wall_s / two.wall_s, utilisation * 100, two.cpu_s / one.cpu_s,
      2 * utilisation * one.cpu_s / two.cpu_s);
}

void plan(const Settings& s) {
  const std::string in = s.folder + "/many", collection = s.folder + "/collection.json";
  fs::create_directories(in);
  Json models = Json::array();
  for (int i = 0; i < s.models; ++i) {
    const std::string name = std::to_string(i % 100) + "/model" + std::to_string(i);
    if (i < 100) fs::create_directories(in + "/" + std::to_string(i));
    std::ofstream(in + "/" + name + ".obj") << "v 0 0 " << i << "\n";
    models.push_back({{"input", "many/" + name + ".obj"}, {"output", name + ".texmesh"}});
    if (i % 10 == 0) models.back()["options"] = {{"package", {{"title", "Model " + std::to_string(i)}}}};
  }
  std::ofstream(collection) << Json{
      {"version", 1},
      {"patterns", {{{"match", "many/1*"}, {"options", {{"ssf", {{"scales", 4}}}}}}}},
      {"models", models}}.dump();
  // A millionth of the models: everything is planned, next to nothing is left to start.
  for (const std::string& what : {in, collection}) {
    std::vector<Cost> costs;
    for (int i = 0; i < std::min(s.repeat, 3); ++i)
      costs.push_back(run({s.texmesh, "compile", what, "-o", s.folder + "/planned", "--cache",
                           s.folder + "/plan-cache", "--shard", "0/1000000"}));
    const Cost c = median(costs);
    std::printf("planning %d models from %s: %.2f s wall, %.2f s cpu, %.0f MiB\n", s.models,
                what == in ? "a folder" : "a collection", c.wall_s, c.cpu_s, c.peak_mib);
  }
}

void small(const Settings& s) {
  const std::string in = s.folder + "/small";
  run({s.make_scan, "--many", std::to_string(s.models), "--triangles", "2000", "--texture", "512", "-o", in});
  const Cost c = run({s.texmesh, "compile", in, "-o", s.folder + "/small-out", "--no-cache", "--jobs", "2"});
  std::printf(
      "%d models of 2,000 triangles and 512 px: %.2f s wall, %.2f s cpu; %.2f models/s, %.3f cpu s a model\n",
      s.models, c.wall_s, c.cpu_s, s.models / c.wall_s, c.cpu_s / s.models);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Measures runs over many models."};
  Settings settings;
  app.require_subcommand(1);
  app.add_option("--texmesh", settings.texmesh)->capture_default_str();
  app.add_option("--make-scan", settings.make_scan)->capture_default_str();
  app.add_option("--folder", settings.folder, "Working folder (default: a new one, removed at the end)");
  app.add_option("--models", settings.models, "0 = 1,000 (noop, small), 100,000 (plan)");
  app.add_option("--repeat", settings.repeat)->capture_default_str();
  const auto* noop_command = app.add_subcommand("noop");
  const auto* throughput_command = app.add_subcommand("throughput");
  const auto* plan_command = app.add_subcommand("plan");
  const auto* small_command = app.add_subcommand("small");
  CLI11_PARSE(app, argc, argv);
  const bool temporary = settings.folder.empty();
  if (temporary) {
    std::string name = (fs::temp_directory_path() / "texmesh-bench-XXXXXX").string();
    if (!::mkdtemp(name.data())) return 1;
    settings.folder = name;
  }
  if (settings.models == 0) settings.models = *plan_command ? 100'000 : 1'000;
  if (*noop_command) noop(settings);
  if (*throughput_command) throughput(settings);
  if (*plan_command) plan(settings);
  if (*small_command) small(settings);
  if (temporary) fs::remove_all(settings.folder);
}
