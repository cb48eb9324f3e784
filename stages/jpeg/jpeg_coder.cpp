// libjpeg-turbo both ways: its errors become ours without an exception or a longjmp that crosses the wrong
// frames. First the compressor behind JpegCoder, then the decoder.
#include "stages/jpeg/jpeg_coder.h"

#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <jpeglib.h>
// libjpeg needs its own header first.
#include <jerror.h>

#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

struct JpegErrors {
  jpeg_error_mgr base;  // first: libjpeg hands back a pointer to it
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = {};

  JpegErrors() {
    jpeg_std_error(&base);
    base.error_exit = fail;
    base.emit_message = [](j_common_ptr info, int level) {
      if (level < 0) fail(info);  // a warning: the data are damaged and libjpeg would go on with a guess
    };
    base.output_message = [](j_common_ptr) {};
  }

 private:
  [[noreturn]] static void fail(j_common_ptr info) {
    auto* self = reinterpret_cast<JpegErrors*>(info->err);
    self->base.format_message(info, self->message);
    std::longjmp(self->jump, 1);
  }
};

/// Runs body(); false when libjpeg failed, with the reason in errors.message. libjpeg is C and leaves by
/// longjmp, so the body must own nothing: no automatic object with a destructor may live in it while it calls
/// libjpeg.
bool jpeg_guarded(JpegErrors& errors, auto&& body) {
  if (setjmp(errors.jump)) return false;
  body();
  return true;
}

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

/// Scans of a progressive file (thesis-like refinement, one bit of all coefficients at a time): DC without
/// its last 3 bits, AC without its last 4, then bit by bit, luma before chroma, because a cut after a luma
/// pass is worth 0.2 to 0.5 dB more than one within it.
std::vector<jpeg_scan_info> progressive_scans(int components) {
  constexpr int kDcShift = 3, kAcShift = 4, kLastCoefficient = 63;
  std::vector<jpeg_scan_info> scans;
  const auto add_dc = [&](int from, int to) { scans.push_back({components, {0, 1, 2, 0}, 0, 0, from, to}); };
  const auto add_ac = [&](int component, int from, int to) {
    scans.push_back({1, {component, 0, 0, 0}, 1, kLastCoefficient, from, to});
  };
  add_dc(0, kDcShift);
  for (int c = 0; c < components; ++c) add_ac(c, 0, kAcShift);
  for (int bit = kAcShift; bit > 0; --bit) {
    add_ac(0, bit, bit - 1);
    if (bit > 1) add_dc(bit - 1, bit - 2);
    for (int c = 1; c < components; ++c) add_ac(c, bit, bit - 1);
  }
  return scans;
}

/// What tells decoders that three channels are not YCbCr: APP14 "Adobe", version 100, no flags, no transform.
constexpr std::array<std::uint8_t, 16> kAdobeMarker{0xff, 0xee, 0,   14, 'A', 'd', 'o', 'b',
                                                    'e',  0,    100, 0,  0,   0,   0,   0};
constexpr std::size_t kMarkerBytes = 2;

/// No coefficient of 8-bit samples is larger than 1024 (DC; AC stay under 930) before it is quantised.
unsigned largest_coefficient(const JQUANT_TBL& quantisers, std::size_t zigzag) {
  const unsigned q = quantisers.quantval[kNaturalOfZigzag[zigzag]];
  return (1024 + q / 2) / q;
}

unsigned bit_length(unsigned value) {
  unsigned bits = 0;
  for (; value > 0; value >>= 1) ++bits;
  return bits;
}

std::vector<std::uint8_t> dc_symbols(unsigned most_bits) {
  std::vector<std::uint8_t> symbols;
  for (unsigned bits = 0; bits <= std::min(most_bits, 11u); ++bits)
    symbols.push_back(static_cast<std::uint8_t>(bits));
  return symbols;
}

/// After a run of r zeros the coefficient is the (r + 1)th or a later one.
std::vector<std::uint8_t> ac_symbols(std::span<const unsigned> most_bits) {
  std::vector<std::uint8_t> symbols{0x00, 0xf0};  // end of block, sixteen zeros
  for (unsigned run = 0; run < 16; ++run)
    for (unsigned bits = 1; bits <= std::min(most_bits[run + 1], 10u); ++bits)
      symbols.push_back(static_cast<std::uint8_t>(run << 4 | bits));
  return symbols;
}

std::uint16_t step_of(double step, double quality, double rounding) {
  const double percent = quality < 50 ? 5000 / quality : 200 - 2 * quality;  // libjpeg's scale
  return static_cast<std::uint16_t>(std::clamp(std::floor(step * percent / 100 + rounding), 1.0, 255.0));
}

/// Where a step is rounded up. The same for all of them, many would change at one quality, and the bytes with
/// them by more than what a search may miss.
double rounding_of(std::size_t i) {
  if (i / DCTSIZE + i % DCTSIZE < 2) return 0.5;  // the three that show most
  const double spread = 0.618 * static_cast<double>(i);
  return 0.2 + 0.6 * (spread - std::floor(spread));
}

/// libjpeg's compressor and what it writes. Everything that it owns is freed whatever happens.
struct Compressor {
  jpeg_compress_struct info{};
  JpegErrors errors;
  GrowingBuffer buffer;

  Compressor() {
    info.err = &errors.base;
    run([this] { jpeg_create_compress(&info); });
    info.dest = &buffer.base;
  }
  ~Compressor() { jpeg_destroy_compress(&info); }
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  void run(auto&& body) {
    if (jpeg_guarded(errors, body)) return;
    const std::string message = errors.message;
    jpeg_abort_compress(&info);
    throw StageError("jpeg", "", "an image that libjpeg can code", message);
  }
  std::span<const std::uint8_t> output() const { return {buffer.data, buffer.size}; }
};

std::uint32_t rounded_up(std::uint32_t count, std::uint32_t step) { return (count + step - 1) / step * step; }

void set_up_file(jpeg_compress_struct& info, const CoefficientFile& file) {
  info.image_width = file.width_px;
  info.image_height = file.height_px;
  info.input_components = static_cast<int>(file.parts.size());
  info.in_color_space = file.parts.size() == 1 ? JCS_GRAYSCALE : file.rgb ? JCS_RGB : JCS_YCbCr;
  jpeg_set_defaults(&info);
  jpeg_set_colorspace(&info, info.in_color_space);
  for (std::size_t c = 0; c < file.parts.size(); ++c) {
    jpeg_component_info& to = info.comp_info[c];
    to.h_samp_factor = static_cast<int>(file.parts[c].across);
    to.v_samp_factor = static_cast<int>(file.parts[c].down);
    to.quant_tbl_no = static_cast<int>(c);
    if (!info.quant_tbl_ptrs[c])
      info.quant_tbl_ptrs[c] = jpeg_alloc_quant_table(reinterpret_cast<j_common_ptr>(&info));
    for (std::size_t k = 0; k < DCTSIZE2; ++k) info.quant_tbl_ptrs[c]->quantval[k] = file.parts[c].steps[k];
  }
  info.optimize_coding = TRUE;
  jpeg_simple_progression(&info);
}

/// Between them the arrays are allocated, and nothing is coded yet: libjpeg codes when it finishes.
void write_blocks(jpeg_compress_struct& info, const CoefficientFile& file) {
  auto* common = reinterpret_cast<j_common_ptr>(&info);
  jvirt_barray_ptr arrays[3];
  for (std::size_t c = 0; c < file.parts.size(); ++c) {
    const CoefficientFile::Part& part = file.parts[c];
    arrays[c] =
        info.mem->request_virt_barray(common, JPOOL_IMAGE, TRUE, rounded_up(part.blocks_across, part.across),
                                      rounded_up(part.blocks_down, part.down), part.down);
  }
  jpeg_write_coefficients(&info, arrays);
  for (std::size_t c = 0; c < file.parts.size(); ++c) {
    const CoefficientFile::Part& part = file.parts[c];
    for (std::uint32_t row = 0; row < part.blocks_down; ++row) {
      JBLOCKROW to = *info.mem->access_virt_barray(common, arrays[c], row, 1, TRUE);
      const std::int16_t* from = part.blocks + std::size_t{64} * row * part.blocks_across;
      std::copy_n(from, std::size_t{64} * part.blocks_across, &to[0][0]);
    }
  }
  jpeg_finish_compress(&info);
}

// libjpeg decodes a progressive file scan by scan over all its coefficients; a hostile one has thousands of
// empty scans. Encoders write about ten.
constexpr int kMaxScans = 100;

[[noreturn]] void fail_decoding(std::string expected, std::string found) {
  throw FormatError("JPEG", "", std::move(expected), std::move(found));
}

struct Decoder {
  jpeg_decompress_struct info{};
  JpegErrors errors;
  jpeg_progress_mgr progress{};

  Decoder() {
    info.err = &errors.base;
    progress.progress_monitor = [](j_common_ptr common) {
      auto* self = reinterpret_cast<j_decompress_ptr>(common);
      if (self->input_scan_number > kMaxScans) {
        self->err->msg_code = 0;
        self->err->error_exit(common);
      }
    };
    if (!jpeg_guarded(errors, [this] { jpeg_create_decompress(&info); }))
      fail_decoding("a decoder", errors.message);
    info.progress = &progress;
  }
  ~Decoder() { jpeg_destroy_decompress(&info); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  void check(bool ok) const {
    if (ok) return;
    if (info.input_scan_number > kMaxScans)
      fail_decoding("at most " + std::to_string(kMaxScans) + " scans", "more");
    fail_decoding("an image that decodes without a warning", errors.message);
  }
};

void check_header(const jpeg_decompress_struct& info, std::uint64_t max_pixels) {
  const std::uint64_t pixels = std::uint64_t{info.image_width} * info.image_height;
  if (pixels > max_pixels)
    fail_decoding("at most " + std::to_string(max_pixels) + " pixels",
                  std::to_string(info.image_width) + " x " + std::to_string(info.image_height));
  if (info.arith_code) fail_decoding("Huffman coding", "arithmetic coding");
  if (info.num_components != 1 && info.num_components != 3)
    fail_decoding("1 or 3 channels", std::to_string(info.num_components));
}

Pixels decode(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels, bool luma_only) {
  if (bytes.empty()) fail_decoding("SOI", "no bytes");
  Decoder decoder;
  jpeg_decompress_struct& info = decoder.info;
  decoder.check(jpeg_guarded(decoder.errors, [&] {
    jpeg_mem_src(&info, bytes.data(), static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&info, TRUE);
  }));
  check_header(info, max_pixels);
  const bool has_luma = info.num_components == 1 || info.jpeg_color_space == JCS_YCbCr;
  const bool grey = info.num_components == 1 || (luma_only && has_luma);
  Pixels out;
  out.width_px = info.image_width;
  out.height_px = info.image_height;
  out.channels = grey ? 1 : 3;
  const std::size_t stride = std::size_t{out.width_px} * out.channels;
  out.data.resize(stride * out.height_px);
  decoder.check(jpeg_guarded(decoder.errors, [&] {
    info.out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
    info.dct_method = JDCT_ISLOW;
    info.do_fancy_upsampling = TRUE;
    jpeg_start_decompress(&info);
    while (info.output_scanline < info.output_height) {
      JSAMPROW rows[16];
      JDIMENSION count = 0;
      while (count < 16 && info.output_scanline + count < info.output_height) {
        rows[count] = out.data.data() + (std::size_t{info.output_scanline} + count) * stride;
        ++count;
      }
      jpeg_read_scanlines(&info, rows, count);
    }
    jpeg_finish_decompress(&info);
  }));
  if (info.src->bytes_in_buffer != 0)
    fail_decoding("EOI at the end", std::to_string(info.src->bytes_in_buffer) + " bytes after it");
  return luma_only && !grey ? luma_of(out) : out;
}

}  // namespace

struct JpegCoder::State : Compressor {
  JpegKind kind;
  std::vector<JSAMPROW> rows;
  std::vector<jpeg_scan_info> scans;

  explicit State(const JpegKind& k) : kind(k) {}

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
  /// SOI SOF [SOS] data EOI of the image into the buffer.
  void write_abbreviated(const PixelWindow& image) {
    set_image(image);
    run([&] {
      info.write_JFIF_header = FALSE;
      info.write_Adobe_marker = FALSE;
      jpeg_suppress_tables(&info, TRUE);
      write(FALSE);
    });
  }
  /// Bytes of SOI SOF [SOS] in front of an abbreviated stream's own part. A progressive stream has its tables
  /// in front of each SOS, so there the frame header is all.
  std::size_t frame_head_bytes() const {
    const std::size_t n = kind.channels, sof = kMarkerBytes + 8 + 3 * n, sos = kMarkerBytes + 6 + 2 * n;
    return kMarkerBytes + sof + (kind.progressive ? 0 : sos);
  }
  std::size_t table_pairs() const { return info.num_components == 1 ? 1 : 2; }
  void suppress_huffman_tables() {
    for (JHUFF_TBL** tables : {info.dc_huff_tbl_ptrs, info.ac_huff_tbl_ptrs})
      for (int k = 0; k < NUM_HUFF_TBLS; ++k)
        if (tables[k]) tables[k]->sent_table = TRUE;
  }

  /// Runs within run(): sets colours, sampling and tables up.
  void set_up() {
    info.image_width = info.image_height = 16;
    info.input_components = static_cast<int>(kind.channels);
    info.in_color_space = kind.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&info);
    if (kind.channels == 3 && kind.rgb) jpeg_set_colorspace(&info, JCS_RGB);
    set_steps();
    info.dct_method = JDCT_ISLOW;
    if (kind.channels == 1) {  // jpeg_write_tables() writes every table there is
      info.quant_tbl_ptrs[1] = nullptr;
      info.dc_huff_tbl_ptrs[1] = info.ac_huff_tbl_ptrs[1] = nullptr;
    } else if (kind.rgb) {
      if (!kind.file) use_second_tables_for_last();
    } else {
      const int factor = kind.subsampling == Subsampling::k420 ? 2 : 1;
      info.comp_info[0].h_samp_factor = info.comp_info[0].v_samp_factor = factor;
    }
    if (kind.file) {
      if (!kind.file->sequential) jpeg_simple_progression(&info);
    } else if (kind.progressive) {
      info.scan_info = scans.data();
      info.num_scans = static_cast<int>(scans.size());
    }
  }

 private:
  void set_steps() {
    if (!kind.file) return jpeg_set_quality(&info, kind.quality, TRUE);
    const double quality = std::clamp(kind.file->quality, 1.0, 100.0);
    jpeg_set_linear_quality(&info, 100, TRUE);
    for (JQUANT_TBL* table : info.quant_tbl_ptrs)
      for (std::size_t i = 0; table && i < DCTSIZE2; ++i)
        table->quantval[i] =
            kind.file->of_textures ? texture_step(i, quality) : step_of(table->quantval[i], quality, 0.5);
  }
  /// Three channels of data are three different things, but there are two pairs of Huffman tables: the last
  /// channel (z of a normal, metalness) differs most from the others. All are quantised like luma, or the
  /// last one more coarsely.
  void use_second_tables_for_last() {
    info.comp_info[2].dc_tbl_no = info.comp_info[2].ac_tbl_no = 1;
    if (!kind.coarse_last) {
      info.quant_tbl_ptrs[1] = nullptr;
      return;
    }
    info.comp_info[2].quant_tbl_no = 1;
    for (std::size_t k = 0; k < DCTSIZE2; ++k)
      info.quant_tbl_ptrs[1]->quantval[k] = static_cast<UINT16>(
          std::min(255u, kLastChannelTimes * unsigned{info.quant_tbl_ptrs[0]->quantval[k]}));
  }
};

std::uint16_t texture_step(std::size_t i, double quality) {
  const std::size_t row = i / DCTSIZE, column = i % DCTSIZE;
  return step_of(4 * (1 + static_cast<double>(row * row + column * column)), quality, rounding_of(i));
}

std::vector<std::uint8_t> jpeg_of_coefficients(const CoefficientFile& file) {
  Compressor coder;
  coder.run([&] {
    set_up_file(coder.info, file);
    write_blocks(coder.info, file);
  });
  return {coder.output().begin(), coder.output().end()};
}

JpegCoder::JpegCoder(const JpegKind& kind) : state_(new State(kind)) {
  if (kind.channels != 1 && kind.channels != 3)
    throw StageError("jpeg", "channels", "1 or 3", std::to_string(kind.channels));
  if (kind.progressive) state_->scans = progressive_scans(static_cast<int>(kind.channels));
  state_->run([&] { state_->set_up(); });
}

JpegCoder::~JpegCoder() = default;

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
    // Two steps, since g++ 12's -fsanitize=bounds breaks on one expression.
    JHUFF_TBL* const* const kind = k % 2 ? info.ac_huff_tbl_ptrs : info.dc_huff_tbl_ptrs;
    JHUFF_TBL& to = *kind[k / 2];
    std::copy(tables[k].bits.begin(), tables[k].bits.end(), to.bits);
    std::memset(to.huffval, 0, sizeof to.huffval);
    std::copy(tables[k].symbols.begin(), tables[k].symbols.end(), to.huffval);
  }
}

std::vector<std::array<std::uint16_t, 64>> JpegCoder::quantisers() const {
  const jpeg_compress_struct& info = state_->info;
  std::vector<std::array<std::uint16_t, 64>> out(static_cast<std::size_t>(info.num_components));
  for (std::size_t c = 0; c < out.size(); ++c)
    for (std::size_t k = 0; k < kBlockCoefficients; ++k)
      out[c][k] = info.quant_tbl_ptrs[info.comp_info[c].quant_tbl_no]->quantval[kNaturalOfZigzag[k]];
  return out;
}

std::vector<std::vector<std::uint8_t>> JpegCoder::possible_symbols() const {
  const jpeg_compress_struct& info = state_->info;
  std::vector<std::vector<std::uint8_t>> out;
  for (int pair = 0; pair < static_cast<int>(state_->table_pairs()); ++pair) {
    unsigned dc = 0;
    std::array<unsigned, kBlockCoefficients + 1> ac{};  // [k]: of coefficient k or a later one
    for (int c = 0; c < info.num_components; ++c) {
      if (info.comp_info[c].dc_tbl_no != pair) continue;
      const JQUANT_TBL& quantisers = *info.quant_tbl_ptrs[info.comp_info[c].quant_tbl_no];
      dc = std::max(dc, bit_length(2 * largest_coefficient(quantisers, 0)));
      unsigned later = 0;
      for (std::size_t k = kBlockCoefficients - 1; k > 0; --k) {
        later = std::max(later, bit_length(largest_coefficient(quantisers, k)));
        ac[k] = std::max(ac[k], later);
      }
    }
    out.push_back(dc_symbols(dc));
    out.push_back(ac_symbols(ac));
  }
  return out;
}

std::vector<std::uint8_t> JpegCoder::head_stream(std::uint32_t width_px, std::uint32_t height_px) {
  const std::vector<std::uint8_t> grey(std::size_t{width_px} * height_px * state_->kind.channels, 128);
  state_->write_abbreviated(
      {grey.data(), std::size_t{width_px} * state_->kind.channels, width_px, height_px});
  const auto frame = state_->output().subspan(kMarkerBytes, state_->frame_head_bytes() - kMarkerBytes);
  std::vector<std::uint8_t> out{0xff, 0xd8};
  const std::vector<std::uint8_t> frame_bytes(frame.begin(), frame.end());
  if (state_->kind.rgb) out.insert(out.end(), kAdobeMarker.begin(), kAdobeMarker.end());
  state_->run([&] {
    jpeg_suppress_tables(&state_->info, FALSE);
    if (state_->kind.progressive) state_->suppress_huffman_tables();
    jpeg_write_tables(&state_->info);
  });
  const auto tables = state_->output();
  out.insert(out.end(), tables.begin() + kMarkerBytes, tables.end() - kMarkerBytes);
  out.insert(out.end(), frame_bytes.begin(), frame_bytes.end());
  out.insert(out.end(), {0xff, 0xd9});
  return out;
}

void JpegCoder::append_body(const PixelWindow& image, std::vector<std::uint8_t>& out) {
  state_->write_abbreviated(image);
  const auto body = state_->output().subspan(state_->frame_head_bytes());
  if (state_->kind.progressive) {
    out.insert(out.end(), body.begin(), body.end() - kMarkerBytes);
  } else {
    out.insert(out.end(), {0xff, 0xd8});
    out.insert(out.end(), body.begin(), body.end());
  }
}

std::vector<std::uint8_t> JpegCoder::complete(const PixelWindow& image) {
  state_->info.optimize_coding = TRUE;
  std::vector<std::uint8_t> out = complete_as_is(image);
  state_->info.optimize_coding = state_->kind.progressive ? TRUE : FALSE;
  return out;
}

std::vector<std::uint8_t> JpegCoder::complete_as_is(const PixelWindow& image) {
  jpeg_compress_struct& info = state_->info;
  state_->set_image(image);
  state_->run([&] {
    info.write_JFIF_header = state_->kind.rgb ? FALSE : TRUE;
    info.write_Adobe_marker = state_->kind.rgb ? TRUE : FALSE;
    state_->write(TRUE);
  });
  return {state_->output().begin(), state_->output().end()};
}

void JpegCoder::count_symbols(const PixelWindow& image, SymbolCounts& counts) {
  state_->write_abbreviated(image);
  std::vector<std::uint8_t> mcu;
  const jpeg_compress_struct& info = state_->info;
  for (int c = 0; c < info.num_components; ++c) {
    const jpeg_component_info& component = info.comp_info[c];
    const int blocks = info.num_components == 1 ? 1 : component.h_samp_factor * component.v_samp_factor;
    mcu.insert(mcu.end(), static_cast<std::size_t>(blocks), static_cast<std::uint8_t>(component.dc_tbl_no));
  }
  const std::uint32_t side = mcu.size() > 3 ? 16 : 8;
  const std::size_t mcus =
      std::size_t{(image.width_px + side - 1) / side} * ((image.height_px + side - 1) / side);
  const auto stream = state_->output().subspan(state_->frame_head_bytes());
  texmesh::count_symbols(stream.first(stream.size() - kMarkerBytes), mcu, mcus * mcu.size(), tables(),
                         counts);
}

void jpeg_samples(const PixelWindow& image, const JpegKind& kind, std::size_t component,
                  std::vector<float>& out) {
  constexpr int kWeights[3][3] = {{19595, 38470, 7471}, {-11059, -21709, 32768}, {32768, -27439, -5329}};
  constexpr int kOffset[3] = {32768 - (128 << 16), 32767, 32767};
  out.resize(std::size_t{image.width_px} * image.height_px);
  const int *m = kWeights[component], offset = kOffset[component];
  float* to = out.data();
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    const std::uint8_t* p = image.data + y * image.stride_bytes;
    if (kind.channels == 1 || kind.rgb)
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += kind.channels)
        *to++ = static_cast<float>(p[component] - 128);
    else
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += 3)
        *to++ = static_cast<float>((m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + offset) >> 16);
  }
}

Pixels decode_jpeg(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels) {
  return decode(bytes, max_pixels, false);
}

Pixels decode_jpeg_luma(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels) {
  return decode(bytes, max_pixels, true);
}

Pixels luma_of(const Pixels& pixels) {
  if (pixels.channels == 1) return pixels;
  Pixels out{pixels.width_px, pixels.height_px, 1, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px);
  const std::uint8_t* from = pixels.data.data();
  for (std::uint8_t& to : out.data) {  // 0.299, 0.587, 0.114 in 16 bits
    to = static_cast<std::uint8_t>((19595u * from[0] + 38470u * from[1] + 7471u * from[2] + 32768u) >> 16);
    from += pixels.channels;
  }
  return out;
}

std::vector<std::uint8_t> encode_jpeg(const Pixels& pixels, int quality, Subsampling subsampling) {
  const std::size_t stride = std::size_t{pixels.width_px} * pixels.channels;
  if (pixels.data.size() != stride * pixels.height_px)
    throw StageError("jpeg", "pixels", std::to_string(stride * pixels.height_px) + " bytes",
                     std::to_string(pixels.data.size()));
  JpegCoder coder({pixels.channels, quality, subsampling});
  return coder.complete({pixels.data.data(), stride, pixels.width_px, pixels.height_px});
}

}  // namespace texmesh
