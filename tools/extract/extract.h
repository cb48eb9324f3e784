#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "stages/base/run_context.h"
#include "tools/extract/glb/extracted.h"

namespace texmesh {

/// One glTF file that any viewer opens alone: a scale of the package with whole textures. Deterministic
/// for any number of threads. InputError for a scale or rung that is not there; FormatError when the
/// package is damaged.
Extracted extract_model(PackageReader& package, const ExtractRequest& request, const RunContext& context);

/// One such file for each number of bytes, each above 0, instead of request.bytes. They share one search, and
/// are the files that extract_model() gives for each number.
std::vector<Extracted> extract_budgets(PackageReader& package, const ExtractRequest& request,
                                       const std::vector<std::uint64_t>& bytes, const RunContext& context);

/// The answer to --json (schemas/extract.v1.schema.json), and the text for people.
std::string extract_json(const Extracted& extracted, const ExtractRequest& request, const std::string& file);
std::string extract_text(const Extracted& extracted, const ExtractRequest& request, const std::string& file);

}  // namespace texmesh
