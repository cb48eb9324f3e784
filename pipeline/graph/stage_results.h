#pragma once
#include <optional>
#include <vector>

#include "format/base/note.h"
#include "pipeline/graph/key.h"
#include "pipeline/graph/stage.h"
#include "pipeline/graph/store.h"

namespace texmesh {

// A stage's results in a store: one blob per output, and the stage's notes as the last blob. Blobs with the
// right key and digests that are no results of the stage all the same are rejected.

/// What a store has of one run of a stage.
struct FoundResults {
  std::vector<StoredBlob> blobs;  // of the outputs in their order, then of the notes
  Notes notes;
};

/// Nothing where the store has no such run, or only some blobs of the run.
std::optional<FoundResults> find_results(Store& store, const Stage& stage, const Sha256& key);

/// The blobs of such a run, as far as the store can tell without loading anything; rejects nothing.
std::optional<std::vector<StoredBlob>> look_for_results(Store& store, const Stage& stage, const Sha256& key);

/// One result of a run that was found.
struct LoadedResult {
  Object object;             // null: the store has lost it
  bool is_rejected = false;  // the blob was no result; the store does not give this run again
};
LoadedResult load_result(Store& store, const Stage& stage, std::size_t output, const Sha256& key,
                         const std::vector<StoredBlob>& blobs);

/// Puts a run into the store; returns its blobs.
std::vector<StoredBlob> put_results(Store& store, const Stage& stage, const Key& key,
                                    const StageResult& result);

}  // namespace texmesh
