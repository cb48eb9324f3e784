#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/finding.h"
#include "stages/base/run_context.h"

namespace texmesh {

struct DocumentSchema;  // pipeline/io/record.h

struct VerifyReport {
  std::vector<Finding> findings;  // in package order; empty = the package is sound
  std::uint64_t entries = 0, bytes = 0, meshes = 0, previews = 0, fragments = 0;  // what was looked at
  bool content_credential = false;  // there is one; what it says is not checked
};

/// Looks at every byte of a package and collects everything that is not as format/SPEC.md says:
/// container rules, every digest, the documents and their agreement with each other, every GLB
/// (check_glb.h), every preview and every fragment decoded. Goes on after a finding wherever the rest
/// can still be judged. A C2PA content credential has its place and its size checked, nothing else. Same
/// findings for any number of threads. Throws only for what is not the package's fault: reading fails,
/// cancelled.
VerifyReport verify_package(PackageStore& store, const RunContext& context);

/// What `verify --json` prints of one package.
struct VerifiedPackage {
  std::string package;  // as the user named it
  VerifyReport report;
};
/// One line of JSON (schemas/verify.v1.schema.json).
std::string verify_json(const std::vector<VerifiedPackage>& packages);
DocumentSchema verify_schema();

}  // namespace texmesh
