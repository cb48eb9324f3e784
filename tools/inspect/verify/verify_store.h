#pragma once
#include <map>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/bytes.h"
#include "format/base/finding.h"
#include "format/documents/entry_ref.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh {

// A part of verify_package; no interface.

/// Reads the entries of a package, each compared with its digest and with what the container says of it.
class CheckedStore {
 public:
  /// Adds to `findings`, and to the entries and bytes of `report`.
  CheckedStore(PackageStore& store, Findings& findings, VerifyReport& report)
      : store_(store), findings_(findings), report_(report) {}

  void list_entries();
  Bytes read_manifest();
  /// FormatError when the bytes are not there.
  Bytes read(const EntryRef& ref);
  /// The index names exactly what is there, in the order that the format prescribes.
  void check_entry_set(std::vector<EntryRef> index, const EntryRef& index_entry);

  PackageStore& store() { return store_; }
  const std::vector<ContainerEntry>& listed() const { return listed_; }
  bool contains(const std::string& path) const { return by_path_.contains(path); }

 private:
  void check_content_credential(const ContainerEntry& entry);
  void check_stored(const std::string& path, const Bytes& bytes, std::uint64_t offset);

  PackageStore& store_;
  Findings& findings_;
  VerifyReport& report_;
  std::vector<ContainerEntry> listed_;
  std::map<std::string, const ContainerEntry*> by_path_;
};

}  // namespace texmesh
