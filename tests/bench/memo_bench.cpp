// What remembering a large collection costs:
//   memo_bench save   10^6 records of runs that are there already: reading them, a save of 30 s' worth,
//   memory memo_bench noop   texmesh over 100,000 models of which nothing has changed
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "pipeline/batch/build_memo.h"
#include "pipeline/compile/options.h"

namespace {

namespace fs = std::filesystem;
using namespace texmesh;
using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double peak_mib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

Sha256 digest_of(const std::string& s) {
  return sha256({reinterpret_cast<const std::uint8_t*>(s.data()), s.size()});
}

StageKeys keys_of(int i) {
  StageKeys keys;
  for (int stage = 0; stage < 17; ++stage) {
    Sha256 key = digest_of("key");
    for (int b = 0; b < 4; ++b) key[static_cast<std::size_t>(b)] = static_cast<std::uint8_t>(i >> 8 * b);
    keys["stage_of_the_graph_" + std::to_string(stage)] = key;
  }
  return keys;
}

/// What a run would have found out of a model with two images.
PackageMemo record_of(int i) {
  PackageMemo r;
  r.request = digest_of("options");
  r.looked_at_ns = 1'700'000'000'000'000'000 + i;
  r.keys = keys_of(i);
  for (const char* uri : {"", "colour_of_the_scan.jpg", "normals_of_the_scan.jpg"})
    r.files.push_back(
        {uri, true, r.keys.begin()->second, 1u << 20, {1, static_cast<std::uint64_t>(i), 1u << 20, 1, 1}});
  r.seconds = 1.5;
  return r;
}

std::string package_of(int i) {
  return "museum/" + std::to_string(i % 1000) + "/scan_" + std::to_string(i) + ".texmesh";
}

double megabytes_in(const std::string& folder) {
  std::uintmax_t bytes = 0;
  for (const auto& file : fs::recursive_directory_iterator(folder))
    if (file.is_regular_file()) bytes += file.file_size();
  return static_cast<double>(bytes) / 1e6;
}

void save(const std::string& folder, int models) {
  {
    BuildMemo memo(folder, "/out");
    for (int i = 0; i < models; ++i) memo.set(package_of(i), record_of(i));
  }
  const pid_t pid = ::fork();  // its memory is that of one run
  if (pid != 0) {
    ::waitpid(pid, nullptr, 0);
    return;
  }
  auto start = Clock::now();
  BuildMemo memo(folder, "/out");
  const double read_ms = ms_since(start), read_mib = peak_mib();
  PackageMemo found;
  int known = 0;
  for (int i = 0; i < models; i += 1000) known += memo.find(package_of(i), found) ? 1 : 0;
  constexpr int kModelsIn30s = 60;
  for (int i = 0; i < kModelsIn30s; ++i) memo.set(package_of(i), record_of(i + 1));
  const double before_mb = megabytes_in(folder);
  start = Clock::now();
  const bool saved = memo.save();
  const double save_ms = ms_since(start);
  std::printf(
      "%d records, %.0f MB: %.0f ms and %.0f MiB to read them; a save of %d: %.2f ms, %.0f kB, %s; %d of %d found; "
      "peak %.0f MiB\n",
      models, before_mb, read_ms, read_mib, kModelsIn30s, save_ms, 1000 * (megabytes_in(folder) - before_mb),
      saved ? "written" : "NOT written", known, (models + 999) / 1000, peak_mib());
  std::fflush(stdout);
  ::_exit(0);
}

/// Models, packages and a memo as a run would leave them, without the work: the packages are a few bytes.
void make_collection(const std::string& in, const std::string& out, const std::string& cache, int models) {
  for (int i = 0; i < models; ++i) {
    const std::string name = "/" + std::to_string(i / 1000) + "/scan_" + std::to_string(i);
    if (i % 1000 == 0) fs::create_directories(in + "/" + std::to_string(i / 1000));
    if (i % 1000 == 0) fs::create_directories(out + "/" + std::to_string(i / 1000));
    std::ofstream(in + name + ".obj") << "v 0 0 " << i << "\n";
    std::ofstream(out + name + ".texmesh") << "package " << i;
  }
  ::sleep(3);  // stamps younger than that prove nothing
  PlanRequest request;
  request.inputs = {in};
  request.output = out;
  const BatchPlan plan = plan_batch(request);
  RunSettings settings;
  settings.cache.folder = cache;
  JobSelection selection(plan, settings);
  std::vector<WorkerReport> reports(plan.models.size());
  selection.select(reports);
  for (std::size_t job = 0; job < selection.jobs().size(); ++job) {
    const WorkerJob& j = selection.jobs()[job];
    WorkerReport report;
    report.result = ModelResult::kOk;
    const FileStamp stamp = *stamp_of(j.input);
    report.more->files = {{"", true, digest_of(j.input), stamp.bytes, stamp}};
    report.more->keys = keys_of(static_cast<int>(job));
    selection.remember(job, report);
  }
  if (!selection.save_memo()) std::exit(1);
}

struct NoopCost {
  double wall_ms = 0, cpu_ms = 0, peak_mib = 0;
};

NoopCost run_once(const std::vector<std::string>& arguments) {
  const auto start = Clock::now();
  const pid_t pid = ::fork();
  if (pid == 0) {
    ::dup2(::open("/dev/null", O_WRONLY), 1);
    std::vector<char*> argv;
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    ::execvp(argv[0], argv.data());
    ::_exit(127);
  }
  int status = 0;
  rusage usage{};
  ::wait4(pid, &status, 0, &usage);
  if (status != 0) std::fprintf(stderr, "%s failed: %d\n", arguments[0].c_str(), status), std::exit(1);
  const auto ms = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_usec) * 1e-3;
  };
  return {ms_since(start), ms(usage.ru_utime) + ms(usage.ru_stime),
          static_cast<double>(usage.ru_maxrss) / 1024};
}

/// ninja's copies of the same models.
std::vector<std::string> make_ninja_rules(const std::string& folder, const std::string& in, int models) {
  fs::create_directories(folder);
  std::ofstream rules(folder + "/build.ninja");
  rules << "rule copy\n  command = cp $in $out\n";
  for (int i = 0; i < models; ++i) {
    const std::string name = "/" + std::to_string(i / 1000) + "/scan_" + std::to_string(i);
    rules << "build " << name.substr(1) << ".texmesh: copy " << in << name << ".obj\n";
  }
  return {"ninja", "-C", folder};
}

void noop(const std::string& folder, int models) {
  const std::string in = folder + "/in", out = folder + "/out", cache = folder + "/cache";
  // In a process of its own: the kernel counts the memory of who starts a program as that of the program.
  const pid_t pid = ::fork();
  if (pid == 0) make_collection(in, out, cache, models), ::_exit(0);
  int status = 0;
  if (::waitpid(pid, &status, 0) != pid || status != 0) std::exit(1);
  constexpr int kMostOfNinja = 5000, kRepeat = 11;
  std::vector<std::string> ninja;
  if (models <= kMostOfNinja) {
    ninja = make_ninja_rules(folder + "/ninja", in, models);
    run_once(ninja);
  }
  std::vector<double> cpu, ninja_cpu;
  NoopCost last;
  for (int i = 0; i < kRepeat; ++i) {
    last = run_once({TEXMESH_BINARY, "compile", in, "-o", out, "--cache", cache});
    cpu.push_back(last.cpu_ms);
    if (!ninja.empty()) ninja_cpu.push_back(run_once(ninja).cpu_ms);
  }
  const auto median = [](std::vector<double> v) { return std::sort(v.begin(), v.end()), v[v.size() / 2]; };
  std::printf("no-op over %d models, median of %d: %.1f ms cpu, %.1f MiB\n", models, kRepeat, median(cpu),
              last.peak_mib);
  if (!ninja.empty())
    std::printf("ninja's: %.1f ms cpu; ratio %.2f\n", median(ninja_cpu), median(cpu) / median(ninja_cpu));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Measures what remembering a large collection costs."};
  int models = 0;
  app.require_subcommand(1);
  app.add_option("--models", models, "0 = 1,000,000 (save), 100,000 (noop)");
  const auto* save_command = app.add_subcommand("save");
  const auto* noop_command = app.add_subcommand("noop");
  CLI11_PARSE(app, argc, argv);
  std::string folder = (fs::temp_directory_path() / "texmesh-bench-XXXXXX").string();
  if (!::mkdtemp(folder.data())) return 1;
  if (*save_command) save(folder, models > 0 ? models : 1'000'000);
  if (*noop_command) noop(folder, models > 0 ? models : 100'000);
  fs::remove_all(folder);
}
