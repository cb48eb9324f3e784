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

/// The artefacts of one run of a graph: who makes each, what stands for it in keys, and its object while
/// somebody needs it. Safe from several threads.
class ArtefactTable {
 public:
  static constexpr std::size_t kGiven = static_cast<std::size_t>(-1);
  /// Where an artefact comes from.
  struct Origin {
    std::size_t stage = kGiven;  // index into the stages; kGiven: from outside the graph
    std::size_t output = 0;      // of that stage
  };

  /// `stages` must outlive the table. Throws std::logic_error where an artefact is made twice, or read as
  /// another type than it is made.
  explicit ArtefactTable(const std::vector<Stage>& stages);

  /// An artefact from outside the graph; `parts` stand for it in keys where there are any, else digest and
  /// bytes. Throws std::logic_error for another type than the stages read.
  void give(const ArtefactName& artefact, Object object, const Sha256& digest, std::uint64_t bytes,
            std::vector<std::pair<std::string, std::string>> parts);

  /// std::logic_error for an artefact of another type, or of no stage.
  void check_type(const ArtefactName& artefact) const;
  Origin origin_of(const std::string& artefact) const { return slots_.at(artefact).origin; }

  /// What stands for a stage's results in keys from now on: the blobs that hold them, or, for derived data,
  /// the stage's own key.
  void publish_blobs(const Stage& stage, const std::vector<StoredBlob>& blobs);
  void publish_key(const Stage& stage, const Sha256& key);

  bool is_known(const std::string& artefact) const;
  /// The first input that nothing stands for yet; "" when there is none.
  std::string first_unknown_input(const Stage& stage) const;
  /// All inputs must be known.
  Key key_of(const Stage& stage) const;

  /// The object at hand, or null.
  Object object(const std::string& artefact) const;
  /// Keeps an object until the artefact's last use is over; one that has no use left is not kept.
  void keep(const std::string& artefact, Object object);
  /// One more use of an artefact than the stages' own.
  void add_use(const std::string& artefact);
  /// Ends a stage's uses of its inputs. Derived data ends its uses of its own inputs only with its last use:
  /// it may still have to be computed from them.
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
