#pragma once

#include "format/container/container.h"

namespace texmesh {

/// Reads an entry's data; RuleError when it has another CRC-32. read_container() itself reads no data.
inline void check_crc(ByteSource& source, const ContainerEntry& entry) {
  constexpr std::uint64_t kChunk = 1 << 20;
  std::uint32_t crc = 0;
  for (std::uint64_t done = 0; done < entry.bytes; done += kChunk)
    crc = crc_of(source.read(entry.offset + done, std::min(kChunk, entry.bytes - done)), crc);
  if (crc != entry.crc32)
    throw RuleError("K07", source.name(), "entry " + entry.path, "CRC-32 " + std::to_string(entry.crc32),
                    std::to_string(crc));
}

}  // namespace texmesh
