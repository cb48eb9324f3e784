#pragma once
// What the tests of this folder share: packages with one fault, and what verify finds in them.
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "format/container/container.h"
#include "tests/support/packages.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh {

using testing::GlbParts;
using testing::make_package_parts;
using testing::PackageParts;
using testing::PackagePatcher;

inline VerifyReport verify(const Bytes& package, int threads = 2) {
  const auto store = open_container(memory_source(package));
  RunContext context;
  context.threads = threads;
  return verify_package(*store, context);
}

inline std::string all_of(const VerifyReport& report) {
  std::string text;
  for (const Finding& f : report.findings) text += to_string(f) + "\n";
  return text;
}

/// A finding of `check` in `entry` that says what was expected or found.
inline ::testing::AssertionResult catches(const Bytes& package, const std::string& check,
                                          const std::string& entry) {
  const VerifyReport report = verify(package);
  for (const Finding& f : report.findings)
    if (f.check == check && f.entry == entry && !(f.expected.empty() && f.found.empty()))
      return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << check << " in " << entry << " is not among:\n" << all_of(report);
}

/// The same, and no other rule complains.
inline ::testing::AssertionResult catches_only(const Bytes& package, const std::string& check,
                                               const std::string& entry) {
  const VerifyReport report = verify(package);
  for (const Finding& f : report.findings)
    if (f.check != check || f.entry != entry)
      return ::testing::AssertionFailure() << "more than " << check << " in " << entry << ":\n"
                                           << all_of(report);
  return catches(package, check, entry);
}

inline PackageParts parts_with(const std::function<void(PackageParts&)>& change) {
  PackageParts p = make_package_parts();
  change(p);
  return p;
}

inline Bytes built_with(const std::function<void(PackageParts&)>& change) {
  return parts_with(change).build();
}

inline Bytes sealed_with(const std::function<void(Manifest&)>& change) {
  return PackagePatcher(make_package_parts().build()).seal(change).package();
}

}  // namespace texmesh
