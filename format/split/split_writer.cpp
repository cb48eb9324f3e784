#include "format/split/split_writer.h"

#include <algorithm>

#include "format/base/sha256.h"
#include "format/split/codec/split_codec.h"
#include "format/split/split_coder.h"
#include "format/split/split_head.h"
#include "format/split/split_symbols.h"
#include "format/split/split_truth.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kFacesPerBlock = 512;  // of patches but the first

/// The writer's side of SplitCodec: codes connectivity at once and keeps the values' residuals, which are
/// coded when the models of the whole stream are known.
class EncodingChannel {
 public:
  EncodingChannel(const SplitSource& source, const SplitMesh& mesh)
      : source_(source), truth_(source, mesh), symbols_(source.attributes.size() + 1) {}
  SplitTruth& truth() { return truth_; }
  std::vector<std::uint8_t> finish_connectivity() { return bits_.finish(); }
  std::vector<Symbols> finish_symbols() {
    std::vector<Symbols> out(symbols_.size());
    out.swap(symbols_);
    return out;
  }

  template <class Truth>
  bool bit(BitModel& model, Truth&& truth) {
    const bool value = truth(truth_);
    bits_.encode(model, value, SplitModels::kLimit);
    return value;
  }
  template <class Truth>
  std::uint32_t raw(int count, Truth&& truth) {
    const auto value = static_cast<std::uint32_t>(truth(truth_));
    bits_.encode_raw(value, count);
    return value;
  }
  template <class Note>
  void update_truth(Note&& note) {
    note(truth_);
  }
  template <class Truth>
  void point(SplitMesh::Point& point, const SplitMesh::Point& guess, Truth&& truth) {
    point = truth(truth_);
    put(0, point.data(), guess.data(), 3, source_.position.bits);
  }
  void finish_point(SplitMesh&, std::uint32_t) {}
  template <class Truth>
  bool same(std::size_t k, Truth&& truth) {
    const bool same = truth(truth_);
    symbols_[k + 1].push_back(same ? kSame : kOther);
    return same;
  }
  template <class Truth>
  void value(std::size_t k, std::int32_t* value, const std::array<std::int32_t, 4>& guess, Truth&& truth) {
    const SplitAttribute& a = source_.attributes[k];
    std::copy_n(truth(truth_), split_components(a.kind), value);
    put(k + 1, value, guess.data(), split_components(a.kind), a.grid.bits);
  }
  std::array<std::int32_t, 4> mean(std::size_t k, SplitMesh& mesh, const std::vector<std::uint32_t>& wedges) {
    return split_mean(source_.attributes[k], k, mesh, wedges);
  }

 private:
  void put(std::size_t part, const std::int32_t* value, const std::int32_t* guess, int components, int bits) {
    const std::int32_t largest = (1 << bits) - 1, half = 1 << (bits - 1);
    for (int i = 0; i < components; ++i) {
      const std::int32_t residual = value[i] - std::clamp(guess[i], 0, largest);
      symbols_[part].push_back(((residual + half) & largest) - half);
    }
  }
  const SplitSource& source_;
  SplitTruth truth_;
  BitEncoder bits_;
  std::vector<Symbols> symbols_;
};

/// Runs the codec over the source block by block.
class SplitStreamWriter {
 public:
  explicit SplitStreamWriter(const SplitSource& source)
      : source_(source),
        mesh_(components()),
        channel_(source, mesh_),
        codec_(mesh_, channel_, source.groups.size(), SplitLimits{}) {
    // Vectors that grow by doubling would take twice the memory for a while.
    mesh_.reserve(source.points.size(), source.wedge_point.size(), source.face_group.size());
  }

  std::vector<std::uint8_t> write() {
    head_.position = source_.position;
    head_.attributes = source_.attributes;
    head_.groups = source_.groups;
    for (const SplitSource::Chapter& chapter : source_.chapters) write_chapter(chapter);
    code_values();
    std::vector<std::uint8_t> stream = write_split_head(head_);
    for (const auto& block : bytes_) stream.insert(stream.end(), block.begin(), block.end());
    return stream;
  }

 private:
  std::vector<int> components() const {
    std::vector<int> n;
    for (const SplitAttribute& a : source_.attributes) n.push_back(split_components(a.kind));
    return n;
  }
  void write_chapter(const SplitSource::Chapter& chapter) {
    channel_.truth().begin_chapter(chapter);
    codec_.begin_chapter();
    const auto faces = static_cast<std::uint32_t>(chapter.patch.size());
    const std::uint32_t per_block = head_.scales.empty() ? faces : kFacesPerBlock;
    for (std::uint32_t at = 0; at < faces; at += per_block) {
      const std::uint32_t count = std::min(per_block, faces - at);
      codec_.code_patch(count);
      end_block(true, count);
    }
    const auto splits = static_cast<std::uint32_t>(chapter.splits.size());
    for (std::uint32_t at = 0; at < splits; at += source_.splits_per_block) {
      const std::uint32_t count = std::min(source_.splits_per_block, splits - at);
      codec_.code_splits(count);
      end_block(false, count);
    }
    head_.scales.push_back({chapter.scale, static_cast<std::uint32_t>(head_.blocks.size()),
                            static_cast<std::uint32_t>(mesh_.points().size()),
                            static_cast<std::uint32_t>(mesh_.wedge_point().size()),
                            static_cast<std::uint32_t>(mesh_.face_count()),
                            static_cast<std::uint32_t>(mesh_.visible_faces().size())});
  }
  void end_block(bool is_patch, std::uint32_t count) {
    SplitBlock block;
    block.is_patch = is_patch;
    block.count = count;
    head_.blocks.push_back(block);
    bytes_.push_back(channel_.finish_connectivity());
    symbols_.push_back(channel_.finish_symbols());
  }
  void code_values() {
    for (std::size_t part = 0; part <= source_.attributes.size(); ++part)
      head_.models.push_back(start_models(symbols_, part, part_components(part)));
    for (std::size_t i = 0; i < bytes_.size(); ++i) {
      std::vector<std::uint8_t>& bytes = bytes_[i];
      SplitBlock& block = head_.blocks[i];
      std::vector<std::vector<std::uint8_t>> parts;
      std::size_t size = bytes.size();
      for (std::size_t part = 0; part <= source_.attributes.size(); ++part) {
        parts.push_back(code_symbols(symbols_[i][part], head_.models[part], part_components(part)));
        size += parts.back().size();
      }
      // So few bytes only where a mesh repeats itself; the decoder reads zeros behind the end anyway.
      if (const std::size_t least = block.count / kMostPerByte; size < least)
        bytes.resize(bytes.size() + least - size, 0);
      block.parts.push_back(static_cast<std::uint32_t>(bytes.size()));
      for (const auto& part : parts) {
        block.parts.push_back(static_cast<std::uint32_t>(part.size()));
        bytes.insert(bytes.end(), part.begin(), part.end());
      }
      const Sha256 digest = sha256(bytes);
      std::copy_n(digest.begin(), block.digest.size(), block.digest.begin());
    }
  }
  int part_components(std::size_t part) const {
    return part == 0 ? 3 : split_components(source_.attributes[part - 1].kind);
  }

  const SplitSource& source_;
  SplitMesh mesh_;
  EncodingChannel channel_;
  SplitCodec<EncodingChannel> codec_;
  SplitStreamHead head_;
  std::vector<std::vector<std::uint8_t>> bytes_;
  std::vector<std::vector<Symbols>> symbols_;
};

}  // namespace

std::vector<std::uint8_t> write_split_stream(const SplitSource& source) {
  check_split_source(source);
  return SplitStreamWriter(source).write();
}

}  // namespace texmesh
