#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "delivery/cpp/package/http_link.h"
#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/container/container.h"
#include "format/documents/entry_ref.h"

namespace texmesh {

/// A server that has answered ranges answers 200 for one, and the file is still the same.
class RangesEnded : public InputError {
 public:
  using InputError::InputError;
};

/// Reads ranges of a container from the first server that delivers them.
class HttpSource final : public ByteSource {
 public:
  /// `first`: the answer of urls[0] to a request for the first kStartBytes, or a part of it.
  HttpSource(std::vector<std::string> urls, std::shared_ptr<HttpLink> link, HttpAnswer first);
  std::string name() const override { return shown_url(urls_.front()); }
  std::uint64_t size() override { return *total_; }
  const std::string& etag() const { return etag_; }

  Bytes read(std::uint64_t offset, std::uint64_t bytes) override;

  /// Fetches all of these ranges at once.
  void prefetch(std::vector<ByteRange> ranges);

 private:
  struct Piece {
    std::uint64_t offset = 0, bytes = 0;
    Bytes got;
    std::optional<HttpRetries> retries;
  };

  void require(std::uint64_t offset, std::uint64_t bytes) const;
  /// `pieces` with the parts of a range that are not known, behind them. Where the last piece ends near the
  /// range, that piece grows.
  std::vector<Piece> missing(std::uint64_t offset, std::uint64_t bytes, std::vector<Piece> pieces) const;
  /// The end of the known part that holds `at` (`at` itself without such a part), and the begin of the next
  /// one.
  std::pair<std::uint64_t, std::uint64_t> known_from(std::uint64_t at) const;
  void store(std::uint64_t begin, Bytes bytes);
  Bytes copy(std::uint64_t offset, std::uint64_t bytes) const;

  /// Fetches the pieces. Bytes that have come are kept even when another piece fails.
  void fetch(std::vector<Piece> pieces);
  void start(std::size_t number, const Piece& p);
  /// Takes an answer. False: the piece is not complete and must be asked for again.
  bool accept(Piece& p, HttpAnswer& a);

  [[noreturn]] void fail_replaced(const std::string& found) const;
  void check_range(const HttpAnswer& a, std::uint64_t offset, std::uint64_t bytes);

  std::vector<std::string> urls_;
  std::size_t at_ = 0;  // the server that is asked
  std::shared_ptr<HttpLink> link_;
  std::optional<std::uint64_t> total_;
  std::string etag_;                      // of the server that is asked
  std::map<std::uint64_t, Bytes> parts_;  // by offset, not overlapping
};

}  // namespace texmesh
