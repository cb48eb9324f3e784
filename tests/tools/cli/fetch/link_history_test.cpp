// Averages of hosts from run to run, and files that are no such thing.
#include "tools/cli/fetch/link_history.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "format/base/errors.h"
#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh {
namespace {

using testing::TemporaryFolder;

TEST(LinkHistory, AveragesArePerHostAndSurviveAFile) {
  const TemporaryFolder folder;
  const std::string path = folder / "state/texmesh/links.json";
  LinkHistory h = LinkHistory::read(path);
  EXPECT_FALSE(h.average_bytes_s("a.example").has_value());
  h.add("a.example", 1000);
  h.add("a.example", 2000);
  h.add("a.example", 6000);
  h.add("b.example:8080", 50);
  h.write(path);
  const LinkHistory again = LinkHistory::read(path);
  EXPECT_DOUBLE_EQ(*again.average_bytes_s("a.example"), 3000);
  EXPECT_DOUBLE_EQ(*again.average_bytes_s("b.example:8080"), 50);
  EXPECT_TRUE(testing::follows_schema(nlohmann::json::parse(testing::read_text(path)), "link-history.v1"));
  EXPECT_EQ(testing::files_beneath(folder.path().string()).size(), 1u);  // no temporary is left
}

TEST(LinkHistory, OldLoadsFadeAndOldHostsAreForgotten) {
  LinkHistory h;
  for (int i = 0; i < 100; ++i) h.add("a", 1000);
  h.add("a", 17000);
  EXPECT_DOUBLE_EQ(*h.average_bytes_s("a"), 2000);  // a 16th of the new one
  for (std::size_t i = 0; i < LinkHistory::kMostHosts - 1; ++i) h.add("h" + std::to_string(i), 10);
  EXPECT_TRUE(h.average_bytes_s("a").has_value());
  h.add("one-more", 10);
  EXPECT_FALSE(h.average_bytes_s("a").has_value());
  EXPECT_TRUE(h.average_bytes_s("h0").has_value());
}

TEST(LinkHistory, NonsenseIsNotAdded) {
  LinkHistory h;
  for (const double bad :
       {0.0, -1.0, 1e13, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    h.add("a", bad);
  h.add("", 10);
  h.add("A host", 10);
  EXPECT_FALSE(h.average_bytes_s("a") || h.average_bytes_s("") || h.average_bytes_s("A host"));
}

TEST(LinkHistory, HostileFilesAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "links.json", host = R"({"host":"a","bytes_s":10,"loads":1})";
  const auto document = [](const std::string& hosts) { return R"({"version":1,"hosts":[)" + hosts + "]}"; };
  std::string many = R"({"host":"h","bytes_s":10,"loads":1})";
  for (int i = 0; i < 1000; ++i)
    many += R"(,{"host":"h)" + std::to_string(i) + R"(","bytes_s":10,"loads":1})";
  for (const std::string& bad :
       {std::string(), std::string("[]"), std::string("{\"version\":1"), std::string(1 << 20, ' '),
        std::string(200'000, '['), document(host + "," + host), document(many),
        std::string(R"({"version":2,"hosts":[]})"), std::string(R"({"version":1,"hosts":[],"x":1})"),
        document(R"({"host":"a/../b","bytes_s":10,"loads":1})"),
        document(R"({"host":"a","bytes_s":-10,"loads":1})"),
        document(R"({"host":"a","bytes_s":1e300,"loads":1})"),
        document(R"({"host":"a","bytes_s":10,"loads":0})"),
        document(R"({"host":"a","bytes_s":10,"loads":1e99})"),
        document(R"({"host":"a","bytes_s":"10","loads":1})"),
        document(R"({"host":7,"bytes_s":10,"loads":1})"),
        document(R"({"host":"a","bytes_s":10,"loads":1,"more":1})"), document("7")}) {
    testing::write_text(path, bad);
    EXPECT_THROW(LinkHistory::read(path), InputError) << bad.substr(0, 80);
  }
  testing::write_text(path, document(host));
  EXPECT_NO_THROW(LinkHistory::read(path));
  EXPECT_THROW(LinkHistory::read(folder.path().string()), InputError);
  EXPECT_THROW(LinkHistory::read("/dev/zero"), InputError);
}

TEST(LinkHistory, HostsOfUrls) {
  EXPECT_EQ(host_of_url("https://User:Secret@Example.org:8080/a@b?x"), "example.org:8080");
  EXPECT_EQ(host_of_url("http://[::1]:80"), "[::1]:80");
  EXPECT_EQ(host_of_url("ftp://example.org"), "");
  EXPECT_EQ(host_of_url("http://a b/"), "");
  EXPECT_EQ(host_of_url("http:///x"), "");
}

}  // namespace
}  // namespace texmesh
