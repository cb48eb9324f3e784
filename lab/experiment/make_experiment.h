#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lab/experiment/design.h"
#include "lab/experiment/stimuli.h"

namespace texmesh {

/// The first line of an experiment's page.
inline constexpr const char* kExperimentFirstLine = "<!DOCTYPE html><!-- texmesh-lab experiment 1 -->\n";

struct ExperimentFile {
  std::string path;  // relative to the experiment's folder
  std::vector<std::uint8_t> bytes;
};

struct Experiment {
  ExperimentDesign design;
  std::vector<ExperimentFile> files;  // index.html first
};

/// Longest side of a strip of views, px: what browsers decode everywhere.
inline constexpr std::uint32_t kMostStripPx = 16384;

/// InputError naming the option, --sizes or --views, when a picture would be too large.
void check_pictures(const ExperimentOptions& options, const StimulusSet& stimuli);

/// Renders every stimulus with the reference renderer in the light of all measurements, from `views`
/// directions around it, side by side in one picture. Pictures of one size have equal sides and equal lengths
/// in bytes. Errors as check_pictures(). Same bytes for any thread count and machine.
Experiment make_experiment(const ExperimentOptions& options, const StimulusSet& stimuli,
                           const RunContext& context);

/// Writes the folder, which appears whole or not at all. InputError when it holds files: what judges are
/// asked is never replaced.
void write_experiment(const Experiment& experiment, const std::string& folder);
/// The same refusals, before the work.
void check_experiment_folder(const std::string& folder);

/// A PNG file made `size` bytes long by a private chunk that decoders skip, filled with bytes drawn from
/// `seed`; size >= png.size() + 12.
std::vector<std::uint8_t> padded_png(const std::vector<std::uint8_t>& png, std::size_t size,
                                     std::uint64_t seed);

}  // namespace texmesh
