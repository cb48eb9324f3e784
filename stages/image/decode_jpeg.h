#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

// The JPEG half of decode_image: libjpeg-turbo itself. OpenImageIO 2.4 takes 1.3x as long (87 instead of 65
// ms for 4096^2), reports a truncated file and a harmless stray byte alike, and wants the whole image's
// memory at once; here rows arrive one by one, so that a file which lies about its size costs no memory.

struct JpegHeader {
  std::uint32_t width_px = 0, height_px = 0, channels = 0;  // channels after decoding: 1 or 3
};

/// Throws InputError{name, ...} when the bytes are no JPEG that can be decoded to 8-bit grey or RGB.
JpegHeader read_jpeg_header(const std::string& name, std::span<const std::uint8_t> bytes);

/// Calls row(pixels) for every row, top first; pixels are width * channels bytes. Accurate integer DCT,
/// triangle-filter upsampling. Throws InputError when the data ends early or is corrupt. With `damage` such a
/// file is decoded as viewers show it, and `damage` says where it is wrong first, and how; it is refused when
/// its data end before half of its first scan's rows.
void decode_jpeg(const std::string& name, std::span<const std::uint8_t> bytes,
                 const std::function<void(const std::uint8_t* pixels)>& row, std::string* damage = nullptr);

/// The quantised coefficients of a JPEG, baseline or progressive: all that decoding to pixels starts from.
/// Takes two bytes for every sample. Throws as decode_jpeg.
class JpegCoefficients {
 public:
  struct Component {
    std::uint32_t across = 1, down = 1;                // sampling factors
    std::uint32_t blocks_across = 0, blocks_down = 0;  // that show something of the image
    std::array<std::uint16_t, 64> quantisers{};        // row by row, as the coefficients of a block
  };
  JpegCoefficients(const std::string& name, std::span<const std::uint8_t> bytes);
  ~JpegCoefficients();
  JpegCoefficients(const JpegCoefficients&) = delete;
  JpegCoefficients& operator=(const JpegCoefficients&) = delete;

  std::uint32_t width_px() const;
  std::uint32_t height_px() const;
  bool is_rgb() const;  // three components that are not YCbCr
  /// Grey, YCbCr or RGB: what a baseline JPEG without further markers can hold.
  bool is_plain() const;
  const std::vector<Component>& components() const { return components_; }
  /// 64 coefficients, row by row. May be called by several threads.
  const std::int16_t* block(std::size_t component, std::uint32_t row, std::uint32_t column) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  std::vector<Component> components_;
};

}  // namespace texmesh
