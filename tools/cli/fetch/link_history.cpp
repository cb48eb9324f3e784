#include "tools/cli/fetch/link_history.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/compile/user_document.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/resolver.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMostFileBytes = 512 * 1024;
constexpr int kMostLoads = 1'000'000, kMemory = 16;
constexpr double kLeastRate = 1, kMostRecordedBytes_s = 1e12;
constexpr std::size_t kMostName = 260;

bool is_host(const std::string& name) {
  return !name.empty() && name.size() <= kMostName && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
           std::string_view(".-_:[]").find(c) != std::string_view::npos;
  });
}

}  // namespace

bool LinkHistory::good(const Host& h) {
  return is_host(h.name) && h.bytes_s >= kLeastRate && h.bytes_s <= kMostRecordedBytes_s && h.loads >= 1 &&
         h.loads <= kMostLoads;
}

LinkHistory LinkHistory::read(const std::string& path) {
  LinkHistory history;
  std::error_code error;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path, error))) return history;
  const std::vector<std::uint8_t> bytes = read_input_file(path, kMostFileBytes);
  read_document(path, [&] {
    const nlohmann::json document = parse_json(bytes, path, kMostFileBytes);
    const JsonAt at(document, path);
    at["version"].integer(1, 1);
    const std::size_t count = at["hosts"].array(0, kMostHosts);
    check_field_names(document, {"version", "hosts"}, at);
    for (std::size_t k = 0; k < count; ++k) {
      const JsonAt entry = at["hosts"][k];
      Host host{entry["host"].text(kMostName), entry["bytes_s"].number(kLeastRate, kMostRecordedBytes_s),
                static_cast<int>(entry["loads"].integer(1, kMostLoads))};
      check_field_names(document["hosts"][k], {"host", "bytes_s", "loads"}, entry);
      if (!is_host(host.name)) entry["host"].fail("a host", host.name);
      if (history.average_bytes_s(host.name)) entry["host"].fail("a host once", host.name + " again");
      history.hosts_.push_back(std::move(host));
    }
  });
  return history;
}

std::optional<double> LinkHistory::average_bytes_s(const std::string& host) const {
  const auto it = std::ranges::find(hosts_, host, &Host::name);
  return it == hosts_.end() ? std::nullopt : std::optional(it->bytes_s);
}

void LinkHistory::add(const std::string& host, double bytes_s) {
  Host now{host, bytes_s, 1};
  if (!good(now)) return;
  if (const auto it = std::ranges::find(hosts_, host, &Host::name); it != hosts_.end()) {
    now.loads = std::min(it->loads + 1, kMostLoads);
    now.bytes_s = it->bytes_s + (bytes_s - it->bytes_s) / std::min(now.loads, kMemory);
    hosts_.erase(it);
  }
  hosts_.push_back(std::move(now));
  if (hosts_.size() > kMostHosts) hosts_.erase(hosts_.begin());
}

void LinkHistory::write(const std::string& path) const {
  Json list = Json::array();
  for (const Host& h : hosts_) list.push_back({{"host", h.name}, {"bytes_s", h.bytes_s}, {"loads", h.loads}});
  const std::string text = Json{{"version", 1}, {"hosts", list}}.dump(1) + '\n';
  if (const auto folder = std::filesystem::path(path).parent_path(); !folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw ResourceError(folder.string(), "", "a folder that can be made", error.message());
  }
  write_file_atomically(path, text_bytes(text));
}

std::string host_of_url(const std::string& url) {
  const std::size_t scheme = url.starts_with("http://") ? 7 : url.starts_with("https://") ? 8 : 0;
  if (scheme == 0) return "";
  std::string host = url.substr(scheme, url.find_first_of("/?#", scheme) - scheme);
  host = host.substr(host.rfind('@') + 1);  // npos + 1 is 0
  for (char& c : host)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return is_host(host) ? host : "";
}

std::string default_link_history() {
  const auto folder = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value && *value == '/' ? value : "");
  };
  if (const std::string state = folder("XDG_STATE_HOME"); !state.empty())
    return state + "/texmesh/links.json";
  if (const std::string home = folder("HOME"); !home.empty())
    return home + "/.local/state/texmesh/links.json";
  throw InputError("--history", "", "a state folder ($XDG_STATE_HOME or $HOME), or FILE", "neither");
}

}  // namespace texmesh
