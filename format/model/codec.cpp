#include "format/model/codec.h"

#include <algorithm>

#include "format/base/bytes.h"

namespace texmesh {
namespace {

using Span = std::span<const std::uint8_t>;

constexpr std::uint8_t kStart = 0xd8, kEnd = 0xd9;
constexpr std::size_t kMarkerBytes = 2;
constexpr std::size_t kRiffHeader = 12;

bool marker_at(Span bytes, std::size_t at, std::uint8_t code) {
  return bytes[at] == 0xff && bytes[at + 1] == code;
}

bool begins_and_ends(Span bytes) {
  return bytes.size() >= 2 * kMarkerBytes && marker_at(bytes, 0, kStart) &&
         marker_at(bytes, bytes.size() - kMarkerBytes, kEnd);
}

[[noreturn]] void fail(const char* rule, const char* place, const char* expected, Span found) {
  throw RuleError(rule, "JPEG", place, expected, std::to_string(found.size()) + " other bytes");
}

void append(Bytes& out, Span part) { out.insert(out.end(), part.begin(), part.end()); }

Span without_end(Span tables, const char* rule) {
  if (!begins_and_ends(tables)) fail(rule, "table stream", "SOI ... EOI", tables);
  return tables.first(tables.size() - kMarkerBytes);
}

Bytes join_jpeg(Span tables, Span stream) {
  const Span head = without_end(tables, "F05");
  if (!begins_and_ends(stream)) fail("F05", "fragment", "SOI ... EOI", stream);
  Bytes out;
  out.reserve(head.size() + stream.size());
  append(out, head);
  append(out, stream.subspan(kMarkerBytes));
  return out;
}

/// A stream that ends in a lone 0xFF would turn the EOI behind it into part of its data.
Bytes join_progressive(Span tables, std::span<const Span> streams) {
  Bytes out;
  append(out, without_end(tables, "F06"));
  const std::size_t head = out.size();
  for (const Span stream : streams) append(out, stream);
  if (out.size() == head || out.back() == 0xff) fail("F06", "fragment", "scans", Span(out).subspan(head));
  out.insert(out.end(), {0xff, kEnd});
  return out;
}

bool is_webp(Span file) {
  const auto text_at = [&](std::size_t at, std::string_view text) {
    return std::equal(text.begin(), text.end(), file.begin() + static_cast<std::ptrdiff_t>(at),
                      [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
  };
  return file.size() > kRiffHeader && text_at(0, "RIFF") && text_at(8, "WEBP");
}

}  // namespace

const CodecTraits& codec_traits(Codec codec) {
  static constexpr std::array<CodecTraits, 4> traits{
      CodecTraits{"jpeg", "", "jpg", "image/jpeg", false},
      CodecTraits{"jpeg-progressive", "codec-jpeg-progressive", "jpg", "image/jpeg", true},
      CodecTraits{"webp", "codec-webp", "webp", "image/webp", false},
      CodecTraits{"jpeg-xy", "codec-jpeg-xy", "jpg", "image/jpeg", false}};
  return traits.at(static_cast<std::size_t>(codec));
}

std::optional<Codec> find_codec(std::string_view id) {
  const auto& names = EnumNames<Codec>::names;
  const auto it = std::find(names.begin(), names.end(), id);
  if (it == names.end()) return std::nullopt;
  return static_cast<Codec>(it - names.begin());
}

bool is_table_stream(Codec codec, std::uint32_t rung, Span tables) {
  if (codec == Codec::kWebp || (codec == Codec::kJpegProgressive && rung > 0)) return tables.empty();
  return tables.size() > 2 * kMarkerBytes && begins_and_ends(tables);
}

Bytes join_fragment(Codec codec, Span tables, std::span<const Span> streams) {
  if (streams.empty() || (streams.size() > 1 && !codec_traits(codec).incremental))
    throw FormatError("fragment", "streams", "one, or those of all lower rungs for an incremental codec",
                      std::to_string(streams.size()));
  if (codec == Codec::kJpegProgressive) return join_progressive(tables, streams);
  if (codec != Codec::kWebp) return join_jpeg(tables, streams.front());
  if (!is_webp(streams.front()))
    throw RuleError("F07", "WebP", "fragment", "RIFF ... WEBP",
                    std::to_string(streams.front().size()) + " other bytes");
  return {streams.front().begin(), streams.front().end()};
}

Bytes join_fragment(Codec codec, Span tables, Span stream) {
  return join_fragment(codec, tables, std::span<const Span>(&stream, 1));
}

Bytes split_fragment(Codec codec, Span tables, Span file, std::uint64_t lower_bytes) {
  if (codec == Codec::kWebp) {
    if (!is_webp(file))
      throw FormatError("WebP", "file", "RIFF ... WEBP", std::to_string(file.size()) + " other bytes");
    return {file.begin(), file.end()};
  }
  const Span head = without_end(tables, is_baseline(codec) ? "F05" : "F06");
  if (file.size() < head.size() + kMarkerBytes || !marker_at(file, file.size() - kMarkerBytes, kEnd) ||
      !std::equal(head.begin(), head.end(), file.begin()))
    throw FormatError("JPEG", "byte 0", "the rung's table stream", "other bytes");
  const Span body = file.subspan(head.size());
  if (is_baseline(codec)) {
    Bytes out{0xff, kStart};
    append(out, body);
    return out;
  }
  if (lower_bytes > body.size() - kMarkerBytes)
    throw FormatError("JPEG", "file", "at least the bytes of the lower rungs", std::to_string(file.size()));
  const Span stream = body.subspan(static_cast<std::size_t>(lower_bytes));
  return {stream.begin(), stream.end() - kMarkerBytes};
}

}  // namespace texmesh
