#include <cstring>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "pipeline/import/gltf/import_gltf_parts.h"
#include "stages/gltf/glb_container.h"

namespace texmesh::gltf {
namespace {

constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr int kMaxDepth = 64;
// A value costs at most a few hundred bytes in the parsers; real scans have some thousands.
constexpr std::uint64_t kMaxValues = 8'000'000;

std::uint32_t u32(ByteSpan bytes, std::size_t at) {
  std::uint32_t v = 0;
  std::memcpy(&v, bytes.data() + at, sizeof v);
  return v;
}

std::string_view text_of(ByteSpan bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void check_shape(const Source& source, std::string_view text) {
  const JsonShape shape = scan_json_shape(text_bytes(text), kMaxDepth);
  if (shape.too_deep)
    source.fail("byte " + std::to_string(*shape.too_deep), "JSON of at most 64 levels", "deeper nesting");
  if (shape.values > kMaxValues)
    source.fail("", "JSON of at most " + std::to_string(kMaxValues) + " values",
                std::to_string(shape.values));
}

}  // namespace

void Source::fail(const std::string& place, const std::string& expected, const std::string& found) const {
  throw InputError(file, place, expected, found);
}

void Source::note_once(Severity severity, const std::string& code, const std::string& place,
                       const std::string& text) const {
  for (const Note& n : notes) {
    if (n.code == code) return;
  }
  notes.push_back({severity, code, place, text});
}

Container split_container(const Source& source, ByteSpan bytes) {
  Container c;
  if (bytes.size() < 4 || text_of(bytes.first(4)) != "glTF") {
    c.json = text_of(bytes);
    return c;
  }
  c.is_glb = true;
  if (bytes.size() < kHeaderBytes) {
    source.fail("GLB header", "12 bytes", std::to_string(bytes.size()));
  }
  if (u32(bytes, 4) != 2) source.fail("GLB header", "version 2", std::to_string(u32(bytes, 4)));
  const std::uint32_t length = u32(bytes, 8);
  if (length > bytes.size()) {
    source.fail("GLB header", "a file of " + std::to_string(length) + " bytes", std::to_string(bytes.size()));
  }
  if (length < bytes.size()) {
    add_warning(source.notes, "trailing-bytes", "byte " + std::to_string(length),
                "the file goes on after the end that its header declares");
  }
  bool has_json = false;
  for (std::size_t at = kHeaderBytes; at < length && !(has_json && c.bin);) {
    const std::string place = "GLB chunk at byte " + std::to_string(at);
    if (length - at < kChunkHeaderBytes) source.fail(place, "8 bytes", std::to_string(length - at));
    const std::uint32_t chunk_bytes = u32(bytes, at), type = u32(bytes, at + 4);
    at += kChunkHeaderBytes;
    if (chunk_bytes > length - at) {
      source.fail(place, "at most " + std::to_string(length - at) + " bytes", std::to_string(chunk_bytes));
    }
    const ByteSpan chunk = bytes.subspan(at, chunk_bytes);
    if (!has_json) {
      if (type != kGlbJsonChunk) source.fail(place, "a JSON chunk first", "another type");
      c.json = text_of(chunk);
      has_json = true;
    } else if (type == kGlbBinaryChunk) {
      c.bin = chunk;
    }
    at += chunk_bytes;
  }
  if (!has_json) source.fail("byte 12", "a JSON chunk", "the end of the file");
  // Padding must be blanks; some exporters write zeros.
  while (!c.json.empty() && c.json.back() == '\0') c.json.remove_suffix(1);
  return c;
}

Json parse_json(const Source& source, std::string_view text) {
  check_shape(source, text);
  try {
    Json document = Json::parse(text);
    if (!document.is_object()) source.fail("", "a JSON object", document.type_name());
    return document;
  } catch (const Json::parse_error& e) {
    source.fail("byte " + std::to_string(e.byte), "JSON", "a syntax error or the end of the text");
  } catch (const Json::exception&) {
    source.fail("", "numbers that fit a double", "a larger one");
  }
}

}  // namespace texmesh::gltf
