#pragma once
// ZIP archives as others write them, for tests.
#include <zlib.h>

#include <string>
#include <vector>

#include "format/base/bytes.h"

namespace texmesh::testing {

struct ZipFile {
  std::string name, text;
  bool deflated = true;
  int flags = 0;                        // 1 = encrypted
  std::uint64_t claimed_bytes = ~0ull;  // in the place of the true size
  std::uint32_t mode = 0;               // of Unix: 0120777 = a symbolic link
  std::string extra = "";               // of the directory
};

inline Bytes zip_of(const std::vector<ZipFile>& files) {
  BytesOut out, directory;
  for (const ZipFile& f : files) {
    Bytes packed(f.text.begin(), f.text.end());
    if (f.deflated) {
      packed.resize(compressBound(static_cast<uLong>(f.text.size())));
      z_stream stream{};
      deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
      std::string text = f.text;
      stream.next_in = reinterpret_cast<Bytef*>(text.data());
      stream.avail_in = static_cast<uInt>(text.size());
      stream.next_out = packed.data();
      stream.avail_out = static_cast<uInt>(packed.size());
      deflate(&stream, Z_FINISH);
      packed.resize(stream.total_out);
      deflateEnd(&stream);
    }
    const std::uint64_t bytes = f.claimed_bytes == ~0ull ? f.text.size() : f.claimed_bytes, at = out.size();
    const auto crc =
        crc32_z(crc32(0, nullptr, 0), reinterpret_cast<const Bytef*>(f.text.data()), f.text.size());
    const auto common = [&](BytesOut& to, std::size_t extra) {
      to.u16(20);
      to.u16(static_cast<std::uint64_t>(f.flags));
      to.u16(f.deflated ? 8 : 0);
      to.u32(0);
      to.u32(crc);
      to.u32(packed.size());
      to.u32(bytes);
      to.u16(f.name.size());
      to.u16(extra);
    };
    out.u32(0x04034b50);
    common(out, 0);
    out.text(f.name);
    out.raw(packed);
    directory.u32(0x02014b50);
    directory.u16(20);
    common(directory, f.extra.size());
    directory.u16(0);
    directory.u32(0);
    directory.u32(std::uint64_t{f.mode} << 16);
    directory.u32(at);
    directory.text(f.name + f.extra);
  }
  const Bytes list = directory.finish();
  const std::size_t at = out.size();
  out.raw(list);
  out.text("PK\5\6");
  out.u32(0);
  out.u16(files.size());
  out.u16(files.size());
  out.u32(list.size());
  out.u32(at);
  out.u16(0);
  return out.finish();
}

}  // namespace texmesh::testing
