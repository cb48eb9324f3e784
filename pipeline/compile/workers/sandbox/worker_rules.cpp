#include "pipeline/compile/workers/sandbox/worker_rules.h"

#include <charconv>
#include <cstdlib>
#include <filesystem>

namespace texmesh {
namespace {

namespace fs = std::filesystem;

std::string folder_of_file(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

/// Where symbolic links lead in the end; "" when nothing is there.
std::string real_path(const std::string& path) {
  std::error_code ec;
  const fs::path real = fs::canonical(path, ec);
  return ec ? "" : real.string();
}

/// "https://user:word@host:8443/cache" -> 8443
std::uint16_t port_of(const std::string& url) {
  const std::size_t begin = url.find("://") + 3, end = std::min(url.find_first_of("/?#", begin), url.size());
  const std::size_t colon = url.rfind(':', end);
  std::uint16_t port = url.starts_with("https") ? 443 : 80;
  // A colon before '@' stands in a credential, one before ']' in an address.
  if (colon != std::string::npos && colon >= begin && url.find_first_of("@]", colon) >= end)
    std::from_chars(url.data() + colon + 1, url.data() + end, port);
  return port;
}

bool has_proxy() {
  for (const char* name : {"http_proxy", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"})
    if (const char* value = std::getenv(name); value != nullptr && *value != '\0') return true;
  return false;
}

}  // namespace

SandboxRules sandbox_rules(const WorkerPlaces& places) {
  SandboxRules rules;
  rules.read = {folder_of_file(places.input), real_path(places.input)};
  if (!places.program.empty())
    for (const char* modules : {"/../stages", "/../lib", "/../lib64"})
      rules.read.push_back(folder_of_file(places.program) + modules);
  if (!places.output.empty()) {
    rules.write.push_back(folder_of_file(places.output));
    if (const std::string real = real_path(places.output); !real.empty())
      rules.write.push_back(folder_of_file(real));
  }
  if (!places.cache.empty()) (places.only_looks ? rules.read : rules.write).push_back(places.cache);
  for (const std::string& layer : places.layers) {
    if (layer.find("://") == std::string::npos) {
      rules.read.push_back(layer);
    } else {
      rules.network = true;
      rules.ports.push_back(port_of(layer));
    }
  }
  constexpr std::uint16_t kNameServer = 53;
  if (rules.network) rules.ports.push_back(kNameServer);
  if (has_proxy()) rules.ports.clear();
  return rules;
}

}  // namespace texmesh
