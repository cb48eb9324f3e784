#pragma once
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/http/http_client.h"
#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// Where a package turned out to be, and what its first answer showed.
struct HttpPlace {
  std::size_t mirror = 0;  // of those that were given
  std::string url;         // of the container, or of the tree, ending in a slash
  bool ranges = true;      // false: whole entries only
  bool in_memory = false;  // the server gave the whole container, which is here now
  std::string etag;        // of the container, when it is strong
  double rtt_s = 0;        // from the request to its answer's first byte
  double bytes_s = 0;      // of that request, its round trip included
};

class HttpStore : public PackageStore {
 public:
  virtual HttpPlace place() const = 0;  // after read_manifest()
};

/// A package on a web server (SPEC.md, section Serving). One request of 16 KiB starts; ranges that were read
/// once are not asked for again. A server that answers 200 for a range is asked for the tree beside the
/// container (the URL without .texmesh, plus /), and for the whole container when there is none; of a tree
/// ranges are read where its server knows them. Transfers that break are resumed where they broke; tries are
/// counted anew when one has brought something. InputError when the server does not deliver, FormatError when
/// what it says cannot be (other ranges or lengths than asked for, a package replaced meanwhile).
std::unique_ptr<PackageStore> open_url(const std::string& url, const HttpOptions& options = {});
/// The same package on several servers: the first one to answer is read from, the next are asked when it does
/// not within half a second; when it fails later the others take its place.
std::unique_ptr<HttpStore> open_urls(const std::vector<std::string>& urls, const HttpOptions& options = {});

}  // namespace texmesh
