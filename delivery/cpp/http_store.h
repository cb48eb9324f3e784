#pragma once
#include <memory>
#include <string>

#include "delivery/cpp/http_client.h"
#include "delivery/cpp/package_reader.h"

namespace texmesh {

/// A package on a web server (SPEC.md, section Serving). One request of 16 KiB starts; ranges that were read
/// once are not asked for again. A server that answers 200 for a range is asked for the tree beside the
/// container (the URL without .texmesh, plus /), and for the whole container when there is none. Transfers
/// that break are resumed where they broke. InputError when the server does not deliver, FormatError when
/// what it says cannot be (other ranges or lengths than asked for, a package replaced meanwhile).
std::unique_ptr<PackageStore> open_url(const std::string& url, const HttpOptions& options = {});

}  // namespace texmesh
