// Inside the module texmesh_readers.so: JPEGs of 9 to 16 bits a sample, which libjpeg-turbo 2 refuses, and
// OpenImageIO, which asks it. DCMTK has the Independent JPEG Group's decoder built for 12 and for 16 bits.
#include "stages/image/readers_module/other_pictures.h"

#include <memory>
#include <mutex>

#include <dcmtk/config/osconfig.h>
// DCMTK's headers need its configuration first.
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djdijg12.h>
#include <dcmtk/dcmjpeg/djdijg16.h>

namespace texmesh {

std::vector<std::uint16_t> decode_wide_jpeg_file(const std::string& name, ByteSpan bytes,
                                                 const WideJpegHeader& header) {
  static std::once_flag once;
  std::call_once(once,
                 [] { OFLog::configure(OFLogger::OFF_LOG_LEVEL); });  // it would write to standard error
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_guess, EUC_never, EPC_colorByPixel);
  std::unique_ptr<DJDecoder> decoder;
  if (header.bits <= 12)
    decoder = std::make_unique<DJDecompressIJG12Bit>(parameters, OFFalse);
  else
    decoder = std::make_unique<DJDecompressIJG16Bit>(parameters, OFFalse);
  std::vector<std::uint16_t> samples(std::size_t{header.width_px} * header.height_px * header.channels);
  Bytes file(bytes.begin(), bytes.end());  // it asks for bytes that it might change
  OFCondition result = decoder->init();
  if (result.good())
    result = decoder->decode(file.data(), static_cast<Uint32>(file.size()),
                             reinterpret_cast<Uint8*>(samples.data()),
                             static_cast<Uint32>(samples.size() * sizeof samples[0]), OFFalse);
  if (result == EJ_Suspension)
    throw InputError(name, "pixels", "a whole JPEG of " + std::to_string(header.bits) + " bits",
                     "its end too early");
  if (result.bad())
    throw InputError(name, "pixels", "a JPEG of " + std::to_string(header.bits) + " bits that decodes",
                     result.text());
  return samples;
}

}  // namespace texmesh
