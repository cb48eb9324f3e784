#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "format/base/finding.h"
#include "stages/base/run_context.h"
#include "tools/inspect/notes_count.h"

namespace texmesh {

template <>
struct RecordFields<Finding> {
  static void fields(auto& s, auto&& v) {
    v("check", s.check, FieldRule{.pattern = "^[a-z0-9-]+$"}, "");
    v("rule", s.rule, FieldRule{.pattern = "^([A-Z][0-9][0-9])?$"},
      "the rule of format/SPEC.md that is broken");
    v("entry", s.entry, "");
    v("field", s.field, "");
    v("expected", s.expected, "");
    v("found", s.found, "");
  }
};

struct VerifyReport {
  std::vector<Finding> findings;  // in package order; empty = the package is sound
  std::uint64_t entries = 0, bytes = 0, meshes = 0, previews = 0, fragments = 0;  // what was looked at
  bool content_credential = false;  // there is one; what it says is not checked
  std::optional<NotesCount> notes;
};

/// Looks at every byte of a package and collects everything that is not as format/SPEC.md says:
/// container rules, every digest, the documents and their agreement with each other, every GLB
/// (check_glb.h), every preview and every fragment decoded. Goes on after a finding wherever the rest
/// can still be judged. A C2PA content credential has its place and its size checked, nothing else. Same
/// findings for any number of threads. Throws only for what is not the package's fault: reading fails,
/// cancelled.
VerifyReport verify_package(PackageStore& store, const RunContext& context);

struct VerifiedPackage {
  std::string package;  // as the user named it
  VerifyReport report;
  static void fields(auto& s, auto&& v) {
    v("package", s.package, "");
    v("ok", s.report.findings.empty(), "");
    v("entries", s.report.entries, "");
    v("bytes", s.report.bytes, "");
    v("meshes", s.report.meshes, "");
    v("previews", s.report.previews, "");
    v("fragments", s.report.fragments, "");
    v("content_credential", s.report.content_credential, "there is one; what it says was not checked");
    v("notes", s.report.notes, "where the package has notes at points");
    v("findings", s.report.findings, "");
  }
};
/// What `verify --json` prints.
struct VerifiedPackages {
  std::vector<VerifiedPackage> packages;
  static void fields(auto& s, auto&& v) { v("packages", s.packages, ""); }
};

}  // namespace texmesh
