#include "tests/support/wide_jpeg.h"

#include <memory>
#include <stdexcept>

#include <dcmtk/config/osconfig.h>
// DCMTK's headers need its configuration first.
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djeijg12.h>
#include <dcmtk/dcmjpeg/djeijg16.h>

namespace texmesh::testing {

std::vector<std::uint8_t> wide_jpeg(unsigned width, unsigned height, std::vector<std::uint16_t> samples,
                                    unsigned bits) {
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_guess, EUC_never, EPC_colorByPixel);
  std::unique_ptr<DJEncoder> encoder;
  if (bits == 12)
    encoder = std::make_unique<DJCompressIJG12Bit>(parameters, EJM_sequential, Uint8{95});
  else
    encoder = std::make_unique<DJCompressIJG16Bit>(parameters, EJM_lossless, 1, 0);
  const auto channels = static_cast<Uint16>(samples.size() / (std::size_t{width} * height));
  Uint8* bytes = nullptr;
  Uint32 size = 0;
  const OFCondition result =
      encoder->encode(static_cast<Uint16>(width), static_cast<Uint16>(height),
                      channels == 1 ? EPI_Monochrome2 : EPI_RGB, channels, samples.data(), bytes, size);
  const std::unique_ptr<Uint8[]> owned(bytes);
  if (result.bad()) throw std::runtime_error(result.text());
  return {bytes, bytes + size};
}

}  // namespace texmesh::testing
