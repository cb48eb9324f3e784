// A fixed amount of coding, which no change of texmesh makes more or less: ten JPEGs of every image of a
// model with libjpeg-turbo at qualities 10 to 97, and Draco over nine meshes, each of half the triangles of
// the one before. One thread; prints CPU seconds of both as one JSON object. Reading, decoding and halving do
// not count.
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <iostream>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg_coder.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file

constexpr int kQualities[] = {10, 20, 30, 40, 50, 60, 70, 80, 90, 97};
constexpr int kMeshes = 9;
constexpr int kDracoLevel = 7;  // the default of scales.draco_level
constexpr int kPositionBits = 14, kUvBits = 12, kNormalBits = 10;

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

struct CodingCost {
  double cpu_s = 0;
  std::size_t files = 0, bytes = 0;
};

/// JPEG has no alpha, and no images of two channels.
Pixels without_alpha(Pixels image) {
  const std::uint32_t kept = image.channels >= 3 ? 3 : 1;
  if (image.channels == kept) return image;
  Pixels out{image.width_px, image.height_px, kept, {}};
  for (std::size_t i = 0; i < image.data.size(); i += image.channels)
    out.data.insert(out.data.end(), image.data.begin() + static_cast<std::ptrdiff_t>(i),
                    image.data.begin() + static_cast<std::ptrdiff_t>(i + kept));
  return out;
}

CodingCost code_images(const std::vector<Image>& images) {
  CodingCost cost;
  for (const Image& image : images) {
    const Pixels p = without_alpha(decode_image(image));
    const double start = cpu_seconds();
    for (const int quality : kQualities) {
      JpegCoder coder({p.channels, quality, Subsampling::k420});
      cost.bytes +=
          coder.complete({p.data.data(), std::size_t{p.width_px} * p.channels, p.width_px, p.height_px})
              .size();
      ++cost.files;
    }
    cost.cpu_s += cpu_seconds() - start;
  }
  return cost;
}

template <class Value>
int add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, const std::vector<Value>& values) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, sizeof(Value) / sizeof(float), draco::DT_FLOAT32, false, sizeof(Value), 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(values.size()));
  for (std::uint32_t i = 0; i < values.size(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[i]);
  return id;
}

std::vector<Vec3f> wedge_positions(const Mesh& mesh) {
  std::vector<Vec3f> out;
  for (const std::uint32_t p : mesh.wedge_position) out.push_back(mesh.positions[p]);
  return out;
}

std::size_t coded_bytes(const Mesh& mesh, const std::vector<Vec3f>& positions,
                        const std::vector<std::uint32_t>& indices) {
  draco::Mesh out;
  out.set_num_points(static_cast<std::uint32_t>(positions.size()));
  out.SetNumFaces(indices.size() / 3);
  for (std::uint32_t f = 0; f < indices.size() / 3; ++f) {
    const std::uint32_t* corner = indices.data() + std::size_t{3} * f;
    out.SetFace(draco::FaceIndex(f),
                {draco::PointIndex(corner[0]), draco::PointIndex(corner[1]), draco::PointIndex(corner[2])});
  }
  std::vector<std::pair<int, int>> bits;  // attribute, its bits
  bits.emplace_back(add_attribute(out, draco::GeometryAttribute::POSITION, positions), kPositionBits);
  if (!mesh.uv0.empty())
    bits.emplace_back(add_attribute(out, draco::GeometryAttribute::TEX_COORD, mesh.uv0), kUvBits);
  if (!mesh.normals.empty())
    bits.emplace_back(add_attribute(out, draco::GeometryAttribute::NORMAL, mesh.normals), kNormalBits);
  out.DeduplicateAttributeValues();
  out.DeduplicatePointIds();
  draco::ExpertEncoder encoder(out);
  encoder.SetSpeedOptions(10 - kDracoLevel, 10 - kDracoLevel);
  for (const auto& [attribute, n] : bits) encoder.SetAttributeQuantization(attribute, n);
  draco::EncoderBuffer buffer;
  if (const draco::Status s = encoder.EncodeToBuffer(&buffer); !s.ok())
    throw StageError("yardstick", "draco", "a mesh that codes", s.error_msg_string());
  return buffer.size();
}

CodingCost code_meshes(const Mesh& mesh) {
  std::vector<std::uint32_t> indices;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) indices.push_back(t[k]);
  const std::vector<Vec3f> positions = wedge_positions(mesh);
  CodingCost cost;
  for (int i = 0; i < kMeshes && indices.size() >= 3; ++i) {
    const double start = cpu_seconds();
    cost.bytes += coded_bytes(mesh, positions, indices);
    cost.cpu_s += cpu_seconds() - start;
    ++cost.files;
    // Sloppy: seams of an atlas stop the other way long before the ninth mesh.
    std::vector<std::uint32_t> half(indices.size());
    half.resize(meshopt_simplifySloppy(half.data(), indices.data(), indices.size(), &positions[0].x,
                                       positions.size(), sizeof(Vec3f), indices.size() / 6 * 3, 1.f,
                                       nullptr));
    indices = std::move(half);
  }
  return cost;
}

int measure(int argc, char** argv) {
  std::string input;
  CLI::App app("Codes a model's images and meshes with the bare codecs and prints the CPU seconds.");
  app.add_option("input", input, "model")->required();
  CLI11_PARSE(app, argc, argv);
  const std::filesystem::path path(input);
  FileResolver resolver(path.parent_path());
  const ImportedModel model = import_model(path.filename().string(), read_input_file(input, 1ull << 32),
                                           resolver, {}, {1, {}, nullptr});
  const CodingCost images = code_images(model.model.images), meshes = code_meshes(model.model.mesh);
  std::printf(
      "{\"cpu_s\": %.6f, \"jpeg_cpu_s\": %.6f, \"jpegs\": %zu, \"jpeg_bytes\": %zu, \"draco_cpu_s\": %.6f, "
      "\"meshes\": %zu, \"draco_bytes\": %zu}\n",
      images.cpu_s + meshes.cpu_s, images.cpu_s, images.files, images.bytes, meshes.cpu_s, meshes.files,
      meshes.bytes);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return measure(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "yardstick_bench: " << e.what() << '\n';
    return 1;
  }
}
