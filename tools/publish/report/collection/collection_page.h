#pragma once

#include "pipeline/batch/fleet/run_summary.h"

namespace texmesh {

/// What the page shows of a package that is there.
struct PackageFace {
  std::string title;                 // "" = none
  std::vector<std::uint8_t> poster;  // JPEG; empty = none
};

/// A picture that belongs beside the page.
struct PageFile {
  std::string name;  // relative to the page
  std::vector<std::uint8_t> bytes;
};

struct CollectionPage {
  std::string html;
  std::vector<PageFile> files;
};

/// A page for the curator of a collection: what went wrong first, model by model, in the words of the errors;
/// then what the run was; then the models, with posters for the first `posters` of them. `face` tells what a
/// package holds, nothing where it cannot be read. Posters stand in the folder `poster_folder`. Lists are cut
/// at 10,000 rows, and say so.
CollectionPage collection_page(const RunSummary& summary, const std::string& poster_folder,
                               std::size_t posters,
                               const std::function<std::optional<PackageFace>(const ModelSummary&)>& face);

/// The face of a package in a file or folder; nothing for what cannot be read.
std::optional<PackageFace> package_face(const std::string& package);

}  // namespace texmesh
