#include <nlohmann/json.hpp>

#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/io/uri.h"

namespace texmesh::gltf {
namespace {

std::uint64_t size_of(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? 0 : it->get<std::uint64_t>();
}

std::string string_of(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? std::string() : it->get<std::string>();
}

/// Of either name; the name goes to `name`.
const Json* meshopt_extension(const Json& view, std::string& name) {
  const auto e = view.find("extensions");
  if (e == view.end() || !e->is_object()) return nullptr;
  for (const char* known : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    const auto m = e->find(known);
    if (m == e->end() || m->is_null()) continue;
    name = known;
    return &*m;
  }
  return nullptr;
}

MeshoptMode mode_of(const std::string& name) {
  if (name == "ATTRIBUTES") return MeshoptMode::kAttributes;
  return name == "TRIANGLES" ? MeshoptMode::kTriangles : MeshoptMode::kIndices;
}

MeshoptFilter filter_of(const std::string& name) {
  if (name == "OCTAHEDRAL") return MeshoptFilter::kOctahedral;
  if (name == "QUATERNION") return MeshoptFilter::kQuaternion;
  if (name == "COLOR") return MeshoptFilter::kColour;
  return name == "EXPONENTIAL" ? MeshoptFilter::kExponential : MeshoptFilter::kNone;
}

}  // namespace

Buffers::Buffers(const Source& source, const Json& document, std::optional<ByteSpan> bin)
    : source_(source), document_(document), bin_(bin) {
  if (const auto it = document_.find("buffers"); it != document_.end()) buffers_.resize(it->size());
  if (const auto it = document_.find("bufferViews"); it != document_.end()) views_.resize(it->size());
}

ByteSpan Buffers::buffer(std::size_t index) {
  const Json& declared = document_["buffers"][index];
  const std::uint64_t length = size_of(declared, "byteLength");
  const std::string place = "/buffers/" + std::to_string(index);
  const auto max_bytes = static_cast<std::uint64_t>(source_.options.max_file_bytes);
  ByteSpan bytes;
  if (!declared.contains("uri")) {
    if (index != 0 || !bin_) source_.fail(place, "a \"uri\" or the BIN chunk of a GLB", "neither");
    bytes = *bin_;
  } else {
    if (!buffers_[index]) {
      const std::string uri = string_of(declared, "uri");
      if (is_data_uri(uri)) {
        buffers_[index] = decode_data_uri(uri, max_bytes, source_.file, place + "/uri");
      } else {
        const std::string name = decode_uri(uri, source_.file, place + "/uri");
        try {
          buffers_[index] = source_.resolver.read(name, max_bytes);
        } catch (const InputError& e) {
          source_.fail(place + "/uri", e.expected(), e.found() + " (" + name + ")");
        }
        if (!buffers_[index]) source_.fail(place + "/uri", "the file " + name, "no such file");
      }
    }
    bytes = *buffers_[index];
  }
  if (length > bytes.size()) {
    source_.fail(place + "/byteLength", "at most " + std::to_string(bytes.size()), std::to_string(length));
  }
  return bytes.first(length);
}

ByteSpan Buffers::range(std::size_t buffer_index, std::uint64_t offset, std::uint64_t length,
                        const std::string& place) {
  const ByteSpan bytes = buffer(buffer_index);
  if (offset > bytes.size() || length > bytes.size() - offset) {
    source_.fail(place, "a range within the " + std::to_string(bytes.size()) + " bytes of its buffer",
                 std::to_string(length) + " bytes at " + std::to_string(offset));
  }
  return bytes.subspan(offset, length);
}

std::vector<std::uint8_t> Buffers::decompressed(const Json& extension, const std::string& place) {
  const std::uint64_t count = size_of(extension, "count"), stride = size_of(extension, "byteStride");
  const auto max_bytes = static_cast<std::uint64_t>(source_.options.max_file_bytes);
  // All views together, since many of them may share one range of bytes.
  if (count > (max_bytes - decompressed_bytes_) / stride) {
    source_.fail(place, "at most " + std::to_string(max_bytes) + " bytes when decompressed",
                 std::to_string(count) + " elements of " + std::to_string(stride) + " bytes");
  }
  decompressed_bytes_ += count * stride;
  const ByteSpan data = range(extension["buffer"].get<std::size_t>(), size_of(extension, "byteOffset"),
                              size_of(extension, "byteLength"), place);
  return decode_meshopt(source_, place, data, count, stride, mode_of(string_of(extension, "mode")),
                        filter_of(string_of(extension, "filter")));
}

ByteSpan Buffers::view(std::size_t index, const std::string& place) {
  if (index >= views_.size()) source_.fail(place, "an element of /bufferViews", std::to_string(index));
  const Json& declared = document_["bufferViews"][index];
  const std::string view_place = "/bufferViews/" + std::to_string(index);
  std::string name;
  if (const Json* extension = meshopt_extension(declared, name)) {
    if (!views_[index]) views_[index] = decompressed(*extension, view_place + "/extensions/" + name);
    return *views_[index];
  }
  return range(declared["buffer"].get<std::size_t>(), size_of(declared, "byteOffset"),
               size_of(declared, "byteLength"), view_place);
}

}  // namespace texmesh::gltf
