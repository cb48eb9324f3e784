#pragma once
#include <chrono>
#include <memory>

#include "pipeline/graph/store.h"

namespace texmesh {

/// A place behind the local cache: a shared folder or a plain HTTP server. Objects of a layer are verified
/// before they are used. A layer that cannot be reached is no error.
class CacheLayer {
 public:
  virtual ~CacheLayer() = default;
  virtual std::string name() const = 0;
  /// An object (`kind`: ac, cas or notes); nothing when the layer has none. Throws LayerError when the layer
  /// does not work.
  virtual std::optional<Bytes> get(const char* kind, const Sha256& digest, std::uint64_t max_bytes) = 0;
  /// The layer holds an object of this many bytes under the digest. False also where it does not tell. Throws
  /// LayerError.
  virtual bool has(const char* /*kind*/, const Sha256& /*digest*/, std::uint64_t /*bytes*/) { return false; }
  /// Only for layers that take results. Throws LayerError; LayerRefusal where the layer works but does not
  /// take this.
  virtual void put(const char* kind, const Sha256& digest, ByteSpan bytes) = 0;
};

/// Tells the time; tests give one of their own.
using LayerClock = std::function<std::chrono::steady_clock::time_point()>;

/// The time for which a layer that failed is not asked: long enough that a dead server costs a build little,
/// short enough that one that was started again serves the rest of the build.
class LayerRest {
 public:
  static constexpr std::chrono::seconds kRest{60};
  explicit LayerRest(LayerClock clock = {}) : clock_(std::move(clock)) {}
  void begin() { since_ = now(); }
  /// The layer has failed less than kRest ago.
  bool holds() const { return since_ && now() - *since_ < kRest; }

 private:
  std::chrono::steady_clock::time_point now() const {
    return clock_ ? clock_() : std::chrono::steady_clock::now();
  }
  LayerClock clock_;
  std::optional<std::chrono::steady_clock::time_point> since_;
};

class LayerError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

class LayerRefusal : public LayerError {
  using LayerError::LayerError;
};

/// How long a build waits for a server.
struct LayerPatience {
  double answer_s = 10;  // of one transfer: this, and a second for every kBytesPerSecond that went through
  double all_transfers_s = 900;  // of all transfers of this process together
  static constexpr double kBytesPerSecond = 100'000;
};

/// A build waits for a layer a quarter of the model's time limit at most (seconds, 0 = no limit).
LayerPatience patience_within(double limit_s);

/// GET, HEAD and PUT of URL/ac/<key> and URL/cas/<digest> (the paths of Bazel's remote caches; bazel-remote
/// must be told not to validate action results; any WebDAV-like server does); notes stand under ac/ too. http
/// and https only, no redirects; a layer that has failed, or is slower than its patience allows, fails for a
/// minute without being asked (LayerRest). A credential in the URL (user:password@) never shows up in name()
/// or messages. InputError for what is no such URL.
std::unique_ptr<CacheLayer> open_http_layer(const std::string& url, const LayerPatience& patience = {},
                                            const LayerClock& clock = {});

/// InputError for a text that names no layer. Touches no layer.
void check_layer(const std::string& place);

/// http(s)://..., or a folder laid out as a cache folder, which is never written to.
std::unique_ptr<CacheLayer> open_layer(const std::string& place, const LayerPatience& patience = {});

enum class LayerUse : std::uint8_t {
  kFetch,   // results from a layer are kept locally and found there from then on
  kUpload,  // as kFetch, and computed results are put into every HTTP layer
  kLook,    // results from a layer are verified and not kept; load() fetches them again
};

/// The local store with layers behind it, which are asked in order when the local store misses. A layer that
/// fails is not asked for a minute, with one event that holds the layer's number in `layers`; one that
/// refuses a result is given none for a minute, and asked all the same. A blob that a layer says it has is
/// not put again, unless what came from there was damaged. A null layer is left out for good.
std::unique_ptr<Store> layered_store(std::unique_ptr<Store> local,
                                     std::vector<std::unique_ptr<CacheLayer>> layers, LayerUse use,
                                     const LayerClock& clock = {});

/// The layers that TEXMESH_CACHE_LAYERS names, separated by blanks.
std::vector<std::string> layers_from_environment();

}  // namespace texmesh
