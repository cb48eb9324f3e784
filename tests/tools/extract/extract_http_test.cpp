// extract from a web server: the same bytes as from the file, and no more requests than entries.
#include <gtest/gtest.h>
#include <httplib.h>

#include <thread>

#include "delivery/cpp/package/http_store.h"
#include "tests/support/packages.h"
#include "tools/extract/extract.h"

namespace texmesh::extract_http_test {

TEST(HttpExtract, GivesTheSameBytesAsTheFile) {
  testing::PackageParts parts = testing::make_package_parts();
  // The library does not cut the first range, of 64 KiB, where a file is shorter.
  parts.streams["later/unknown.bin"] = Bytes(70000, 7);
  const Bytes package = parts.build();
  const std::string body(package.begin(), package.end());
  httplib::Server server;
  server.Get("/a.texmesh", [&](const httplib::Request&, httplib::Response& response) {
    response.set_content(body, "application/octet-stream");  // the library answers ranges
  });
  const int port = server.bind_to_any_port("127.0.0.1");
  std::thread thread([&] { server.listen_after_bind(); });
  ExtractBudget budget;
  budget.bytes = {8000};
  budget.display_px = 64;
  Bytes over_http;
  try {
    PackageReader reader(open_url("http://127.0.0.1:" + std::to_string(port) + "/a.texmesh"));
    over_http = extract_model(reader, {budget}, {}).glb;
  } catch (const Error& e) {
    ADD_FAILURE() << e.what();
  }
  server.stop();
  thread.join();
  PackageReader reader(open_container(memory_source(package)));
  EXPECT_EQ(over_http, extract_model(reader, {budget}, {}).glb);
}

}  // namespace texmesh::extract_http_test
