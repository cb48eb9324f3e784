#pragma once

#include "tools/extract/budget/reference.h"

namespace texmesh {

/// A proxy as the package has it, moved and described as it is wished. `asked_bytes`: what is known of the
/// object is cut to what a file of so many bytes may say; 0 = nothing is cut. InputError for a proxy that is
/// not there.
Extracted extract_proxy(PackageReader& package, const ExtractProxy& wishes, bool recentre,
                        const RunContext& context, std::uint64_t asked_bytes = 0);

/// Replaces `found`, a file of a scale for so many bytes, by one of a proxy where that one's whole lit
/// pictures are nearer to the package's best, or where only that one keeps within the bytes. A proxy of too
/// many bytes gets fewer triangles, its mesh coded by Draco, its pictures smaller or coded anew, and maps
/// left out, until it fills the bytes. `found` stays where a scale, levels of detail or PNG is asked for.
/// `differences` keeps those of proxies as they are, for other numbers of bytes. Same bytes for any thread
/// count.
void offer_proxies(const Reference& reference, std::uint64_t bytes,
                   std::map<std::uint32_t, double>& differences, Extracted& found);

}  // namespace texmesh
