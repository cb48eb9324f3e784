#pragma once
#include "tools/extract/extract.h"

namespace texmesh {

/// A package of Universal Scene Description, as phones show it.
struct Usdz {
  Bytes file;
  std::vector<std::string> notes;  // what had to change, for people
};

/// A file of extract_files() as USDZ 1.3: an uncompressed ZIP of a crate and its images, all at multiples of
/// 64 bytes. Materials become UsdPreviewSurface, JPEG and PNG stay as they are, WebP and AVIF become JPEG, or
/// PNG where they have alpha. What is known of the object, in the frame of the file (transformed_about()),
/// stands in the layer's metadata; y is up. InputError for what that surface cannot say: extensions of
/// materials beyond emissive strength, index of refraction and clearcoat; vertex colours beside a texture;
/// levels of detail. Same bytes for any thread count.
Usdz usdz_of(const Extracted& extracted, const About& about, const std::string& entry,
             const RunContext& context);

/// Extracted files, each as USDZ in the place of its GLB. With numbers of bytes: the largest of a few files
/// that keep within them; they are compared as the GLBs are, and need not reach 98 %. WebP and AVIF become
/// JPEG or PNG, and a note says so. InputError for levels of detail.
std::vector<Extracted> extract_usdz(PackageReader& package, ExtractRequest request,
                                    const RunContext& context);

}  // namespace texmesh
