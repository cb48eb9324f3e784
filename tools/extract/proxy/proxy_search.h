#pragma once
#include <map>

#include "tools/extract/budget/budget_source.h"
#include "tools/extract/glb/extracted.h"

namespace texmesh {

/// A proxy as the package has it, moved and described as the request wants it. InputError for a proxy that
/// is not there.
Extracted extract_proxy(PackageReader& package, const ExtractRequest& request, std::uint32_t proxy,
                        const RunContext& context);

/// Proxies for one or several numbers of bytes.
class ProxyOffers {
 public:
  explicit ProxyOffers(BudgetSource& source) : source_(source) {}

  /// Replaces `found`, a file of a scale for source.request.bytes, by one of a proxy where that one's whole
  /// lit pictures are nearer to the package's best, or where only that one keeps within the bytes. A proxy of
  /// too many bytes gets fewer triangles, its mesh coded by Draco, its pictures smaller or coded anew, and
  /// maps left out, until it fills the bytes. `found` stays where a scale, levels of detail or PNG is asked
  /// for. Same bytes for any thread count.
  void offer(Extracted& found);

 private:
  BudgetSource& source_;
  std::map<std::uint32_t, double> whole_;  // differences of proxies as they are
};

}  // namespace texmesh
