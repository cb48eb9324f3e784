#include "tools/cli/fetch/fetched_files.h"

#include <filesystem>
#include <span>

#include "format/container/layout.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {

void FetchedFiles::add(const LoadedFragment& f) {
  if (folder_.empty()) return;
  auto& streams = streams_[{f.plane, f.fragment}];
  const Codec codec = package_.textures()[f.plane].codec;
  if (!codec_traits(codec).incremental) streams.clear();
  streams.insert(streams.end(), f.streams.begin(), f.streams.end());
  rungs_[{f.plane, f.fragment}] = f.rung;
}

void FetchedFiles::write() {
  for (const auto& [where, streams] : streams_) {
    const auto [plane, fragment] = where;
    const Codec codec = package_.textures()[plane].codec;
    const CodecTraits& traits = codec_traits(codec);
    const auto rung = static_cast<std::uint32_t>(rungs_[where]);
    const Bytes file =
        join_fragment(codec, package_.table_stream(plane, traits.incremental ? 0 : rung),
                      std::vector<std::span<const std::uint8_t>>(streams.begin(), streams.end()));
    write_entry(fragment_file_path(plane, rung, fragment, traits.extension), file);
  }
}

void FetchedFiles::write_entry(const std::string& path, const Bytes& bytes) {
  if (folder_.empty()) return;
  const std::filesystem::path file = std::filesystem::path(folder_) / path;
  std::filesystem::create_directories(file.parent_path());
  write_file_atomically(file.string(), bytes);
}

}  // namespace texmesh
