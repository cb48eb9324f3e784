#pragma once
#include <ctime>

#include "tools/extract/budget/filling.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh {

/// For each number of bytes of `wishes` the file of at most so many with the least FLIP against the package's
/// best: scale, coding of the mesh, size and quality of every texture are chosen together, by lit pictures
/// (stages/render, the studio's light), so that each map gets bytes for what it changes in them. Where a
/// proxy of the package, made smaller where it must be, looks better in whole pictures, the file is of that
/// proxy (or_of_proxy()). What does not depend on the number of bytes is made once; every file is the one
/// that its number alone gives. InputError for a scale that is not there. Same bytes for any number of
/// threads.
std::vector<Extracted> extract_within_bytes(PackageReader& package, const ExtractBudget& wishes,
                                            const OutputTransform& place, const RunContext& context);

/// Processor time of the whole program from one call to the next, seconds.
class CpuClock {
 public:
  double since_last_s();

 private:
  std::clock_t last_ = std::clock();
};

/// A file of a mesh with textures as `images` plan them, and its difference in whole pictures, where it has
/// been looked at.
struct FoundFile {
  MeshKey key;
  DealtBytes images;
  FilledFile file;
  double difference = 1e9;
  std::vector<double> parts;  // of the difference, by view; 0 = not looked at
};

/// The search for the file of one number of bytes: see the top of the .cpp.
class Search {
 public:
  Search(const Reference& reference, Candidates& candidates, ProxyDifferences& proxies, std::uint64_t bytes);
  /// `report`: parts of the way.
  Extracted run(const std::function<void(double)>& report);
  /// S_0 and the source's own images; nothing where the bytes do not hold them.
  std::optional<Extracted> source_file();

  // What run() is made of.
  const LossCurves& curves();  // measured when they are first asked for
  const Filling& filling() const { return filling_; }
  /// The mesh of a file of so many bytes, kept until it is forgotten.
  const MeshFile& mesh(const MeshKey& key);
  /// The file that fills the bytes. It is not looked at.
  FoundFile file_of(const MeshKey& key, const DealtBytes& images);
  /// In whole pictures. `rival`: one that looks plainly worse in the view that shows most is not looked at
  /// any further, and its difference stays.
  void look_at(FoundFile& found, const FoundFile* rival = nullptr);
  /// The texture that loses most in other sizes and codings, with more or fewer bytes for others, and with
  /// the mesh coded finer or leaner, as long as that is nearer.
  void try_other_files(FoundFile& best);
  /// Where the texture that loses most is to be some of the source's own coefficients: smaller and finer.
  void try_smaller_than_stored(FoundFile& best);

 private:
  /// What decides about a file, but for the quality of the texture that takes the bytes that are left.
  struct TriedFile {
    MeshKey key;
    std::size_t last = 0;
    std::vector<ImagePlan> plans;
    friend bool operator==(const TriedFile&, const TriedFile&) = default;
  };
  const std::vector<ManifestScale>& scales() const { return reference_.package.manifest().scales; }
  void forget(const MeshKey& key);
  double bytes_left(const MeshFile& mesh) const;
  DealtBytes allocation_of(const MeshKey& key) { return curves().allocate(bytes_left(mesh(key))); }

  FoundFile filled_file();
  void choose_mesh();
  void choose_mesh_by_tables();
  void walk_to_mesh();
  void follow_direction(int scale_step, int coding_step);
  bool better(const MeshKey& key);
  bool too_large(const MeshKey& key) const;
  double least_loss(const MeshKey& key) const;
  double likely_loss(const MeshKey& key);
  double scale_loss(std::size_t scale) const;
  double table_geometry(const MeshKey& key) const;
  double loss_of(const MeshKey& key);

  void look_at_files(FoundFile& best);
  void look_at_few_files(FoundFile& best);
  bool proxy_is_plainly_nearer(const FoundFile& found);
  std::vector<MeshKey> likeliest() const;
  // Whether the best has changed.
  bool replace_if_nearer(FoundFile found, FoundFile& best);
  bool try_file(const MeshKey& key, const DealtBytes& images, FoundFile& best);
  bool try_other_sizes(FoundFile& best, std::initializer_list<int> all_steps);
  bool try_other_codings(FoundFile& best);
  bool try_other_codings_of_mesh(FoundFile& best);
  bool try_other_shares(FoundFile& best);

  std::optional<FoundFile> larger_by_bits(const FoundFile& from, std::size_t scale, int coding);
  void fill_by_mesh(FoundFile& best);
  Extracted finish(FoundFile found);

  const Reference& reference_;
  Candidates& candidates_;
  ProxyDifferences& proxies_;
  const std::uint64_t bytes_;
  CpuClock clock_;
  ExtractSpent spent_;
  std::optional<LossCurves> curves_;
  const Filling filling_;
  std::map<MeshKey, MeshFile> meshes_;
  std::set<MeshKey> seen_;
  std::map<MeshKey, double> geometry_;   // of meshes looked at: MeshCandidate::geometry
  std::map<MeshKey, double> predicted_;  // joined losses of files, of meshes whose files fit
  MeshKey known_, best_;                 // the last that was looked at, and the best one
  double known_bytes_ = 0;
  bool only_likely_ = false;  // meshes that tables make hopeless are not looked at
  double least_ = 1e9;
  std::optional<Extracted> offered_;  // a file, or the proxy's that has replaced it
  std::vector<TriedFile> tried_;
  std::optional<int> looks_left_;  // at files other than the first; nothing = any number
};

}  // namespace texmesh
