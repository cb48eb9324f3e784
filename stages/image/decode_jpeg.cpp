#include "stages/image/decode_jpeg.h"

#include <algorithm>
#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>
// jerror.h needs jpeglib.h first.
#include <jerror.h>

#include "format/base/errors.h"

namespace texmesh {
namespace {

// A progressive file of endless scans is an attack on time; encoders write about 10.
constexpr int kMaxScans = 500;

struct JpegDecoder {
  jpeg_decompress_struct info{};
  jpeg_error_mgr errors{};
  std::jmp_buf escape;
  char message[JMSG_LENGTH_MAX] = "";
  std::string* damage = nullptr;  // what is wrong goes here, as far as decoding goes on

  JpegDecoder() = default;
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;
  ~JpegDecoder() { jpeg_destroy_decompress(&info); }
};

[[noreturn]] void escape_with_message(j_common_ptr info) {
  auto* decoder = static_cast<JpegDecoder*>(info->client_data);
  info->err->format_message(info, decoder->message);
  std::longjmp(decoder->escape, 1);
}

JDIMENSION row_of_scan(const jpeg_decompress_struct& info) {
  return std::min<JDIMENSION>(
      info.image_height, info.input_iMCU_row * static_cast<JDIMENSION>(info.max_v_samp_factor) * DCTSIZE);
}

/// Where a file goes wrong that holds its pixels in several scans, or whose rows are not given yet.
std::string scan_place(const JpegDecoder& decoder) {
  const jpeg_decompress_struct& info = decoder.info;
  if (info.input_scan_number == 0 || !info.comps_in_scan) return "JPEG header";
  return "scan " + std::to_string(info.input_scan_number) + ", row " + std::to_string(row_of_scan(info)) +
         " of " + std::to_string(info.image_height);
}

/// Whether enough is there without what is missing. Where there are restart markers, a marker before its time
/// costs what stands before the next one.
bool goes_on(const JpegDecoder& decoder, int code) {
  const jpeg_decompress_struct& info = decoder.info;
  const bool ends = code == JWRN_JPEG_EOF || (code == JWRN_HIT_MARKER && info.restart_interval == 0);
  return info.comps_in_scan &&
         (!ends || info.input_scan_number > 1 || 2 * row_of_scan(info) >= info.image_height);
}

void on_damage(j_common_ptr info) {
  auto* decoder = static_cast<JpegDecoder*>(info->client_data);
  if (!decoder->damage || !goes_on(*decoder, info->err->msg_code)) escape_with_message(info);
  if (!decoder->damage->empty()) return;
  char message[JMSG_LENGTH_MAX];
  info->err->format_message(info, message);
  *decoder->damage = scan_place(*decoder) + ": " + message;
}

void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;  // a trace
  // The others are stray bytes between markers and the like: every viewer shows such files.
  for (const int damage :
       {JWRN_JPEG_EOF, JWRN_HIT_MARKER, JWRN_HUFF_BAD_CODE, JWRN_ARITH_BAD_CODE, JWRN_MUST_RESYNC})
    if (info->err->msg_code == damage) return on_damage(info);
}

void on_progress(j_common_ptr info) {
  auto* decoder = static_cast<JpegDecoder*>(info->client_data);
  if (decoder->info.input_scan_number <= kMaxScans) return;
  std::snprintf(decoder->message, sizeof decoder->message, "more than %d scans", kMaxScans);
  std::longjmp(decoder->escape, 1);
}

void open_jpeg(JpegDecoder& decoder, jpeg_progress_mgr& progress, std::span<const std::uint8_t> bytes) {
  decoder.info.err = jpeg_std_error(&decoder.errors);
  decoder.errors.error_exit = escape_with_message;
  decoder.errors.emit_message = on_message;
  decoder.info.client_data = &decoder;
  progress.progress_monitor = on_progress;
  if (setjmp(decoder.escape)) return;
  jpeg_create_decompress(&decoder.info);
  decoder.info.client_data = &decoder;
  decoder.info.progress = &progress;
  jpeg_mem_src(&decoder.info, bytes.data(), bytes.size());
  jpeg_read_header(&decoder.info, TRUE);
}

bool is_cmyk(const jpeg_decompress_struct& info) {
  return info.jpeg_color_space == JCS_CMYK || info.jpeg_color_space == JCS_YCCK;
}

void choose_output(jpeg_decompress_struct& info) {
  info.dct_method = JDCT_ISLOW;
  info.do_fancy_upsampling = TRUE;
  info.out_color_space = info.jpeg_color_space == JCS_GRAYSCALE ? JCS_GRAYSCALE
                         : is_cmyk(info)                        ? JCS_CMYK
                                                                : JCS_RGB;
}

bool start_jpeg(JpegDecoder& decoder) {
  if (setjmp(decoder.escape)) return false;
  choose_output(decoder.info);
  return jpeg_start_decompress(&decoder.info) != FALSE;
}

bool next_jpeg_row(JpegDecoder& decoder, std::uint8_t* row) {
  if (setjmp(decoder.escape)) return false;
  JSAMPROW rows[1] = {row};
  return jpeg_read_scanlines(&decoder.info, rows, 1) == 1;
}

bool finish_jpeg(JpegDecoder& decoder) {
  if (setjmp(decoder.escape)) return false;
  return jpeg_finish_decompress(&decoder.info) != FALSE;
}

void cmyk_to_rgb(std::uint8_t* row, std::uint32_t width_px, bool inverted) {
  for (std::uint32_t x = 0; x < width_px; ++x) {
    const std::uint8_t* in = row + static_cast<std::size_t>(x) * 4;
    unsigned k = inverted ? in[3] : 255u - in[3];
    std::uint8_t rgb[3];
    for (int c = 0; c < 3; ++c) {
      const unsigned ink = inverted ? in[c] : 255u - in[c];
      rgb[c] = static_cast<std::uint8_t>((ink * k + 127) / 255);
    }
    std::uint8_t* out = row + static_cast<std::size_t>(x) * 3;
    for (int c = 0; c < 3; ++c) out[c] = rgb[c];
  }
}

jvirt_barray_ptr* read_coefficients(JpegDecoder& decoder) {
  if (setjmp(decoder.escape)) return nullptr;
  return jpeg_read_coefficients(&decoder.info);
}

/// Where a row of blocks is in memory; all of them are there at once.
JBLOCKROW block_row(JpegDecoder& decoder, jvirt_barray_ptr blocks, JDIMENSION row) {
  if (setjmp(decoder.escape)) return nullptr;
  auto* info = reinterpret_cast<j_common_ptr>(&decoder.info);
  return *decoder.info.mem->access_virt_barray(info, blocks, row, 1, FALSE);
}

[[noreturn]] void fail_jpeg(const std::string& name, const std::string& place, const JpegDecoder& decoder) {
  throw InputError(name, place, "a JPEG that decodes", decoder.message[0] ? decoder.message : "no more data");
}

}  // namespace

JpegHeader read_jpeg_header(const std::string& name, std::span<const std::uint8_t> bytes) {
  JpegDecoder decoder;
  jpeg_progress_mgr progress{};
  open_jpeg(decoder, progress, bytes);
  if (decoder.message[0]) fail_jpeg(name, "JPEG header", decoder);
  const int components = decoder.info.num_components;
  if (components != 1 && components != 3 && components != 4)
    throw InputError(name, "JPEG header", "1, 3 or 4 components", std::to_string(components));
  return {decoder.info.image_width, decoder.info.image_height, components == 1 ? 1u : 3u};
}

void decode_jpeg(const std::string& name, std::span<const std::uint8_t> bytes,
                 const std::function<void(const std::uint8_t* pixels)>& row, std::string* damage) {
  JpegDecoder decoder;
  decoder.damage = damage;
  jpeg_progress_mgr progress{};
  open_jpeg(decoder, progress, bytes);
  if (decoder.message[0]) fail_jpeg(name, "JPEG header", decoder);
  if (!start_jpeg(decoder)) fail_jpeg(name, scan_place(decoder), decoder);
  const std::uint32_t width = decoder.info.output_width, height = decoder.info.output_height;
  const bool cmyk = decoder.info.out_color_space == JCS_CMYK;
  std::vector<std::uint8_t> buffer(static_cast<std::size_t>(width) *
                                   static_cast<std::size_t>(decoder.info.output_components));
  for (std::uint32_t y = 0; y < height; ++y) {
    if (!next_jpeg_row(decoder, buffer.data()))
      fail_jpeg(name, "row " + std::to_string(y) + " of " + std::to_string(height), decoder);
    if (cmyk) cmyk_to_rgb(buffer.data(), width, decoder.info.saw_Adobe_marker != 0);
    row(buffer.data());
  }
  if (!finish_jpeg(decoder)) fail_jpeg(name, "end of the JPEG", decoder);
}

struct JpegCoefficients::State {
  JpegDecoder decoder;
  jpeg_progress_mgr progress{};
  std::vector<std::vector<JBLOCKROW>> rows;  // [component]
};

JpegCoefficients::JpegCoefficients(const std::string& name, std::span<const std::uint8_t> bytes)
    : state_(std::make_unique<State>()) {
  JpegDecoder& decoder = state_->decoder;
  open_jpeg(decoder, state_->progress, bytes);
  if (decoder.message[0]) fail_jpeg(name, "JPEG header", decoder);
  jvirt_barray_ptr* const blocks = read_coefficients(decoder);
  if (!blocks) fail_jpeg(name, scan_place(decoder), decoder);
  for (int c = 0; c < decoder.info.num_components; ++c) {
    const jpeg_component_info& from = decoder.info.comp_info[c];
    Component to;
    to.across = static_cast<std::uint32_t>(from.h_samp_factor);
    to.down = static_cast<std::uint32_t>(from.v_samp_factor);
    to.blocks_across = from.width_in_blocks;
    to.blocks_down = from.height_in_blocks;
    if (!from.quant_table) fail_jpeg(name, "quantisers", decoder);
    for (std::size_t k = 0; k < 64; ++k) to.quantisers[k] = from.quant_table->quantval[k];
    components_.push_back(to);
    std::vector<JBLOCKROW>& rows = state_->rows.emplace_back();
    for (JDIMENSION row = 0; row < from.height_in_blocks; ++row)
      if (!rows.emplace_back(block_row(decoder, blocks[c], row))) fail_jpeg(name, "coefficients", decoder);
  }
}

JpegCoefficients::~JpegCoefficients() = default;

std::uint32_t JpegCoefficients::width_px() const { return state_->decoder.info.image_width; }
std::uint32_t JpegCoefficients::height_px() const { return state_->decoder.info.image_height; }
bool JpegCoefficients::is_rgb() const { return state_->decoder.info.jpeg_color_space == JCS_RGB; }
bool JpegCoefficients::is_plain() const {
  const J_COLOR_SPACE space = state_->decoder.info.jpeg_color_space;
  return space == JCS_GRAYSCALE || space == JCS_YCbCr || space == JCS_RGB;
}

const std::int16_t* JpegCoefficients::block(std::size_t component, std::uint32_t row,
                                            std::uint32_t column) const {
  return state_->rows[component][row][column];
}

}  // namespace texmesh
