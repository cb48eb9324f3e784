#pragma once

#include <memory>

#include "tools/publish/view/served_files.h"

namespace texmesh {

/// A part of a file: `bytes` from `first`.
struct RequestedRange {
  enum Kind { kNone, kPart, kUnsatisfiable } kind = kNone;
  std::uint64_t first = 0, bytes = 0;
};

/// The one range of a Range header (RFC 9110, section 14) over a file of `size` bytes: a-b, a-, -n. kNone
/// for what a server may answer with the whole file: no header, other units, several ranges, nonsense.
/// What httplib's own parser does not take (5-2, numbers beyond 64 bits) it answers with 416 before a
/// handler is asked.
RequestedRange requested_range(const std::string& header, std::uint64_t size);

/// Serves a ServedFiles over HTTP: GET and HEAD (OPTIONS for browsers that ask before a request from
/// elsewhere), one range, ETag with If-None-Match and If-Range, CORS. Everything else is 404 or 405.
class ViewServer {
 public:
  explicit ViewServer(const ServedFiles& files);
  ~ViewServer();
  /// Port 0 = any free one; returns the port. InputError where it cannot be had.
  int bind(const std::string& host, int port);
  void serve();  // until the process ends

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace texmesh
