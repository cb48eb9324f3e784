// From accessors to bytes: the buffers of a glTF, views into them, and elements in the views.
#include <tiny_gltf.h>

#include <nlohmann/json.hpp>

#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"
#include "stages/gltf/decode_meshopt.h"

namespace texmesh {
Buffers::Buffers(const Source& source, const GltfJson& document, const tinygltf::Model& structure,
                 std::optional<ByteSpan> bin)
    : source_(source), document_(document), structure_(structure), bin_(bin) {
  if (const auto it = document_.find("buffers"); it != document_.end()) buffers_.resize(it->size());
  views_.resize(structure.bufferViews.size());
}

ByteSpan Buffers::buffer(std::size_t index) {
  const GltfJson& declared = document_["buffers"][index];
  const std::uint64_t length = declared["byteLength"];
  const std::string place = "/buffers/" + std::to_string(index);
  const auto max_bytes = static_cast<std::uint64_t>(source_.options.max_file_bytes);
  ByteSpan bytes;
  if (!declared.contains("uri")) {
    if (index != 0 || !bin_) source_.fail(place, "a \"uri\" or the BIN chunk of a GLB", "neither");
    bytes = *bin_;
  } else {
    if (!buffers_[index]) {
      const std::string uri = declared["uri"];
      if (is_data_uri(uri)) {
        buffers_[index] = decode_data_uri(uri, max_bytes, source_.file, place + "/uri");
      } else {
        NamedFile file;
        try {
          file = find_file({uri, "", true}, source_.resolver, max_bytes, source_.notes, place + "/uri");
        } catch (const ResourceError&) {
          throw;
        } catch (const InputError& e) {  // it knows the name alone
          source_.fail(place + "/uri", e.expected(), e.found() + " (" + e.file() + ")");
        }
        if (!file.bytes)
          source_.fail(place + "/uri", "the file " + quote(uri), "no such file: " + file.looked_for);
        buffers_[index] = std::move(file.bytes);
      }
    }
    bytes = *buffers_[index];
  }
  if (length > bytes.size()) {
    if (const std::string foreign = foreign_file(bytes); !foreign.empty())
      source_.fail(place, "a buffer of " + std::to_string(length) + " bytes", foreign);
    source_.note_once(Severity::kWarning, "short-buffer", place + "/byteLength",
                      "the buffer has " + std::to_string(bytes.size()) + " bytes, " + std::to_string(length) +
                          " were said; what lies within them is read");
  }
  return bytes.first(std::min<std::uint64_t>(length, bytes.size()));
}

ByteSpan Buffers::range(std::size_t buffer_index, std::uint64_t offset, std::uint64_t length,
                        const std::string& place) {
  const ByteSpan bytes = buffer(buffer_index);
  if (offset > bytes.size() || length > bytes.size() - offset) {
    source_.fail(place,
                 "a range within the " + std::to_string(bytes.size()) + " bytes of /buffers/" +
                     std::to_string(buffer_index) + " (a file that is cut off has fewer)",
                 std::to_string(length) + " bytes at " + std::to_string(offset));
  }
  return bytes.subspan(offset, length);
}

std::vector<std::uint8_t> Buffers::decompressed(const GltfJson& extension, const std::string& place) {
  const std::uint64_t count = extension["count"], stride = extension["byteStride"];
  const auto max_bytes = static_cast<std::uint64_t>(source_.options.max_file_bytes);
  // All views together, since many of them may share one range of bytes.
  if (count > (max_bytes - decompressed_bytes_) / stride) {
    source_.fail(place, "at most " + std::to_string(max_bytes) + " bytes when decompressed",
                 std::to_string(count) + " elements of " + std::to_string(stride) + " bytes");
  }
  decompressed_bytes_ += count * stride;
  const ByteSpan data = range(extension["buffer"], extension.value("byteOffset", std::uint64_t{0}),
                              extension["byteLength"], place);
  const std::string name = extension.value("filter", "NONE");
  const auto filter = meshopt_filter(name);
  const bool has_colours = place.find("/KHR_") != place.npos;
  if (!filter || (filter == MeshoptFilter::kColour && !has_colours))
    source_.fail(place + "/filter", "a filter of the extension", name.substr(0, 80));
  const auto mode = meshopt_mode(extension["mode"].get<std::string>());
  return decode_meshopt(
      {data, count, stride, mode.value_or(MeshoptMode::kIndices), *filter},
      [&](const std::string& expected, const std::string& found) { source_.fail(place, expected, found); });
}

ByteSpan Buffers::view(std::size_t index, const std::string& place) {
  if (index >= views_.size()) source_.fail(place, "an element of /bufferViews", std::to_string(index));
  const std::string view_place = "/bufferViews/" + std::to_string(index);
  if (const GltfJson& declared = document_["bufferViews"][index]; declared.contains("extensions")) {
    const GltfJson& extensions = declared["extensions"];
    const bool old = extensions.contains("EXT_meshopt_compression");
    const char* name = old ? "EXT_meshopt_compression" : "KHR_meshopt_compression";
    if (old && extensions.contains("KHR_meshopt_compression"))
      source_.fail(view_place + "/extensions", "one of EXT_ and KHR_meshopt_compression", "both");
    if (extensions.contains(name)) {
      if (!views_[index]) views_[index] = decompressed(extensions[name], view_place + "/extensions/" + name);
      return *views_[index];
    }
  }
  const tinygltf::BufferView& declared = structure_.bufferViews[index];
  return range(static_cast<std::size_t>(declared.buffer), declared.byteOffset, declared.byteLength,
               view_place);
}

namespace {

std::uint32_t load_index(const std::uint8_t* at, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return value_at<std::uint8_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return value_at<std::uint16_t>(at);
    default:
      return value_at<std::uint32_t>(at);
  }
}

float load_float(const std::uint8_t* at, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const float v = value_at<std::int8_t>(at);
      return normalized ? std::max(v / 127.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: {
      const float v = value_at<std::uint8_t>(at);
      return normalized ? v / 255.0f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const float v = value_at<std::int16_t>(at);
      return normalized ? std::max(v / 32767.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const float v = value_at<std::uint16_t>(at);
      return normalized ? v / 65535.0f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: {
      const auto v = value_at<std::uint32_t>(at);
      return normalized ? static_cast<float>(v / 4294967295.0) : static_cast<float>(v);
    }
    default:
      return value_at<float>(at);
  }
}

/// Checks that `count` elements of `element_bytes`, `stride` apart, lie within a view.
void check_extent(const Source& source, const std::string& place, ByteSpan view, std::uint64_t offset,
                  std::uint64_t count, std::uint64_t stride, std::uint64_t element_bytes) {
  if (count == 0) return;
  const std::uint64_t room = view.size() < offset ? 0 : view.size() - offset;
  if (room < element_bytes || (count - 1) > (room - element_bytes) / stride) {
    source.fail(place,
                std::to_string(count) + " elements of " + std::to_string(element_bytes) +
                    " bytes from byte " + std::to_string(offset),
                "a bufferView of " + std::to_string(view.size()) + " bytes");
  }
}

}  // namespace

AccessorReader::AccessorReader(const Source& source, const tinygltf::Model& model, Buffers& buffers,
                               std::size_t index) {
  const std::string place = "/accessors/" + std::to_string(index);
  const tinygltf::Accessor& a = model.accessors[index];
  count_ = a.count;
  component_type_ = a.componentType;
  normalized_ = a.normalized;
  components_ = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type));
  component_bytes_ = static_cast<std::size_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType)));
  if (a.type == TINYGLTF_TYPE_MAT2 || a.type == TINYGLTF_TYPE_MAT3 || a.type == TINYGLTF_TYPE_MAT4) {
    source.fail(place + "/type", "a scalar or a vector", "a matrix");
  }
  const std::size_t element_bytes = component_bytes_ * static_cast<std::size_t>(components_);
  stride_ = element_bytes;
  if (a.bufferView >= 0) {
    const auto view_index = static_cast<std::size_t>(a.bufferView);
    const ByteSpan view = buffers.view(view_index, place);
    const std::size_t declared = model.bufferViews[view_index].byteStride;
    if (declared != 0 && declared < element_bytes) {
      source.fail("/bufferViews/" + std::to_string(view_index) + "/byteStride",
                  "at least the " + std::to_string(element_bytes) + " bytes of an element",
                  std::to_string(declared));
    }
    if (declared != 0) stride_ = declared;
    check_extent(source, place, view, a.byteOffset, count_, stride_, element_bytes);
    base_ = view.data() + (count_ ? a.byteOffset : 0);
  }
  if (!a.sparse.isSparse) return;
  const std::string sparse_place = place + "/sparse";
  const auto n = static_cast<std::size_t>(a.sparse.count);
  if (n > count_)
    source.fail(sparse_place + "/count", "at most " + std::to_string(count_), std::to_string(n));
  const ByteSpan indices = buffers.view(static_cast<std::size_t>(a.sparse.indices.bufferView), sparse_place);
  const ByteSpan values = buffers.view(static_cast<std::size_t>(a.sparse.values.bufferView), sparse_place);
  const int type = a.sparse.indices.componentType;
  const auto index_bytes =
      static_cast<std::size_t>(tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(type)));
  const auto index_offset = static_cast<std::size_t>(a.sparse.indices.byteOffset);
  const auto value_offset = static_cast<std::size_t>(a.sparse.values.byteOffset);
  check_extent(source, sparse_place + "/indices", indices, index_offset, n, index_bytes, index_bytes);
  check_extent(source, sparse_place + "/values", values, value_offset, n, element_bytes, element_bytes);
  sparse_indices_.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t at = load_index(indices.data() + index_offset + i * index_bytes, type);
    if (at >= count_ || (i > 0 && at <= sparse_indices_.back())) {
      source.fail(sparse_place + "/indices", "increasing indices below " + std::to_string(count_),
                  std::to_string(at) + " at " + std::to_string(i));
    }
    sparse_indices_.push_back(at);
  }
  if (n > 0) sparse_values_ = values.data() + value_offset;
}

const std::uint8_t* AccessorReader::element_at(std::size_t element) const {
  if (sparse_values_) {
    const auto it = std::lower_bound(sparse_indices_.begin(), sparse_indices_.end(), element);
    if (it != sparse_indices_.end() && *it == element) {
      const auto i = static_cast<std::size_t>(it - sparse_indices_.begin());
      return sparse_values_ + i * component_bytes_ * static_cast<std::size_t>(components_);
    }
  }
  return base_ ? base_ + element * stride_ : nullptr;
}

float AccessorReader::step() const {
  if (component_type_ == TINYGLTF_COMPONENT_TYPE_FLOAT) return 0;
  if (!normalized_) return 1;
  const bool is_signed =
      component_type_ == TINYGLTF_COMPONENT_TYPE_BYTE || component_type_ == TINYGLTF_COMPONENT_TYPE_SHORT;
  return 1.0f / static_cast<float>((std::uint64_t{1} << (8 * component_bytes_ - is_signed)) - 1);
}

void AccessorReader::read(std::size_t element, float* out) const {
  const std::uint8_t* at = element_at(element);
  for (int i = 0; i < components_; ++i) {
    out[i] =
        at ? load_float(at + static_cast<std::size_t>(i) * component_bytes_, component_type_, normalized_)
           : 0;
  }
}

std::uint32_t AccessorReader::read_index(std::size_t element) const {
  const std::uint8_t* at = element_at(element);
  return at ? load_index(at, component_type_) : 0;
}

}  // namespace texmesh
