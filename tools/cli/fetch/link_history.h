#pragma once
#include <optional>
#include <string>
#include <vector>

namespace texmesh {

/// The average throughput of every host that was read from, kept from run to run: the thesis's historic
/// average (4.2), which is beta_0. A file of a few kB, schemas/link-history.v1.schema.json.
class LinkHistory {
 public:
  static constexpr std::size_t kMostHosts = 1000;  // the one not used for longest is forgotten
  /// A file that is not there is an empty history. InputError names what is wrong with any other content than
  /// write() makes: too large, no regular file, other keys, hosts twice, numbers out of range.
  static LinkHistory read(const std::string& path);
  /// Bytes/s; nothing for a host that is not known.
  std::optional<double> average_bytes_s(const std::string& host) const;
  /// Another load. The average is that of all loads up to 16, after which old ones fade. What is no host or
  /// no rate from 1 to 1e12 is left out.
  void add(const std::string& host, double bytes_s);
  /// Atomically; makes the folder. ResourceError.
  void write(const std::string& path) const;

 private:
  struct Host {
    std::string name;
    double bytes_s = 0;
    int loads = 0;
  };
  static bool good(const Host& host);
  std::vector<Host> hosts_;  // the one used last at the end
};

/// "host" or "host:port" of an http(s) URL, in lower case, without a user; "" for another text.
std::string host_of_url(const std::string& url);
/// texmesh/links.json in the user's state folder ($XDG_STATE_HOME, else ~/.local/state). InputError where
/// there is none.
std::string default_link_history();

}  // namespace texmesh
