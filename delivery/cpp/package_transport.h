#pragma once
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/http_client.h"
#include "delivery/cpp/transfer.h"

namespace texmesh {

struct TransportOptions {
  HttpOptions http;
  int connections = 6;  // per mirror, as browsers have; a request beyond them waits
};

/// Over HTTP, from one or more mirrors that serve the same package: URLs of containers (ranges) or, ending in
/// a slash, of trees (ranges of an entry, the whole entry where a server knows no ranges). InputError for
/// anything that is no URL. Requests are tried once: transfer() asks elsewhere or again.
std::unique_ptr<Transport> open_transport(const std::vector<std::string>& mirrors,
                                          const TransportOptions& options = {});

}  // namespace texmesh
