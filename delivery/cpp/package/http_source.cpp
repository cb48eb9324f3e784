#include "delivery/cpp/package/http_source.h"

#include <algorithm>

#include "format/base/errors.h"
#include "format/documents/manifest.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kJoinBytes = 4096;  // ranges so near to each other are one request

}  // namespace

HttpSource::HttpSource(std::vector<std::string> urls, std::shared_ptr<HttpLink> link, HttpAnswer first)
    : urls_(std::move(urls)), link_(std::move(link)) {
  check_range(first, 0, kStartBytes);
  const std::uint64_t bytes = std::min(kStartBytes, *total_);
  if (first.complete && first.body.size() != bytes)
    throw FormatError(name(), "byte 0", std::to_string(bytes) + " bytes", std::to_string(first.body.size()));
  store(0, std::move(first.body));
}

Bytes HttpSource::read(std::uint64_t offset, std::uint64_t bytes) {
  if (bytes == 0) return {};
  require(offset, bytes);
  fetch(missing(offset, bytes, {}));
  return copy(offset, bytes);
}

void HttpSource::prefetch(std::vector<ByteRange> ranges) {
  std::ranges::sort(ranges, {}, &ByteRange::offset);
  std::vector<Piece> pieces;
  for (const ByteRange& r : ranges) {
    if (r.bytes == 0) continue;
    require(r.offset, r.bytes);
    pieces = missing(r.offset, r.bytes, std::move(pieces));
  }
  fetch(std::move(pieces));
}

void HttpSource::require(std::uint64_t offset, std::uint64_t bytes) const {
  if (offset > *total_ || bytes > *total_ - offset)
    throw FormatError(name(), "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                      "a file of " + std::to_string(*total_) + " bytes");
  if (bytes > link_->options.max_whole_bytes)
    throw InputError(name(), "byte " + std::to_string(offset),
                     "at most " + std::to_string(link_->options.max_whole_bytes) + " bytes from a server",
                     std::to_string(bytes));
}

std::vector<HttpSource::Piece> HttpSource::missing(std::uint64_t offset, std::uint64_t bytes,
                                                   std::vector<Piece> pieces) const {
  for (std::uint64_t at = offset; at < offset + bytes;) {
    const auto [known_end, next_begin] = known_from(at);
    if (known_end > at) {
      at = known_end;
      continue;
    }
    const std::uint64_t end = std::min(offset + bytes, next_begin);
    const std::uint64_t last_end = pieces.empty() ? 0 : pieces.back().offset + pieces.back().bytes;
    if (!pieces.empty() && at <= last_end + kJoinBytes && known_from(last_end).second >= end &&
        known_from(last_end).first == last_end)
      pieces.back().bytes = std::max(last_end, end) - pieces.back().offset;
    else if (at >= last_end)
      pieces.push_back({at, end - at, {}, {}});
    at = end;
  }
  return pieces;
}

std::pair<std::uint64_t, std::uint64_t> HttpSource::known_from(std::uint64_t at) const {
  auto next = parts_.upper_bound(at);
  const std::uint64_t next_begin = next == parts_.end() ? ~0ull : next->first;
  if (next == parts_.begin()) return {at, next_begin};
  const auto& [begin, part] = *std::prev(next);
  return {std::max(at, begin + part.size()), next_begin};
}

void HttpSource::store(std::uint64_t begin, Bytes bytes) {
  if (!bytes.empty()) parts_.emplace(begin, std::move(bytes));
}

Bytes HttpSource::copy(std::uint64_t offset, std::uint64_t bytes) const {
  Bytes out;
  out.reserve(static_cast<std::size_t>(bytes));
  for (std::uint64_t at = offset; at < offset + bytes;) {
    const auto& [begin, part] = *std::prev(parts_.upper_bound(at));
    const std::uint64_t n = std::min<std::uint64_t>(begin + part.size(), offset + bytes) - at;
    const auto from = part.begin() + static_cast<std::ptrdiff_t>(at - begin);
    out.insert(out.end(), from, from + static_cast<std::ptrdiff_t>(n));
    at += n;
  }
  return out;
}

void HttpSource::fetch(std::vector<Piece> pieces) {
  const auto store_all = [&] {
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      link_->pool.cancel(i);
      store(pieces[i].offset, std::move(pieces[i].got));
    }
  };
  try {
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      pieces[i].retries.emplace(link_->options);
      start(i, pieces[i]);
    }
    while (auto ended = link_->pool.wait(kRequestWait_s)) {
      Piece& piece = pieces[static_cast<std::size_t>(ended->number)];
      const std::size_t asked_of = at_;
      if (accept(piece, ended->answer)) continue;
      if (at_ != asked_of)  // another server for what is left
        for (std::size_t i = 0; i < pieces.size(); ++i) {
          if (&pieces[i] == &piece || !link_->pool.so_far(i)) continue;
          link_->pool.cancel(i);
          start(i, pieces[i]);
        }
      start(static_cast<std::size_t>(ended->number), piece);
    }
  } catch (...) {
    store_all();
    throw;
  }
  store_all();
}

void HttpSource::start(std::size_t number, const Piece& p) {
  const std::uint64_t bytes = p.bytes - p.got.size();
  link_->pool.start(number, urls_[at_], HttpRange{p.offset + p.got.size(), bytes}, bytes);
}

bool HttpSource::accept(Piece& p, HttpAnswer& a) {
  const std::uint64_t at = p.offset + p.got.size();
  const std::string place = "byte " + std::to_string(at);
  if (a.status == 206 && (a.complete || !a.body.empty())) {
    check_range(a, at, p.bytes - p.got.size());
    p.got.insert(p.got.end(), a.body.begin(), a.body.end());
    if (a.body.size() >= kProgressBytes) p.retries.emplace(link_->options);
    if (p.got.size() == p.bytes) return true;
    if (a.complete)
      throw FormatError(name(), place, std::to_string(p.bytes) + " bytes", std::to_string(p.got.size()));
  }
  if (a.too_long && a.status == 206)
    throw FormatError(name(), place, std::to_string(p.bytes) + " bytes", "more");
  if (may_retry(a) && p.retries->wait(a)) return false;
  if (at_ + 1 < urls_.size() && a.problem != "cancelled") {
    ++at_;
    etag_.clear();
    p.retries.emplace(link_->options);
    return false;
  }
  if (a.status == 200 && is_same_file(a, etag_, *total_))
    throw RangesEnded(name(), place, "an answer with status 206",
                      "status 200: ranges are no longer answered");
  if (a.status == 200 || a.status == 416) fail_replaced("status " + std::to_string(a.status));
  throw InputError(name(), place, "an answer with status 206", describe_answer(a));
}

void HttpSource::fail_replaced(const std::string& found) const {
  throw FormatError(name(), "", "the file that reading began with",
                    found + ": it was replaced, read it anew");
}

void HttpSource::check_range(const HttpAnswer& a, std::uint64_t offset, std::uint64_t bytes) {
  const std::string place = "byte " + std::to_string(offset);
  if (!a.first) throw FormatError(name(), place, "a Content-Range", "none that can be read");
  if (total_ && *a.total != *total_) fail_replaced(std::to_string(*a.total) + " bytes");
  if (total_ && !is_same_file(a, etag_, *total_)) fail_replaced("ETag " + a.etag);
  if (*a.first != offset || *a.last != std::min(offset + bytes, *a.total) - 1)
    throw FormatError(name(), place, "the range that was asked for",
                      std::to_string(*a.first) + "-" + std::to_string(*a.last));
  total_ = a.total;
  if (etag_.empty()) etag_ = a.etag;
}

}  // namespace texmesh
