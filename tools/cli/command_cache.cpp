#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/units.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

struct CacheArguments {
  std::string cache;
  CacheLimits limits;
  bool json = false;
};

std::string folder_of(const CacheArguments& args) {
  std::string folder = default_cache_folder(args.cache);
  if (folder.empty())
    throw InputError("--cache", "", "a cache folder (--cache, TEXMESH_CACHE, XDG_CACHE_HOME or HOME)",
                     "none of them");
  return folder;
}

std::string existing_folder_of(const CacheArguments& args) {
  std::string folder = folder_of(args);
  if (!std::filesystem::is_directory(folder)) throw InputError(folder, "", "a cache folder", "nothing there");
  return folder;
}

void statistics(const CacheArguments& args) {
  const CacheStatistics s = cache_statistics(existing_folder_of(args));
  if (args.json) {
    std::cout << Json{{"folder", folder_of(args)},    {"bytes", s.bytes()},
                      {"records", s.entries},         {"blobs", s.blobs},
                      {"blob_bytes", s.blob_bytes},   {"notes", s.notes},
                      {"quarantined", s.quarantined}, {"quarantined_bytes", s.quarantined_bytes},
                      {"running_builds", s.running},  {"oldest_use_s", s.oldest_use_s}}
                     .dump(1)
              << '\n';
    return;
  }
  std::cout << fmt::format(
      "folder         {}\nsize           {}\nresults        {} runs of stages, {} outputs of {}\nquarantined "
      "   {} of {}\n"
      "oldest use     {:.1f} days ago\nrunning builds {}\n",
      folder_of(args), format_bytes(s.bytes()), s.entries, s.blobs, format_bytes(s.blob_bytes), s.quarantined,
      format_bytes(s.quarantined_bytes), static_cast<double>(s.oldest_use_s) / 86400, s.running);
}

void prune(const CacheArguments& args) {
  const PruneResult r = prune_cache(existing_folder_of(args), args.limits);
  if (args.json) {
    std::cout << Json{{"removed_records", r.entries}, {"removed_blobs", r.blobs},
                      {"removed_others", r.others},   {"removed_bytes", r.bytes},
                      {"kept_bytes", r.kept_bytes},   {"kept_in_use", r.kept_in_use}}
                     .dump(1)
              << '\n';
    return;
  }
  std::cout << fmt::format(
      "removed {} results with {} outputs, {}; {} are left{}\n", r.entries, r.blobs, format_bytes(r.bytes),
      format_bytes(r.kept_bytes),
      r.kept_in_use ? fmt::format(" ({} results are in use by running builds)", r.kept_in_use) : "");
}

int verify(const CacheArguments& args) {
  const std::vector<CacheDamage> damage = verify_cache(existing_folder_of(args));
  Json list = Json::array();
  for (const CacheDamage& d : damage) {
    list.push_back({{"path", d.path}, {"reason", d.reason}});
    if (!args.json) std::cout << d.path << ": " << d.reason << "; moved to quarantine\n";
  }
  if (args.json)
    std::cout << Json{{"damaged", list}}.dump(1) << '\n';
  else if (damage.empty())
    std::cout << "every object has its digest\n";
  return damage.empty() ? kExitOk : kExitModelFailed;
}

}  // namespace

void add_cache_command(Command& app) {
  auto args = std::make_shared<CacheArguments>();
  Command c = app.add("cache", "Look at, prune or check the cache folder");
  c.needs_command();
  const auto add = [&](const char* name, const char* help, std::function<int(const CacheArguments&)> run) {
    Command command = c.add(name, help);
    command
        .option("--cache", args->cache, "Cache folder (default: TEXMESH_CACHE, else the user's cache folder)")
        .value_name("DIR");
    if (std::string(name) != "path") command.flag("--json", args->json, "Print JSON");
    command.on_run([args, run] { return as_usage([&] { return run(*args); }); });
    return command;
  };
  add("stat", "Print how much the folder holds",
      [](const CacheArguments& a) { return statistics(a), kExitOk; });
  Command p = add("prune", "Remove the results that have not been used for longest",
                  [](const CacheArguments& a) { return prune(a), kExitOk; });
  p.option("--size", args->limits.max_bytes, parse_bytes, "Most bytes that stay (default 20GB, 0 = no limit)")
      .value_name("SIZE");
  p.option("--age", args->limits.max_age_s, parse_seconds,
           "Longest time that an unused result stays (default 90d, 0 = no limit)")
      .value_name("TIME");
  add("verify", "Read every object and move damaged ones to quarantine (exit code 1 when there are any)",
      verify);
  add("path", "Print the folder", [](const CacheArguments& a) {
    std::cout << folder_of(a) << '\n';
    return kExitOk;
  });
  c.notes(
      "Builds prune the folder (compile --cache-size, --cache-age). Pruning never touches what a running "
      "build uses.\n"
      "The folder may be deleted: everything in it can be computed again.");
}

}  // namespace texmesh
