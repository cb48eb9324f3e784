// Pictures: what models bring, their profiles and metadata, coefficients of JPEGs, and files of fragments.
#include <zlib.h>

#include <algorithm>
#include <cstdlib>

#include "format/base/errors.h"
#include "format/model/codec.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/avif.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "stages/image/image_metadata.h"
#include "stages/image/ktx2/read_ktx2.h"
#include "stages/image/readers_module/other_pictures.h"
#include "stages/jpeg/source_jpeg.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/reader_limits.h"
#include "tests/support/images.h"
#include "tests/support/ktx2_writer.h"

namespace texmesh::fuzz {
namespace {

ImageLimits image_limits() {
  ImageLimits limits;
  limits.max_pixels = static_cast<std::uint64_t>(reader_limits().max_image_pixels);
  return limits;
}

template <ImageFormat kFormat>
bool read_image(ByteSpan input) {
  if (sniff_image_format(input) != kFormat) return false;
  try {
    Image image = probe_image("fuzz", {input.begin(), input.end()}, image_limits());
    image.honour_profile = true;
    const Pixels pixels = decode_image(image, FloatEncoding::kSrgb);
    require(pixels.data.size() == std::size_t{image.width_px} * image.height_px * pixels.channels,
            "an image of another size than its header's");
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

bool read_ktx2_file(ByteSpan input) {
  if (!is_ktx2(input)) return false;
  try {
    const Pixels pixels = read_ktx2("fuzz", input, image_limits()).pixels;
    require(pixels.data.size() == std::size_t{pixels.width_px} * pixels.height_px * pixels.channels,
            "an image of another size than its header's");
    constexpr std::size_t kFew = 1 << 14;  // as a PNG takes as long as reading a hundred of them
    if (pixels.data.size() > kFew) return true;
    const Image png = probe_image("fuzz", png_of_ktx2("fuzz", input, image_limits()), image_limits());
    require(decode_image(png).data == pixels.data, "a PNG of other texels");
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

/// What becomes a PNG or a TIFF when it is imported.
bool read_other_picture(ByteSpan input) {
  const std::string name = "fuzz.tga";
  const auto kind = sniff_other_picture(name, input);
  if (!kind || sniff_image_format(input)) return false;
  try {
    const ConvertedPicture picture = convert_other_picture(name, *kind, input, image_limits());
    const Image image = probe_image(name, picture.bytes, image_limits());
    require(decode_image(image).data.size() == std::size_t{image.width_px} * image.height_px * image.channels,
            "an image of another size than its header's");
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

bool read_coefficients(ByteSpan input) {
  try {
    const JpegHeader header = read_jpeg_header("fuzz", input);
    check_image_size("fuzz", header.width_px, header.height_px, image_limits());
    const JpegCoefficients jpeg("fuzz", input);
    int sum = 0;
    for (std::size_t c = 0; c < jpeg.components().size(); ++c)
      for (std::uint32_t row = 0; row < jpeg.components()[c].blocks_down; ++row)
        for (std::uint32_t column = 0; column < jpeg.components()[c].blocks_across; ++column)
          sum ^= jpeg.block(c, row, column)[row % 64];
    std::string why_not;
    const auto layout = source_layout(jpeg, 64, 64, why_not);
    if (layout)
      for (const auto& steps : layout->quantisers) sum ^= quality_of(steps);
    return sum != -1;
  } catch (const InputError& e) {
    return refused(e);
  }
}

template <Codec kCodec>
bool read_fragment(ByteSpan input) {
  try {
    decode_fragment_file(kCodec, input, 1 << 20);
    decode_fragment_file_luma(kCodec, input, 1 << 20);
    return true;
  } catch (const FormatError& e) {
    return refused(e);
  }
}

/// Tables up to a place that the first two bytes choose, the rest is the stream.
bool join_streams(ByteSpan input) {
  Choices c(input);
  const std::size_t wanted = c.number(2), cut = std::min(wanted, c.rest().size());
  const ByteSpan tables = c.rest().first(cut), stream = c.rest().subspan(cut);
  try {
    const Bytes file = join_fragment(Codec::kJpeg, tables, stream);
    require(std::ranges::equal(split_fragment(Codec::kJpeg, tables, file, 0), stream),
            "a stream changed by being joined and split");
    return true;
  } catch (const FormatError& e) {
    return refused(e);
  }
}

bool read_icc(ByteSpan input) {
  bool any = false;
  for (const std::uint32_t channels : {1u, 3u}) {
    try {
      const ColourProfile profile = read_icc_profile("fuzz", input, channels);
      Pixels pixels{2, 1, channels, Bytes(2 * channels, 99)};
      is_srgb(profile);
      convert_to_srgb(profile, pixels);
      any = true;
    } catch (const InputError&) {
    }
  }
  return any;
}

/// What a JPEG's EXIF segment holds.
bool read_exif(ByteSpan input) {
  BytesOut out;
  const std::size_t bytes = std::min<std::size_t>(input.size(), 65000) + 8;
  out.u8(0xff), out.u8(0xd8), out.u8(0xff), out.u8(0xe1), out.u8(bytes >> 8), out.u8(bytes & 255);
  out.text(std::string_view("Exif\0\0", 6));
  out.raw(input.first(bytes - 8));
  out.u8(0xff), out.u8(0xd9), out.u8(0), out.u8(0);
  const int orientation = read_image_metadata(ImageFormat::kJpeg, out.finish()).orientation;
  require(orientation >= 1 && orientation <= 8, "no such orientation");
  return orientation != 1;
}

bool read_metadata(ByteSpan input) {
  const auto format = sniff_image_format(input);
  if (!format) return false;
  const ImageMetadata m = read_image_metadata(*format, input);
  require(m.orientation >= 1 && m.orientation <= 8, "no such orientation");
  return true;
}

// ---- seeds

std::vector<Bytes> jpeg_seeds() {
  using texmesh::testing::jpeg_bytes;
  const Bytes colour = jpeg_bytes(24, 17, 3);
  OIIO::ImageSpec progressive;
  progressive.attribute("Compression", "jpeg:60");
  progressive.attribute("jpeg:progressive", 1);
  return {colour, jpeg_bytes(9, 9, 1), texmesh::testing::cmyk_jpeg(9, 8, {0, 100, 200, 50}, true),
          texmesh::testing::encode_image("jpeg", 20, 20, 3, texmesh::testing::test_picture(20, 20, 3),
                                         OIIO::TypeDesc::UINT8, progressive)};
}

template <Codec kCodec>
std::vector<Bytes> fragment_seeds() {
  PlaneCoding coding;
  coding.fragment_width_px = coding.fragment_height_px = 16;
  coding.qualities = {50, 80};
  const auto codec = make_texture_codec(kCodec, coding);
  const Bytes picture = texmesh::testing::test_picture(16, 16, 3);
  const PixelWindow window{picture.data(), 48, 16, 16};
  const auto rungs = codec->train(std::span(&window, 1), {});
  std::vector<Bytes> streams(rungs.size());
  codec->encoder()->encode(window, streams);
  const std::vector<ByteSpan> parts(streams.begin(), streams.end());
  if (codec_traits(kCodec).incremental) return {join_fragment(kCodec, rungs[0].table_stream, parts)};
  return {join_fragment(kCodec, rungs[0].table_stream, streams[0])};
}

std::vector<Bytes> joined_seeds() {
  BytesOut out;
  out.u16(4);
  for (const unsigned x : {0xff, 0xd8, 0xff, 0xd9, 0xff, 0xd8, 0xff, 0xda, 7, 0xff, 0xd9}) out.u8(x);
  return {out.finish()};
}

template <class T>
std::vector<Bytes> encoded(const char* writer, OIIO::TypeDesc type,
                           const std::vector<int>& channel_counts = {1, 3, 4}) {
  std::vector<Bytes> list;
  for (const int channels : channel_counts) {
    std::vector<T> samples;
    for (const std::uint8_t s : texmesh::testing::test_picture(7, 5, channels))
      samples.push_back(static_cast<T>(s));
    OIIO::ImageSpec same_every_time;
    same_every_time.attribute("DateTime", "2026:01:01 00:00:00");
    list.push_back(texmesh::testing::encode_image(writer, 7, 5, channels, samples, type, same_every_time));
  }
  return list;
}

std::vector<Bytes> png_seeds() {
  auto list = encoded<std::uint8_t>("png", OIIO::TypeDesc::UINT8);
  list.push_back(encoded<std::uint16_t>("png", OIIO::TypeDesc::UINT16)[1]);
  return list;
}
std::vector<Bytes> webp_seeds() { return encoded<std::uint8_t>("webp", OIIO::TypeDesc::UINT8, {3, 4}); }
std::vector<Bytes> tiff_seeds() {
  auto list = encoded<std::uint8_t>("tiff", OIIO::TypeDesc::UINT8);
  list.push_back(encoded<float>("tiff", OIIO::TypeDesc::FLOAT)[1]);
  return list;
}
std::vector<Bytes> exr_seeds() { return encoded<float>("openexr", OIIO::TypeDesc::FLOAT); }

std::vector<Bytes> picture_seeds() {
  std::vector<Bytes> list = encoded<float>("hdr", OIIO::TypeDesc::FLOAT, {3});
  for (const char* writer : {"bmp", "targa", "gif"})
    list.push_back(encoded<std::uint8_t>(writer, OIIO::TypeDesc::UINT8, {3})[0]);
  list.push_back(texmesh::testing::encode_image(
      "jpeg2000", 64, 64, 3, texmesh::testing::test_picture(64, 64, 3), OIIO::TypeDesc::UINT8));
  BytesOut dds;  // 4 x 4 texels in a block
  dds.text("DDS "), dds.u32(124), dds.u32(0x1007), dds.u32(4), dds.u32(4);
  for (int i = 0; i < 14; ++i) dds.u32(0);
  dds.u32(32), dds.u32(4), dds.text("DXT1");
  for (const unsigned x : {0, 0, 0, 0, 0, 0x1000, 0, 0, 0, 0}) dds.u32(x);
  dds.raw(Bytes{0, 0xf8, 0x1f, 0, 0x55, 1, 2, 3});
  list.push_back(dds.finish());
  return list;
}

std::vector<Bytes> avif_seeds() {
  std::vector<Bytes> list;
  for (const int channels : {1, 3, 4})
    list.push_back(encode_avif(
        {9, 7, static_cast<std::uint32_t>(channels), texmesh::testing::test_picture(9, 7, channels)},
        {.quality = 40, .data = channels == 3}));
  return list;
}

std::vector<Bytes> ktx2_seeds() {
  using namespace texmesh::testing;  // NOLINT: fixtures
  std::vector<Bytes> list;
  for (const bool zstd : {false, true})
    for (int channels = 1; channels <= 4; ++channels) {
      Ktx2Parts parts = ktx2_parts(7, 5, channels, test_picture(7, 5, channels), zstd);
      parts.zstd = zstd;
      parts.levels.push_back(test_picture(3, 2, channels));
      parts.keys = {{"KTXorientation", "ru"}, {"KTXswizzle", "rrrg"}};
      if (channels > 2) parts.keys.pop_back();
      list.push_back(ktx2_bytes(parts));
    }
  return list;
}

/// PNG's checksums, so that changed chunks are read.
Bytes with_checksums(ByteSpan input) {
  Bytes bytes(input.begin(), input.end());
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    std::size_t length = 0;
    for (std::size_t k = 0; k < 4; ++k) length = length << 8 | bytes[at + k];
    if (length > bytes.size() - at - 12) break;
    const auto crc =
        static_cast<std::uint32_t>(::crc32(0, bytes.data() + at + 4, static_cast<unsigned>(length + 4)));
    for (std::size_t k = 0; k < 4; ++k)
      bytes[at + 8 + length + k] = static_cast<std::uint8_t>(crc >> (24 - 8 * k));
    at += 12 + length;
  }
  return bytes;
}

/// A matrix profile with curves of every kind.
std::vector<Bytes> icc_seeds() {
  const auto u32 = [](Bytes& out, std::uint32_t x) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(x >> shift));
  };
  const auto tag = [&](std::string_view kind, std::initializer_list<std::uint32_t> words) {
    Bytes out = to_bytes(kind);
    u32(out, 0);
    for (const std::uint32_t w : words) u32(out, w);
    return out;
  };
  const std::vector<std::pair<std::string_view, Bytes>> tags{
      {"rXYZ", tag("XYZ ", {0x6fa2, 0x38f5, 0x0390})},
      {"gXYZ", tag("XYZ ", {0x6299, 0xb785, 0x18da})},
      {"bXYZ", tag("XYZ ", {0x24a0, 0x0f84, 0xb6cf})},
      {"rTRC", tag("curv", {1, 0x02330000})},
      {"gTRC", tag("curv", {2, 0x0000ffff})},
      {"bTRC", tag("para", {0x00030000, 0x26666, 0xf2a7, 0x0d59, 0x13d0, 0x0a5b})},
      {"kTRC", tag("curv", {0})}};
  std::vector<Bytes> list;
  for (const char* space : {"RGB ", "GRAY"}) {
    Bytes out(128, 0), data;
    std::copy_n(space, 4, out.begin() + 16);
    std::copy_n("acsp", 4, out.begin() + 36);
    u32(out, static_cast<std::uint32_t>(tags.size()));
    for (const auto& [name, bytes] : tags) {
      out.insert(out.end(), name.begin(), name.end());
      u32(out, static_cast<std::uint32_t>(132 + 12 * tags.size() + data.size()));
      u32(out, static_cast<std::uint32_t>(bytes.size()));
      data.insert(data.end(), bytes.begin(), bytes.end());
    }
    out.insert(out.end(), data.begin(), data.end());
    list.push_back(out);
  }
  return list;
}

std::vector<Bytes> exif_seeds() {
  std::vector<Bytes> list;
  for (const bool big : {false, true}) {
    BytesOut out;
    const auto word = [&](unsigned x, int bytes) {
      for (int k = 0; k < bytes; ++k) out.u8(x >> 8 * (big ? bytes - 1 - k : k) & 255);
    };
    out.text(big ? "MM" : "II");
    word(42, 2), word(8, 4), word(1, 2);
    word(0x112, 2), word(3, 2), word(1, 4), word(6, 2), word(0, 2), word(0, 4);
    list.push_back(out.finish());
  }
  return list;
}

std::vector<Bytes> metadata_seeds() {
  std::vector<Bytes> list;
  for (const auto& seeds : {jpeg_seeds(), png_seeds(), webp_seeds(), tiff_seeds(), exr_seeds()})
    list.push_back(seeds[0]);
  return list;
}

void add_metadata_targets(std::vector<Target>& list) {
  list.insert(list.end(),
              {{"icc",
                false,
                read_icc,
                icc_seeds,
                Shape::kBytes,
                nullptr,
                {"acsp", "RGB ", "GRAY", "curv", "para", "XYZ ", "A2B0", "kTRC"}},
               {"exif", false, read_exif, exif_seeds},
               {"image_metadata",
                false,
                read_metadata,
                metadata_seeds,
                Shape::kBytes,
                nullptr,
                {"ICC_PROFILE", "Exif", "iCCP", "gAMA", "cHRM", "ICCP", "chromaticities", "Adobe"}}});
}

}  // namespace

void add_image_targets(std::vector<Target>& list) {
  list.insert(
      list.end(),
      {{"jpeg", false, read_image<ImageFormat::kJpeg>, jpeg_seeds},
       {"coefficients", true, read_coefficients, jpeg_seeds},
       {"fragment", false, read_fragment<Codec::kJpeg>, fragment_seeds<Codec::kJpeg>},
       {"fragment_progressive", false, read_fragment<Codec::kJpegProgressive>,
        fragment_seeds<Codec::kJpegProgressive>},
       {"fragment_webp", false, read_fragment<Codec::kWebp>, fragment_seeds<Codec::kWebp>},
       {"fragment_join", true, join_streams, joined_seeds},
       {"png",
        false,
        read_image<ImageFormat::kPng>,
        png_seeds,
        Shape::kBytes,
        with_checksums,
        {"IHDR", "PLTE", "IDAT", "IEND", "tRNS", "gAMA", "cHRM", "iCCP", "sRGB", "acTL", "eXIf"}},
       {"webp",
        false,
        read_image<ImageFormat::kWebp>,
        webp_seeds,
        Shape::kBytes,
        nullptr,
        {"RIFF", "WEBP", "VP8 ", "VP8L", "VP8X", "ALPH", "ICCP", "ANIM", "ANMF", "EXIF"}},
       {"tiff", false, read_image<ImageFormat::kTiff>, tiff_seeds},
       {"exr",
        false,
        read_image<ImageFormat::kExr>,
        exr_seeds,
        Shape::kBytes,
        nullptr,
        {"channels", "chlist", "compression", "dataWindow", "displayWindow", "box2i", "lineOrder",
         "chromaticities", "tiles", "type", "deepscanline", "multiPartImage"}},
       {"ktx2",
        false,
        read_ktx2_file,
        ktx2_seeds,
        Shape::kBytes,
        nullptr,
        {"KTXorientation", "KTXswizzle", "rgb1", "rrr1", "rrrg", "ru"}},
       {"avif",
        false,
        read_other_picture,
        avif_seeds,
        Shape::kBytes,
        nullptr,
        {"ftyp", "avif", "avis", "mif1", "meta", "pitm", "iloc", "iinf", "infe",
         "av01", "iprp", "ipco", "ipma", "av1C", "ispe", "pixi", "auxC", "irot",
         "imir", "clap", "grid", "colr", "nclx", "prof", "mdat", "idat"}},
       {"picture",
        false,
        read_other_picture,
        picture_seeds,
        Shape::kBytes,
        nullptr,
        {"BM", "GIF89a", "DXT1", "DXT5", "ATI2", "DX10", "jp2h", "jp2c", "#?RADIANCE", "-Y ", "+X "}}});
  add_metadata_targets(list);
}

}  // namespace texmesh::fuzz
