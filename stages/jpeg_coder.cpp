#include "stages/jpeg_coder.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>

#include <jerror.h>

#include "format/errors.h"
#include "stages/jpeg_guard.h"

namespace texmesh {
namespace {

/// A destination that grows with realloc, because nothing that throws may run beneath libjpeg.
struct GrowingBuffer {
  jpeg_destination_mgr base{};  // first: libjpeg hands back a pointer to it
  JOCTET* data = nullptr;
  std::size_t capacity = 0, size = 0;

  GrowingBuffer() {
    base.init_destination = [](j_compress_ptr info) {
      auto* self = reinterpret_cast<GrowingBuffer*>(info->dest);
      if (self->capacity == 0) self->grow(info);
      self->base.next_output_byte = self->data;
      self->base.free_in_buffer = self->capacity;
    };
    base.empty_output_buffer = [](j_compress_ptr info) -> boolean {
      auto* self = reinterpret_cast<GrowingBuffer*>(info->dest);
      const std::size_t full = self->capacity;  // libjpeg calls this only when the whole buffer is used
      self->grow(info);
      self->base.next_output_byte = self->data + full;
      self->base.free_in_buffer = self->capacity - full;
      return TRUE;
    };
    base.term_destination = [](j_compress_ptr info) {
      auto* self = reinterpret_cast<GrowingBuffer*>(info->dest);
      self->size = self->capacity - self->base.free_in_buffer;
    };
  }
  ~GrowingBuffer() { std::free(data); }
  GrowingBuffer(const GrowingBuffer&) = delete;
  GrowingBuffer& operator=(const GrowingBuffer&) = delete;

 private:
  void grow(j_compress_ptr info) {
    const std::size_t wanted = std::max<std::size_t>(capacity * 2, std::size_t{1} << 16);
    auto* larger = static_cast<JOCTET*>(std::realloc(data, wanted));
    if (!larger) ERREXIT1(info, JERR_OUT_OF_MEMORY, 0);
    data = larger;
    capacity = wanted;
  }
};

HuffmanTable copy_of(const JHUFF_TBL& table) {
  HuffmanTable out;
  std::size_t count = 0;
  for (std::size_t k = 1; k <= 16; ++k) count += out.bits[k] = table.bits[k];
  out.symbols.assign(table.huffval, table.huffval + count);
  return out;
}

}  // namespace

struct JpegCoder::State {
  jpeg_compress_struct info{};
  JpegErrors errors;
  GrowingBuffer buffer;
  std::vector<JSAMPROW> rows;

  ~State() { jpeg_destroy_compress(&info); }

  template <class Body>
  void run(Body&& body) {
    if (jpeg_guarded(errors, body)) return;
    const std::string message = errors.message;
    jpeg_abort_compress(&info);
    throw StageError("jpeg", "", "an image that libjpeg can code", message);
  }
  void set_image(const PixelWindow& image) {
    info.image_width = image.width_px;
    info.image_height = image.height_px;
    rows.resize(image.height_px);
    for (std::size_t y = 0; y < rows.size(); ++y)  // libjpeg's interface lacks const; it does not write there
      rows[y] = const_cast<JSAMPROW>(image.data + y * image.stride_bytes);
  }
  /// With every pixel of the image set by set_image().
  void write(boolean all_tables) {
    jpeg_start_compress(&info, all_tables);
    while (info.next_scanline < info.image_height)
      jpeg_write_scanlines(&info, rows.data() + info.next_scanline, info.image_height - info.next_scanline);
    jpeg_finish_compress(&info);
  }
  std::vector<std::uint8_t> output() const { return {buffer.data, buffer.data + buffer.size}; }
  std::size_t table_pairs() const { return info.num_components == 1 ? 1 : 2; }
};

JpegCoder::JpegCoder(std::uint32_t channels, int quality, Subsampling subsampling) : state_(new State) {
  if (channels != 1 && channels != 3)
    throw StageError("jpeg", "channels", "1 or 3", std::to_string(channels));
  jpeg_compress_struct& info = state_->info;
  info.err = &state_->errors.base;
  state_->run([&] {
    jpeg_create_compress(&info);
    info.dest = &state_->buffer.base;
    info.image_width = info.image_height = 16;
    info.input_components = static_cast<int>(channels);
    info.in_color_space = channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, quality, TRUE);
    info.dct_method = JDCT_ISLOW;
    if (channels == 3) {
      const int factor = subsampling == Subsampling::k420 ? 2 : 1;
      info.comp_info[0].h_samp_factor = info.comp_info[0].v_samp_factor = factor;
    } else {  // jpeg_write_tables() writes every table there is
      info.quant_tbl_ptrs[1] = nullptr;
      info.dc_huff_tbl_ptrs[1] = info.ac_huff_tbl_ptrs[1] = nullptr;
    }
  });
}

JpegCoder::~JpegCoder() = default;

HuffmanTables JpegCoder::train(const PixelWindow& image) {
  jpeg_compress_struct& info = state_->info;
  state_->set_image(image);
  state_->run([&] {
    info.optimize_coding = TRUE;
    state_->write(TRUE);
    info.optimize_coding = FALSE;
  });
  return tables();
}

HuffmanTables JpegCoder::tables() const {
  HuffmanTables out;
  for (std::size_t k = 0; k < state_->table_pairs(); ++k) {
    out.push_back(copy_of(*state_->info.dc_huff_tbl_ptrs[k]));
    out.push_back(copy_of(*state_->info.ac_huff_tbl_ptrs[k]));
  }
  return out;
}

void JpegCoder::use_tables(const HuffmanTables& tables) {
  jpeg_compress_struct& info = state_->info;
  if (tables.size() != 2 * state_->table_pairs())
    throw StageError("jpeg", "Huffman tables", std::to_string(2 * state_->table_pairs()),
                     std::to_string(tables.size()));
  for (std::size_t k = 0; k < tables.size(); ++k) {
    JHUFF_TBL* const* const kind =
        k % 2 ? info.ac_huff_tbl_ptrs : info.dc_huff_tbl_ptrs;  // g++ 12's -fsanitize=bounds
    JHUFF_TBL& to = *kind[k / 2];                               // breaks on one expression
    std::copy(tables[k].bits.begin(), tables[k].bits.end(), to.bits);
    std::memset(to.huffval, 0, sizeof to.huffval);
    std::copy(tables[k].symbols.begin(), tables[k].symbols.end(), to.huffval);
  }
}

std::vector<std::uint8_t> JpegCoder::table_stream() {
  state_->run([&] {
    jpeg_suppress_tables(&state_->info, FALSE);
    jpeg_write_tables(&state_->info);
  });
  return state_->output();
}

std::vector<std::uint8_t> JpegCoder::abbreviated(const PixelWindow& image) {
  jpeg_compress_struct& info = state_->info;
  state_->set_image(image);
  state_->run([&] {
    info.write_JFIF_header = FALSE;
    info.write_Adobe_marker = FALSE;
    jpeg_suppress_tables(&info, TRUE);
    state_->write(FALSE);
  });
  return state_->output();
}

std::vector<std::uint8_t> JpegCoder::complete(const PixelWindow& image) {
  jpeg_compress_struct& info = state_->info;
  state_->set_image(image);
  state_->run([&] {
    info.write_JFIF_header = TRUE;
    info.optimize_coding = TRUE;
    state_->write(TRUE);
    info.optimize_coding = FALSE;
  });
  return state_->output();
}

HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights) {
  // The reserved symbol 256 of weight 1 takes the code of ones only and is dropped afterwards.
  constexpr int kReserved = 256;
  struct Node {
    std::uint64_t weight;
    int symbol;               // the highest one beneath, for ties
    std::vector<int> leaves;  // symbols beneath
  };
  std::vector<Node> nodes{{1, kReserved, {kReserved}}};
  for (std::size_t k = 0; k < symbols.size(); ++k) nodes.push_back({weights[k], symbols[k], {symbols[k]}});
  std::array<int, 257> length{};
  const auto lighter = [](const Node& a, const Node& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.symbol < b.symbol;
  };
  std::make_heap(nodes.begin(), nodes.end(), lighter);
  while (nodes.size() > 1) {
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node a = std::move(nodes.back());
    nodes.pop_back();
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node& b = nodes.back();
    b.weight += a.weight;
    b.symbol = std::max(a.symbol, b.symbol);
    b.leaves.insert(b.leaves.end(), a.leaves.begin(), a.leaves.end());
    for (int leaf : b.leaves) ++length[static_cast<std::size_t>(leaf)];
    std::push_heap(nodes.begin(), nodes.end(), lighter);
  }
  // Codes longer than 16 bits move up: of a pair of the longest, one takes the parent's place and the other
  // shares the place of a shorter code (annex K.2, figure K.3).
  std::vector<std::size_t> count(symbols.size() + 2);
  for (int l : length) ++count[static_cast<std::size_t>(l)];
  count[0] = 0;  // numbers that are no symbol
  for (std::size_t l = count.size() - 1; l > 16; --l)
    while (count[l] > 0) {
      std::size_t shorter = l - 2;
      while (count[shorter] == 0) --shorter;
      count[l] -= 2;
      ++count[l - 1];
      count[shorter + 1] += 2;
      --count[shorter];
    }
  std::size_t longest = std::min<std::size_t>(16, count.size() - 1);
  while (count[longest] == 0) --longest;
  --count[longest];  // the reserved one
  HuffmanTable out;
  for (std::size_t l = 1; l <= longest; ++l) out.bits[l] = static_cast<std::uint8_t>(count[l]);
  out.symbols = symbols;
  std::sort(out.symbols.begin(), out.symbols.end(), [&](std::uint8_t a, std::uint8_t b) {
    return length[a] != length[b] ? length[a] < length[b] : a < b;
  });
  return out;
}

}  // namespace texmesh
