#pragma once
#include <cstdint>
#include <vector>

#include "stages/data/pixels.h"

namespace texmesh {

enum class FileImage : std::uint8_t { kJpeg, kWebp, kPng };

/// An image as a file holds it.
struct FileImageData {
  FileImage format = FileImage::kJpeg;
  std::vector<std::uint8_t> bytes;
};

/// "image/jpeg", "image/webp", "image/png".
const char* mime_type_of(FileImage format);

/// How an image of a standalone file is coded.
struct ImageCoding {
  FileImage format = FileImage::kJpeg;
  double quality = 75;  // JPEG 1..100, WebP 0..100; no meaning for PNG
  bool data = false;    // numbers (normals, roughness ..) instead of colours: JPEGs keep their channels apart
  bool quick = false;   // WebP: a third of the time for some percent more bytes, for searches
  bool full_chroma = false;  // JPEG: colours 4:4:4, with tables for textures
};

/// A complete image file of 1, 3 or 4 channels (grey becomes RGB in a WebP; 4 channels are for PNG and WebP
/// alone). JPEG: progressive, with Huffman tables of its own, colours 4:2:0 or 4:4:4. WebP: lossy, with alpha
/// coded nearly without loss. Same bytes for same input. StageError for what the format cannot hold.
std::vector<std::uint8_t> encode_image(const Pixels& pixels, const ImageCoding& coding);

}  // namespace texmesh
