// Packages from web servers: a good one, one without ranges, and every kind of bad one.
#include "delivery/cpp/http_store.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/delivery/raw_server.h"
#include "tests/format/package_fixture.h"

namespace texmesh {
namespace {

using namespace testing;  // the server
using Bytes = std::vector<std::uint8_t>;

const std::string& package() {
  static const std::string bytes = text_of(make_package(2, 40000));
  return bytes;
}

/// Reads everything that a client may ask for.
std::size_t read_all(PackageReader& reader) {
  std::size_t bytes = 0;
  for (const EntryRef& e : reader.index()) bytes += reader.entry(e).size();
  return bytes;
}

TEST(HttpStore, OneRequestStartsAndNothingIsFetchedTwice) {
  RawServer server([](const Request& r) { return Reply{ranged(package(), r)}; });
  PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
  EXPECT_EQ(server.requests().size(), 1u);
  EXPECT_EQ(server.requests()[0].first, 0u);
  EXPECT_EQ(server.requests()[0].last, kBootstrapBytes - 1);
  EXPECT_GT(read_all(reader), 0u);
  const std::size_t requests = server.requests().size();
  read_all(reader);
  EXPECT_EQ(server.requests().size(), requests);
  std::vector<int> fetched(package().size(), 0);
  for (const Request& r : server.requests())
    for (std::uint64_t i = r.first; i <= std::min<std::uint64_t>(r.last, package().size() - 1); ++i)
      ++fetched[i];
  EXPECT_LE(*std::max_element(fetched.begin(), fetched.end()), 1);
}

TEST(HttpStore, WithoutRangesTheTreeIsTaken) {
  std::map<std::string, std::string> files;
  const auto source =
      memory_source(std::span(reinterpret_cast<const std::uint8_t*>(package().data()), package().size()));
  for (const ContainerEntry& e : read_container(*source))
    files["/x/a/" + e.path] = text_of(source->read(e.offset, e.bytes));
  files["/x/a.texmesh"] = package();
  RawServer server([&](const Request& r) {
    const auto it = files.find(r.path);
    return Reply{it == files.end() ? answer(404, "", "no") : answer(200, "", it->second)};
  });
  PackageReader reader(open_url(server.url("/x/a.texmesh"), quick()));
  EXPECT_GT(read_all(reader), 0u);
  EXPECT_EQ(server.requests()[1].path, "/x/a/manifest.json");
  PackageReader tree(open_url(server.url("/x/a/"), quick()));
  EXPECT_EQ(tree.id(), reader.id());
}

TEST(HttpStore, WithoutRangesAndTreeTheWholeFileIsTakenWithinItsLimit) {
  RawServer server([](const Request& r) {
    return Reply{r.path == "/a.texmesh" ? answer(200, "", package()) : answer(404, "", "")};
  });
  PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
  EXPECT_GT(read_all(reader), 0u);
  HttpOptions small = quick();
  small.max_whole_bytes = package().size() - 1;
  EXPECT_THROW(PackageReader(open_url(server.url("/a.texmesh"), small)), InputError);
}

TEST(HttpStore, BrokenTransfersAreResumedWhereTheyBroke) {
  RawServer server([](const Request& r) {
    std::string bytes = ranged(package(), r, "ETag: \"one\"\r\n");
    if (r.number % 2 == 1) return Reply{bytes};
    return Reply{bytes.substr(0, bytes.size() - 10), true};
  });
  PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
  EXPECT_GT(read_all(reader), 0u);
  const std::vector<Request> requests = server.requests();
  ASSERT_GE(requests.size(), 2u);
  EXPECT_EQ(requests[1].last, requests[0].last);
  EXPECT_GT(requests[1].first, requests[0].first);
  EXPECT_EQ(requests[1].if_range, "\"one\"");
}

TEST(HttpStore, PassingFailuresAreRetriedLastingOnesAreErrors) {
  for (const int status : {408, 429, 500, 503}) {
    RawServer passing([&](const Request& r) {
      return Reply{r.number < 2 ? answer(status, "", "later") : ranged(package(), r)};
    });
    EXPECT_NO_THROW(PackageReader(open_url(passing.url("/a.texmesh"), quick()))) << status;
    RawServer lasting([&](const Request&) { return Reply{answer(status, "", "later")}; });
    EXPECT_THROW(PackageReader(open_url(lasting.url("/a.texmesh"), quick())), InputError) << status;
    EXPECT_EQ(lasting.requests().size(), 4u) << status;
  }
  for (const int status : {403, 404}) {
    RawServer server([&](const Request&) { return Reply{answer(status, "", "no")}; });
    EXPECT_THROW(PackageReader(open_url(server.url("/a.texmesh"), quick())), InputError);
    EXPECT_EQ(server.requests().size(), 1u);
  }
}

TEST(HttpStore, SilentServersAreGivenUp) {
  RawServer closes([](const Request&) { return Reply{"", true}; });
  EXPECT_THROW(PackageReader(open_url(closes.url("/a.texmesh"), quick())), InputError);
  HttpOptions once = quick();
  once.retries = 0;
  RawServer stalls([](const Request& r) {
    const std::string bytes = ranged(package(), r);
    return Reply{bytes.substr(0, bytes.size() / 2)};  // and then nothing
  });
  EXPECT_THROW(PackageReader(open_url(stalls.url("/a.texmesh"), once)), InputError);
  EXPECT_THROW(PackageReader(open_url("http://127.0.0.1:1/a.texmesh", once)), InputError);
}

TEST(HttpStore, LiesAboutRangesAreFound) {
  const auto refused = [](const std::function<std::string(const Request&)>& handler) {
    RawServer server([&](const Request& r) { return Reply{handler(r), true}; });
    EXPECT_ANY_THROW({
      PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
      read_all(reader);
    });
  };
  const std::string head = package().substr(0, kBootstrapBytes), size = std::to_string(package().size());
  refused([&](const Request&) { return answer(206, "", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: bytes 5-9/" + size + "\r\n", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: bytes 0-99999999999/100\r\n", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: items 0-1/2\r\n", head); });
  refused([&](const Request&) {
    return answer(206, "Content-Range: bytes 0-16383/" + size + "\r\n", head + "more");
  });
  refused(
      [&](const Request&) { return answer(206, "Content-Range: bytes 0-16383/" + size + "\r\n", "less"); });
  refused([&](const Request&) { return answer(416, "", ""); });
  refused([&](const Request&) { return answer(200, "", "no package"); });
  refused([&](const Request&) { return std::string("this is no HTTP\r\n\r\n"); });
  refused([&](const Request& r) { return r.number == 0 ? ranged(package(), r) : answer(416, "", ""); });
  refused(
      [&](const Request& r) { return r.number == 0 ? ranged(package(), r) : answer(200, "", package()); });
  refused([&](const Request& r) {
    return ranged(package() + std::string(static_cast<std::size_t>(r.number), 'x'), r);
  });
  refused([&](const Request& r) {
    return ranged(package(), r, "ETag: \"" + std::to_string(r.number) + "\"\r\n");
  });
  refused([&](const Request& r) {
    std::string changed = package();
    for (std::size_t i = kBootstrapBytes; i < changed.size(); i += 7) changed[i] ^= 1;
    return ranged(r.number == 0 ? package() : changed, r);
  });
}

TEST(HttpStore, UrlsAreKnownAndPasswordsNotShown) {
  EXPECT_TRUE(is_url("https://a/b.texmesh"));
  EXPECT_FALSE(is_url("a/http://b"));
  EXPECT_EQ(shown_url("http://me:secret@host/a@b"), "http://host/a@b");
  EXPECT_EQ(shown_url("http://host/x"), "http://host/x");
  EXPECT_THROW(open_url("ftp://a/b"), InputError);
}

}  // namespace
}  // namespace texmesh
