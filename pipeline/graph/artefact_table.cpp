#include "pipeline/graph/artefact_table.h"

#include <stdexcept>

namespace texmesh {

ArtefactTable::ArtefactTable(const std::vector<Stage>& stages) : stages_(stages) {
  for (std::size_t i = 0; i < stages.size(); ++i)
    for (std::size_t k = 0; k < stages[i].outputs.size(); ++k) {
      Slot& slot = slot_of(stages[i].outputs[k]);
      if (slot.origin.stage != kGiven)
        throw std::logic_error("artefact " + stages[i].outputs[k].name + " is made twice");
      slot.origin = {i, k};
    }
  for (const Stage& s : stages)
    for (const ArtefactName& input : s.inputs) ++slot_of(input).uses_left;
}

ArtefactTable::Slot& ArtefactTable::slot_of(const ArtefactName& artefact) {
  Slot& slot = slots_.try_emplace(artefact.name, artefact).first->second;
  if (slot.type != artefact.type)
    throw std::logic_error("artefact " + artefact.name + " is read as another type than it is made");
  return slot;
}

void ArtefactTable::give(const ArtefactName& artefact, Object object, const Sha256& digest,
                         std::uint64_t bytes, std::vector<std::pair<std::string, std::string>> parts) {
  Slot& slot = slot_of(artefact);
  slot.object = std::move(object);
  slot.digest = digest;
  slot.bytes = bytes;
  slot.parts = std::move(parts);
  slot.known = true;
}

void ArtefactTable::check_type(const ArtefactName& artefact) const {
  const auto it = slots_.find(artefact.name);
  if (it == slots_.end() || it->second.type != artefact.type)
    throw std::logic_error("no stage makes artefact " + artefact.name + " with this type");
}

void ArtefactTable::publish_blobs(const Stage& stage, const std::vector<StoredBlob>& blobs) {
  const std::lock_guard lock(mutex_);
  for (std::size_t k = 0; k < stage.outputs.size(); ++k) {
    Slot& slot = slots_.at(stage.outputs[k].name);
    slot.digest = blobs.at(k).digest;
    slot.bytes = blobs[k].bytes;
    slot.known = true;
  }
}

void ArtefactTable::publish_key(const Stage& stage, const Sha256& key) {
  const std::lock_guard lock(mutex_);
  for (const StageOutput& output : stage.outputs) {
    Slot& slot = slots_.at(output.name);
    slot.digest = key;
    slot.bytes = 0;
    slot.known = true;
  }
}

bool ArtefactTable::is_known(const std::string& artefact) const {
  const std::lock_guard lock(mutex_);
  return slots_.at(artefact).known;
}

std::string ArtefactTable::first_unknown_input(const Stage& stage) const {
  const std::lock_guard lock(mutex_);
  for (const ArtefactName& input : stage.inputs)
    if (!slots_.at(input.name).known) return input.name;
  return "";
}

Key ArtefactTable::key_of(const Stage& stage) const {
  Key key(stage.name, stage.version);
  for (const StageOption& option : stage.options)
    for (const auto& [path, text] : option.fields) key.add("option " + path, text);
  for (const StageLibrary& library : stage.libraries) key.add("library " + library.name, library.version);
  const std::lock_guard lock(mutex_);
  for (const ArtefactName& input : stage.inputs) {
    const Slot& slot = slots_.at(input.name);
    if (slot.parts.empty()) key.add_input(input.name, slot.digest, slot.bytes);
    for (const auto& [label, value] : slot.parts) key.add(label, value);
  }
  return key;
}

Object ArtefactTable::object(const std::string& artefact) const {
  const std::lock_guard lock(mutex_);
  return slots_.at(artefact).object;
}

void ArtefactTable::keep(const std::string& artefact, Object object) {
  const std::lock_guard lock(mutex_);
  Slot& slot = slots_.at(artefact);
  if (slot.uses_left > 0) slot.object = std::move(object);
}

void ArtefactTable::add_use(const std::string& artefact) {
  const std::lock_guard lock(mutex_);
  ++slots_.at(artefact).uses_left;
}

void ArtefactTable::release_inputs(const Stage& stage) {
  const std::lock_guard lock(mutex_);
  release_inputs_locked(stage);
}

void ArtefactTable::release_inputs_locked(const Stage& stage) {
  for (const ArtefactName& input : stage.inputs) {
    Slot& slot = slots_.at(input.name);
    if (--slot.uses_left > 0 || slot.origin.stage == kGiven) continue;
    slot.object.reset();
    const Stage& producer = stages_[slot.origin.stage];
    if (!producer.stored) release_inputs_locked(producer);
  }
}

}  // namespace texmesh
