#pragma once

#include "delivery/cpp/http/http_client.h"
#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// Where a package was found, and what the first answer showed.
struct HttpPlace {
  std::size_t mirror = 0;  // index into the URLs that were given
  std::string url;         // of the container, or of the tree, ending in a slash
  bool ranges = true;      // false: whole entries only
  bool in_memory = false;  // the server gave the whole container, which is kept
  std::string etag;        // of the container; "" for a weak one
  double rtt_s = 0;        // from the request to its answer's first byte
  double bytes_s = 0;      // of that request, its round trip included; in_memory: of the whole container's
};

class HttpStore : public PackageStore {
 public:
  virtual HttpPlace place() const = 0;  // after read_manifest()
};

/// A package on a web server (SPEC.md, section Serving).
/// - The first request is for kStartBytes: manifest, first picture, and more. A range that was read is not
///   asked for again.
/// - A server that answers 200 for a range is asked for the tree beside the container (the URL without
///   .texmesh, plus /), and without a tree for the whole container. Entries of a tree are read by ranges
///   where the server knows ranges.
/// - A server that stops answering ranges of the same file is asked for the tree, too, where its manifest has
///   the same bytes.
/// - A transfer that breaks is resumed where it broke. A try that brings new bytes begins the count of tries
///   again.
/// InputError when the server does not deliver. FormatError when an answer cannot be true (other ranges or
/// lengths than asked for, a package that was replaced meanwhile).
/// The same package may be on several servers. The next server is asked when the one before has not answered
/// within half a second. The first server to answer is read from; when it fails later, the others take its
/// place.
std::unique_ptr<HttpStore> open_urls(const std::vector<std::string>& urls, const HttpOptions& options = {});
inline std::unique_ptr<PackageStore> open_url(const std::string& url, const HttpOptions& options = {}) {
  return open_urls({url}, options);
}

}  // namespace texmesh
