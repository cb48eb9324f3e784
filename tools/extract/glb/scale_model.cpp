#include "tools/extract/glb/scale_model.h"

#include <map>

#include "format/base/bytes.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {
Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context) {
  std::map<std::uint32_t, FileImageData> images;
  for (const std::uint32_t i : file.source_images()) {
    const auto byte = [i](int shift) { return static_cast<std::uint8_t>(i >> shift); };
    images[i] = {FileImage::kPng, encode_image({1, 1, 3, {byte(0), byte(8), byte(16)}}, {FileImage::kPng})};
  }
  file.set_images(images);
  NoFiles none;
  return import_package_glb(entry, file.finish(), none, context).model;
}

std::string image_name(std::uint32_t image) { return std::to_string(image); }

}  // namespace texmesh
