#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/http/http_client.h"
#include "delivery/cpp/package/package_reader.h"
#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {

struct TransportOptions {
  HttpOptions http;
  int connections = 6;                       // per mirror, as browsers have; a request beyond them waits
  std::map<std::string, std::string> etags;  // by URL, what is known of containers already
};

/// Over HTTP, from one or more mirrors that serve the same package: URLs of containers (ranges) or, ending in
/// a slash, of trees (ranges of an entry, the whole entry where that is asked for). InputError for anything
/// that is no URL. Requests are tried once: transfer() asks elsewhere or again; what a cut answer has brought
/// is kept until then. A container that is replaced meanwhile (ETag, length), or that is not
/// answered in ranges, has failed for good.
std::unique_ptr<Transport> open_transport(const std::vector<std::string>& mirrors,
                                          const TransportOptions& options = {});
/// From a store that is here, without a network: every request is answered at once.
std::unique_ptr<Transport> open_transport(PackageStore& store);

}  // namespace texmesh
