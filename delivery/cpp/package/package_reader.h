#pragma once
#include <functional>
#include <map>

#include "format/container/container.h"
#include "format/documents/annotations.h"
#include "format/documents/manifest.h"
#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"
#include "format/documents/thesis_tables.h"
#include "format/split/split_stream.h"

namespace texmesh {

class Findings;

/// A rung beyond the last one stands for the last one.
inline constexpr std::uint32_t kBestRung = 0xffffffffu;

/// Where a package's entries come from: a .texmesh file (or anything that serves ranges of one), or the same
/// tree unpacked into a folder.
class PackageStore {
 public:
  virtual ~PackageStore() = default;
  virtual std::string name() const = 0;  // for errors
  virtual bool is_folder() const = 0;
  /// The bytes of manifest.json. From a container this is one read of kBootstrapBytes at offset 0.
  virtual Bytes read_manifest() = 0;
  /// Exactly `bytes` bytes from `offset` within an entry. A container goes by entry.offset, a folder by
  /// entry.path. FormatError when they are not there.
  virtual Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) = 0;
  /// These will be read soon, in whole: a server is asked for all of them at once. Errors as of read().
  virtual void prefetch(const std::vector<EntryRef>&) {}
  /// What is really there, manifest.json and index.bin included: a container's entries in file order (every
  /// rule of the profile checked), a folder's regular files by path (offsets and CRCs are 0). FormatError on
  /// anything else in it.
  virtual std::vector<ContainerEntry> list() = 0;
};
/// The most bytes that an entry of this path may have; what says that it has more is not to be believed.
/// Meshes and packs are bounded by what the reader's store allows.
std::uint64_t most_entry_bytes(const std::string& path);
std::unique_ptr<PackageStore> open_container(std::unique_ptr<ByteSource> source);
/// InputError when there is no such folder. No symbolic link beneath the folder is followed.
std::unique_ptr<PackageStore> open_folder(const std::string& path);
/// An http or https URL (http_store.h), a folder or a file, by what `path` is.
std::unique_ptr<PackageStore> open_store(const std::string& path);

/// Reads a package on demand. The constructor reads the manifest only; index, textures and tables are read
/// when they are first asked for. Everything handed out has been checked: entries against their SHA-256,
/// fragments against the truncated digest in the tables, documents against each other. FormatError says what
/// does not fit. Not thread-safe.
class PackageReader {
 public:
  explicit PackageReader(std::unique_ptr<PackageStore> store);
  PackageStore& store() { return *store_; }
  const Manifest& manifest() const { return manifest_; }
  /// Package id: SHA-256 of the bytes of manifest.json.
  const Sha256& id() const { return id_; }

  /// Every entry that clients read, but manifest.json and index.bin, in container order.
  const std::vector<EntryRef>& index();
  /// The same with the files for viewers of glTF, whose index is read anew.
  std::vector<EntryRef> entries();
  const EntryRef& find(const std::string& path);  // FormatError when the index has no such entry
  const std::vector<TextureInfo>& textures();     // refs resolved
  const PackageTables& tables();                  // one element per texture plane, consistent with textures()
  const QualityTable& quality();                  // of the manifest's scales and the planes' groups
  const About& about();
  /// The notes of annotations.json; empty where the package has none.
  const Annotations& annotations();
  /// What the thesis's policy reads of a plane, from thesis.bin; nullptr where the package says nothing of
  /// it.
  const PlaneThesis* plane_thesis(std::size_t plane);
  /// How much any two scales differ, from thesis.bin; nullptr where the package does not say.
  const PerceptualTable* perceptual_table();

  Bytes entry(const EntryRef& ref);
  Bytes entry(const std::string& path) { return entry(find(path)); }
  /// The GLB of a scale, as it is stored; needs no index. InputError where the scale has none: then
  /// split_prefix() has it. Images of all but the coarsest scale's may be relative URIs of previews.
  Bytes scale_glb(int scale);
  /// A proxy's GLB, which stands alone; needs no index. 0 = the smallest. InputError where there is none.
  Bytes proxy_glb(std::size_t proxy);
  /// The bytes of the vertex-split stream that hold a scale without a GLB: head and blocks, digest checked.
  Bytes split_prefix(int scale);
  /// Index into manifest().scales. Without such a scale: InputError that names the scales there are.
  std::size_t scale_index(int scale) const;
  const EntryRef& scale_entry(int scale) const { return manifest_.scales[scale_index(scale)].glb; }
  /// Head of the vertex-split stream, needs no index; FormatError when the package has none. Blocks are read
  /// with store() or entry(kSplitStreamPath).
  SplitStreamHead split_stream_head();
  Bytes preview(std::uint32_t plane);
  /// The plane's source image as it was; FormatError when the package does not keep it as a file.
  Bytes source(std::uint32_t plane);
  Bytes table_stream(std::uint32_t plane, std::uint32_t rung);
  /// Where a fragment's stream stands within its rung's entry; bytes 0 = not stored.
  ByteRange fragment_range(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment);
  Bytes fragment(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment);
  /// The image file, of the plane's codec, that any decoder takes: table stream and fragment joined; for
  /// incremental codecs with the streams of the lower rungs between them.
  Bytes complete_fragment(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment);

 private:
  [[noreturn]] void refuse(const char* rule, const std::string& place, const std::string& expected,
                           const std::string& found) const;
  /// Refuses the package by the first finding of a check.
  void require(const std::function<void(Findings&)>& check) const;
  Bytes read_paged(const PagedRef& ref);
  void require_head(const PagedRef& ref, std::uint64_t head_bytes) const;
  void require_minor(const std::string& path, int minor) const;
  const ThesisTables* thesis();
  ThesisTables read_thesis_entry();
  const TextureInfo& texture(std::uint32_t plane);
  std::unique_ptr<PackageStore> store_;
  Manifest manifest_;
  Sha256 id_{};
  std::optional<std::vector<EntryRef>> index_;
  std::optional<std::vector<TextureInfo>> textures_;
  std::optional<PackageTables> tables_;
  std::optional<QualityTable> quality_;
  std::optional<ThesisTables> thesis_;
  std::optional<About> about_;
  std::optional<Annotations> annotations_;
  // [plane][rung][fragment]: running sums of sizes in PlaneTables::order
  std::vector<std::vector<std::vector<std::uint64_t>>> fragment_offsets_;
  std::map<std::uint32_t, Bytes> table_streams_;  // by plane
};

/// The step function: the scale to show an object at that is `displayed_px` pixels high on screen.
int select_scale(const Manifest& manifest, double displayed_px);

/// The streams of one plane while its packs are gone through. Keeps lower packs only where the codec's upper
/// rungs need them. Sizes are checked; contents are not.
class PlaneStreams {
 public:
  /// `table_pack`: the table streams of all rungs. FormatError when it has another size than the tables say.
  PlaneStreams(Codec codec, const PlaneTables& tables, Bytes table_pack);
  /// A rung's pack; with an incremental codec from the lowest rung upwards. FormatError when it has another
  /// size than the tables say or is not the next one.
  void add_pack(std::size_t rung, Bytes pack);
  /// Of the rung added last: the rung's own stream of a fragment (empty: not stored), and the complete file.
  ByteSpan stream(std::size_t fragment) const;
  Bytes file(std::size_t fragment) const;
  ByteSpan table_stream(std::size_t rung) const;

 private:
  ByteSpan stream(std::size_t rung, std::size_t fragment) const;
  Codec codec_;
  const PlaneTables& tables_;
  Bytes table_pack_;
  std::size_t rung_ = 0;                             // the one added last
  std::vector<Bytes> packs_;                         // [rung]; empty where not needed
  std::vector<std::vector<std::uint64_t>> offsets_;  // [rung][fragment]
};

}  // namespace texmesh
