// A client without the compiler: reads a package, plans, simulates, loads. Its size is tested
// (house_delivery_size).
#include <iostream>

#include "delivery/cpp/client/delivery_plan.h"
#include "delivery/cpp/client/texture_loader.h"
#include "delivery/cpp/transfer/transfer.h"
#include "format/base/errors.h"
#include "format/container/layout.h"
#include "format/split/split_reader.h"
#include "format/split/split_stream.h"

int main(int argc, char** argv) {
  using namespace texmesh;  // NOLINT: a program's main file
  if (argc < 2) return 2;
  try {
    PackageReader package(open_store(argv[1]));
    DeliveryRequest request;
    const DeliveryPlan plan = plan_delivery(package, request);
    std::cout << "S_" << plan.scale << ", " << plan.bytes() << " bytes, FLIP " << plan.flip << '\n';
    if (package.manifest().stream) {
      SplitStreamReader stream(package.split_stream_head());
      stream.read_to_scale(0, package.entry(kSplitStreamPath));
      std::cout << stream.mesh().face_count() << " faces to begin with\n";
    }
    if (argc > 2) {
      const auto transport = open_transport({argv[2]});
      TextureLoader loader(package, *transport);
      std::cout << loader.load(plan.planes, {}).transfer.bytes << " bytes of textures\n";
    }
  } catch (const Error& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
