#include "delivery/cpp/package/plane_streams.h"

#include <numeric>

#include "format/base/rule_error.h"

namespace texmesh {
namespace {

void require_size(const char* rule, const char* what, std::uint64_t expected, std::uint64_t found) {
  if (expected != found)
    throw RuleError(rule, what, "", std::to_string(expected) + " bytes, as the tables say",
                    std::to_string(found));
}

}  // namespace

PlaneStreams::PlaneStreams(Codec codec, const PlaneTables& tables, Bytes table_pack)
    : codec_(codec),
      tables_(tables),
      table_pack_(std::move(table_pack)),
      packs_(tables.rung_count()),
      offsets_(tables.rung_count()) {
  require_size("R12", "table streams",
               std::accumulate(tables.table_bytes.begin(), tables.table_bytes.end(), std::uint64_t{0}),
               table_pack_.size());
}

void PlaneStreams::add_pack(std::size_t rung, Bytes pack) {
  const std::size_t fragments = tables_.fragment_count();
  const bool incremental = codec_traits(codec_).incremental;
  if (rung >= packs_.size() || (incremental && rung > 0 && offsets_[rung - 1].empty()))
    throw FormatError("rung " + std::to_string(rung), "", "the next one", "another");
  std::vector<std::uint64_t> offsets(fragments);
  std::uint64_t at = 0;
  for (const std::uint16_t f : tables_.order) {
    offsets[f] = at;
    at += tables_.size_bytes[rung * fragments + f];
  }
  require_size("R13", "rung", at, pack.size());
  if (!incremental) packs_[rung_].clear();
  rung_ = rung;
  packs_[rung] = std::move(pack);
  offsets_[rung] = std::move(offsets);
}

ByteSpan PlaneStreams::stream(std::size_t rung, std::size_t fragment) const {
  return std::span(packs_[rung])
      .subspan(static_cast<std::size_t>(offsets_[rung].at(fragment)),
               tables_.size_bytes[rung * tables_.fragment_count() + fragment]);
}

ByteSpan PlaneStreams::stream(std::size_t fragment) const { return stream(rung_, fragment); }

Bytes PlaneStreams::file(std::size_t fragment) const {
  const std::size_t first = codec_traits(codec_).incremental ? 0 : rung_;
  std::vector<ByteSpan> streams;
  for (std::size_t r = first; r <= rung_; ++r) streams.push_back(stream(r, fragment));
  return join_fragment(codec_, table_stream(first), streams);
}

ByteSpan PlaneStreams::table_stream(std::size_t rung) const {
  std::uint64_t at = 0;
  for (std::size_t r = 0; r < rung; ++r) at += tables_.table_bytes[r];
  return std::span(table_pack_).subspan(static_cast<std::size_t>(at), tables_.table_bytes[rung]);
}

}  // namespace texmesh
