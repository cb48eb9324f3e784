#pragma once

#include <unordered_map>

#include "format/base/note.h"
#include "format/container/container.h"
#include "format/documents/about.h"
#include "pipeline/io/resolver.h"

namespace texmesh {

/// Most files of an archive that texmesh reads.
inline constexpr std::size_t kMaxArchiveFiles = 20'000;
/// For list_archive(): files of any size.
inline constexpr std::uint64_t kAnyArchiveSize = std::uint64_t{1} << 62;

/// A file of a ZIP archive.
struct ArchivedFile {
  std::string name;        // relative to the archive, slashes, UTF-8
  std::string other_name;  // of a name that was no UTF-8: as if it were Windows-1252
  bool is_link = false;    // a symbolic link, which is not followed
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
  ArchiveFiles(std::unique_ptr<ByteSource> source, std::uint64_t max_bytes);
  /// "" without a model, see model_of_archive().
  const std::string& model() const { return model_; }
  const std::vector<ArchivedFile>& files() const { return files_; }
  /// A file by its whole name.
  Bytes unpacked(const ArchivedFile& file, std::uint64_t max_bytes);

  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override;
  std::vector<std::string> similar(const std::string& uri) override;

 private:
  /// similar_key() of the name from the model's folder; "" for a file elsewhere.
  std::string key_below(const ArchivedFile& file) const;
  std::string archive_, model_, folder_;
  std::unique_ptr<ByteSource> source_;
  std::vector<ArchivedFile> files_;
  // Numbers of files by whole name, by last part, by similar_key() from the model's folder and of the last
  // part: a model may name as many files as there are.
  using Numbers = std::unordered_map<std::string, std::vector<std::size_t>>;
  std::unordered_map<std::string, std::size_t> by_name_;
  Numbers by_last_, by_key_, by_last_key_;
};

/// What an archive says of its model beside it: Sketchfab's license.txt (title, author, source, licence,
/// credit), and of OpenDroneMap's textured models metres, z as up axis, and the coordinate reference that
/// coords.txt or proj.txt names. `model`: the model's name in the archive.
About archive_about(ArchiveFiles& archive, const std::string& model, Notes& notes);

/// The archive's file of notes, by name and bytes: annotations.json, else Voyager's NAME.svx.json, the least
/// deep. Nothing where it has none. InputError where it cannot be unpacked.
std::optional<std::pair<std::string, Bytes>> archived_annotations(ArchiveFiles& archive);

}  // namespace texmesh
