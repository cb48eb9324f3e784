#pragma once
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/graph/key.h"
#include "pipeline/graph/stage.h"
#include "pipeline/graph/store.h"

namespace texmesh {

/// The artefacts of one run of a graph: of each, the stage that makes the artefact, the digest or parts that
/// stand for it in keys, and its object while a stage needs the object. Safe from several threads.
class ArtefactTable {
 public:
  static constexpr std::size_t kGiven = static_cast<std::size_t>(-1);
  /// Where an artefact comes from.
  struct Origin {
    std::size_t stage = kGiven;  // index into the stages; kGiven: from outside the graph
    std::size_t output = 0;      // of that stage
  };

  /// `stages` must outlive the table. Throws std::logic_error where an artefact is made twice, or is made as
  /// one type and read as another.
  explicit ArtefactTable(const std::vector<Stage>& stages);

  /// Takes an artefact from outside the graph. In keys `parts` stand for the artefact where there are any,
  /// else digest and bytes. Throws std::logic_error for another type than the stages read.
  void give(const ArtefactName& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
            std::vector<std::pair<std::string, std::string>> parts);

  /// std::logic_error for an artefact of another type, or of no stage.
  void check_type(const ArtefactName& artefact) const;
  Origin origin_of(const std::string& artefact) const { return slots_.at(artefact).origin; }

  /// From now on these stand for a stage's results in keys: the blobs that hold the results, or, for derived
  /// data, the stage's own key.
  void publish_blobs(const Stage& stage, const std::vector<StoredBlob>& blobs);
  void publish_key(const Stage& stage, const Sha256& key);

  bool is_known(const std::string& artefact) const;
  /// The first input that is not known yet; "" when all are known.
  std::string first_unknown_input(const Stage& stage) const;
  /// All inputs must be known.
  Key key_of(const Stage& stage) const;

  /// The object at hand, or null.
  Object object(const std::string& artefact) const;
  /// Keeps an object until the artefact's last use is over. An object without a further use is not kept.
  void keep(const std::string& artefact, Object object);
  /// One more use of an artefact than the stages' own.
  void add_use(const std::string& artefact);
  /// Ends a stage's uses of its inputs. The inputs of derived data are in use until the last use of the
  /// derived data, which may still have to be computed.
  void release_inputs(const Stage& stage);

 private:
  struct Slot {
    explicit Slot(const ArtefactName& artefact) : type(artefact.type) {}
    std::type_index type;
    Origin origin;
    int uses_left = 0;
    bool known = false;
    Sha256 digest{};
    std::uint64_t bytes = 0;
    std::vector<std::pair<std::string, std::string>> parts;  // see give()
    Object object;
  };
  Slot& slot_of(const ArtefactName& artefact);
  void release_inputs_locked(const Stage& stage);

  const std::vector<Stage>& stages_;
  mutable std::mutex mutex_;           // of what changes inside the slots
  std::map<std::string, Slot> slots_;  // the map itself is complete before the run begins
};

}  // namespace texmesh
