#include "pipeline/cli/fetch/link_history.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/resource_error.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uintmax_t kMostFileBytes = 512 * 1024;
constexpr int kMostLoads = 1'000'000, kMemory = 16;
constexpr double kLeastRate = 1, kMostRecordedBytes_s = 1e12;
constexpr std::size_t kMostName = 260;

bool is_host(const std::string& name) {
  return !name.empty() && name.size() <= kMostName && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
           std::string_view(".-_:[]").find(c) != std::string_view::npos;
  });
}

std::string read_small_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path, "", "a regular file", "another");
  std::ifstream in(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(kMostFileBytes) + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (in.bad() || (!in.eof() && in.fail())) throw InputError(path, "", "a readable file", "none");
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.size() > kMostFileBytes)
    throw InputError(path, "", "at most " + std::to_string(kMostFileBytes) + " bytes", "more");
  return text;
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
  const Json j = Json::parse(read_small_file(path), nullptr, false);
  if (!j.is_object() || j.size() != 2 || j.value("version", Json()) != 1 || !j.contains("hosts") ||
      !j["hosts"].is_array())
    throw InputError(path, "", "a JSON object with version 1 and a list of hosts", "another document");
  if (j["hosts"].size() > kMostHosts)
    throw InputError(path, "hosts", "at most " + std::to_string(kMostHosts),
                     std::to_string(j["hosts"].size()));
  for (const Json& entry : j["hosts"]) {
    const std::string place = "hosts[" + std::to_string(history.hosts_.size()) + "]";
    Host host;
    const bool shaped = entry.is_object() && entry.size() == 3 && entry.contains("host") &&
                        entry["host"].is_string() && entry.contains("bytes_s") &&
                        entry["bytes_s"].is_number() && entry.contains("loads") &&
                        entry["loads"].is_number_integer();
    if (shaped) {
      host = {entry["host"].get<std::string>(), entry["bytes_s"].get<double>(), 0};
      const auto loads = entry["loads"].get<std::int64_t>();
      if (loads >= 1 && loads <= kMostLoads) host.loads = static_cast<int>(loads);
    }
    if (!good(host))
      throw InputError(path, place, "host, bytes_s from 1 to 1e12 and loads", "something else");
    if (history.average_bytes_s(host.name)) throw InputError(path, place, "a host once", "twice");
    history.hosts_.push_back(std::move(host));
  }
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
  write_file_atomically(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
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
