#pragma once
#include <memory>

#include "format/container/container.h"
#include "pipeline/io/resolver.h"

namespace texmesh {

/// Most files of an archive that texmesh reads.
inline constexpr std::size_t kMaxArchiveFiles = 20'000;

/// A file of a ZIP archive.
struct ArchivedFile {
  std::string name;  // relative to the archive, slashes, UTF-8
  std::uint64_t header = 0, packed_bytes = 0, bytes = 0;
  std::uint32_t crc32 = 0;
  std::uint16_t method = 0;
};

/// The files of a ZIP archive, by name; its folders and what macOS adds (__MACOSX, .DS_Store) are left out.
/// Only the directory is read. InputError{archive, ...} for what is no ZIP archive or is cut; for more than
/// kMaxArchiveFiles; for encrypted files; for names that are absolute, lead out of the archive, or are there
/// twice; and for sizes that no packing gives, or that are more than `max_bytes` together.
std::vector<ArchivedFile> list_archive(ByteSource& archive, std::uint64_t max_bytes);

/// The number of the file that an archive is about: scene.gltf, or else the one with the best ending (.gltf,
/// .glb, .obj, .ply, .stl), of these the one least deep; of OpenDroneMap's two the georeferenced one. Nothing
/// without any. InputError where several are left.
std::optional<std::size_t> model_of_archive(const std::vector<ArchivedFile>& files,
                                            const std::string& archive);

/// Whether the archive of this path can be listed and has a model.
bool is_archive_of_model(const std::string& path);

/// The archive as the folder of its model. Names count from the model's folder; a name that is not there
/// means the one file of the whole archive with the same last part. Not thread-safe.
class ArchiveFiles : public Resolver {
 public:
  /// Keeps the bytes' span.
  ArchiveFiles(std::string archive, ByteSpan bytes, std::uint64_t max_bytes);
  /// "" without a model, see model_of_archive().
  const std::string& model() const { return model_; }
  const std::vector<ArchivedFile>& files() const { return files_; }
  /// A file by its whole name.
  Bytes unpacked(const ArchivedFile& file, std::uint64_t max_bytes);

  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override;
  std::vector<std::string> similar(const std::string& uri) override;

 private:
  std::string archive_, model_, folder_;
  std::unique_ptr<ByteSource> source_;
  std::vector<ArchivedFile> files_;
};

}  // namespace texmesh
