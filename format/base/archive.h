#pragma once
#include <bit>
#include <cstring>
#include <type_traits>
#include <vector>

#include "format/base/errors.h"
#include "format/base/sha256.h"
#include "format/base/vec.h"

namespace texmesh {

// Serialisation of plain data for cached stage artefacts (not for packages: their layouts stand in SPEC.md).
// A struct names its members once, in
//   static void archive(auto& s, auto& a)
// and both archives below go through that list. Numbers are little-endian. A vector or string is a u64 count
// and its elements.
static_assert(std::endian::native == std::endian::little,
              "artefact and package codecs copy little-endian memory");

template <class T>
struct IsFlat : std::bool_constant<std::is_arithmetic_v<T> || std::is_enum_v<T>> {};
template <class T>
struct IsFlat<Vec2<T>> : std::true_type {};
template <class T>
struct IsFlat<Vec3<T>> : std::true_type {};
template <class T>
struct IsFlat<Vec4<T>> : std::true_type {};
template <class T, std::size_t N>
struct IsFlat<std::array<T, N>> : IsFlat<T> {};

/// Hands the bytes of what it is called with to `Sink`, piece by piece: a function of ByteSpan.
template <class Sink>
class ArchiveTo {
 public:
  template <class... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }
  Sink& sink() { return sink_; }

 private:
  void raw(const void* data, std::size_t size) {
    if (size > 0) sink_({static_cast<const std::uint8_t*>(data), size});
  }
  template <class T>
  void put(const T& value) {
    if constexpr (IsFlat<T>::value) {
      raw(&value, sizeof value);
    } else {
      T::archive(value, *this);
    }
  }
  void put(const std::string& s) {
    put(static_cast<std::uint64_t>(s.size()));
    raw(s.data(), s.size());
  }
  template <class T>
  void put(const std::vector<T>& v) {
    put(static_cast<std::uint64_t>(v.size()));
    if constexpr (IsFlat<T>::value) {
      raw(v.data(), v.size() * sizeof(T));
    } else {
      for (const T& x : v) put(x);
    }
  }
  Sink sink_;
};

struct ArchiveSizeSink {
  std::size_t bytes = 0;
  void operator()(std::span<const std::uint8_t> piece) { bytes += piece.size(); }
};
struct ArchiveMemorySink {
  std::vector<std::uint8_t> bytes;
  void operator()(std::span<const std::uint8_t> piece) {
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
};
struct ArchiveDigestSink {
  Sha256Stream stream;
  void operator()(std::span<const std::uint8_t> piece) { stream.add(piece); }
};

class ArchiveWriter : public ArchiveTo<ArchiveMemorySink> {
 public:
  void reserve(std::size_t bytes) { sink().bytes.reserve(bytes); }
  /// The bytes; the writer is empty afterwards.
  std::vector<std::uint8_t> finish() { return std::move(sink().bytes); }
};

/// Reads what ArchiveWriter wrote; throws FormatError on any truncation or on bytes left over (see finish()).
/// A count is checked against the bytes that remain before anything is allocated.
class ArchiveReader {
 public:
  ArchiveReader(std::span<const std::uint8_t> bytes, std::string name)
      : bytes_(bytes), name_(std::move(name)) {}
  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  void finish() const {
    if (at_ != bytes_.size()) fail("end of artefact", std::to_string(bytes_.size() - at_) + " more bytes");
  }

 private:
  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw FormatError(name_, "byte " + std::to_string(at_), std::move(expected), std::move(found));
  }
  void raw(void* data, std::size_t size) {
    if (size > bytes_.size() - at_)
      fail(std::to_string(size) + " bytes", std::to_string(bytes_.size() - at_) + " bytes");
    if (size) std::memcpy(data, bytes_.data() + at_, size);
    at_ += size;
  }
  std::size_t count(std::size_t element_bytes) {
    std::uint64_t n = 0;
    raw(&n, sizeof n);
    if (n > (bytes_.size() - at_) / element_bytes) fail("a count that fits the artefact", std::to_string(n));
    return static_cast<std::size_t>(n);
  }
  template <class T>
  void get(T& value) {
    if constexpr (IsFlat<T>::value) {
      raw(&value, sizeof value);
    } else {
      T::archive(value, *this);
    }
  }
  void get(bool& value) {
    std::uint8_t b = 0;
    raw(&b, 1);
    if (b > 1) fail("0 or 1", std::to_string(b));
    value = b != 0;
  }
  void get(std::string& s) {
    s.resize(count(1));
    raw(s.data(), s.size());
  }
  template <class T>
  void get(std::vector<T>& v) {
    if constexpr (IsFlat<T>::value) {
      v.resize(count(sizeof(T)));
      raw(v.data(), v.size() * sizeof(T));
    } else {
      const std::size_t n = count(1);
      v.clear();
      for (std::size_t i = 0; i < n; ++i) get(v.emplace_back());
    }
  }
  std::span<const std::uint8_t> bytes_;
  std::string name_;
  std::size_t at_ = 0;
};

/// Bytes that grow would for a moment take three times their memory: gigabytes where a scan is large.
std::vector<std::uint8_t> encode_artefact(const auto& value) {
  ArchiveTo<ArchiveSizeSink> size;
  size(value);
  ArchiveWriter w;
  w.reserve(size.sink().bytes);
  w(value);
  return w.finish();
}
/// Of the bytes that encode_artefact() gives, without having them in memory.
struct ArtefactDigest {
  Sha256 digest{};
  std::uint64_t bytes = 0;
};
ArtefactDigest digest_artefact(const auto& value) {
  ArchiveTo<ArchiveDigestSink> w;
  w(value);
  Sha256Stream& stream = w.sink().stream;
  const std::uint64_t bytes = stream.bytes();
  return {stream.finish(), bytes};
}
template <class T>
T decode_artefact(std::span<const std::uint8_t> bytes, const std::string& name) {
  ArchiveReader r(bytes, name);
  T value;
  r(value);
  r.finish();
  return value;
}

}  // namespace texmesh
