// Packages from web servers: a good one, one without ranges, and every kind of bad one.
#include "delivery/cpp/package/http_store.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <map>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/delivery/package/raw_server.h"
#include "tests/format/container/package_fixture.h"

namespace texmesh::http_store_test {

using namespace testing;        // the server
const std::string& package() {  // its start is not all of the first picture
  static const std::string bytes = text_of(make_package(2, 80000));
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
  EXPECT_EQ(server.requests()[0].last, kStartBytes - 1);
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
  EXPECT_TRUE(std::ranges::any_of(requests, [](const Request& r) { return r.first == kStartBytes - 10; }));
  for (const Request& r : requests) EXPECT_EQ(r.if_range, "");
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
    return Reply{bytes.substr(0, 5000)};  // and then nothing
  });
  EXPECT_THROW(PackageReader(open_url(stalls.url("/a.texmesh"), once)), InputError);
  EXPECT_THROW(PackageReader(open_url("http://127.0.0.1:1/a.texmesh", once)), InputError);
}

/// What opening and reading all of a package says of a server that answers so; "" where all is well.
std::string said_of(const std::function<std::string(const Request&)>& handler, const std::string& path) {
  RawServer server([&](const Request& r) { return Reply{handler(r), true}; });
  try {
    PackageReader reader(open_url(server.url(path), quick()));
    read_all(reader);
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(server.url("/")), std::string::npos) << e.what();
    return e.what();
  }
  return "";
}

void expect_said(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
}

TEST(HttpStore, APageInThePlaceOfAFileIsCalledOne) {
  const std::string page = "\n<!doctype html><title>Sign in</title>" + std::string(100, ' ');
  const std::string type = "Content-Type: text/html; charset=utf-8\r\n";
  for (const char* path : {"/a.texmesh", "/a/"}) {
    expect_said(said_of([&](const Request&) { return answer(200, type, page); }, path),
                {"a page", "status 200", "text/html; charset=utf-8", std::to_string(page.size()) + " bytes"});
    expect_said(said_of([&](const Request& r) { return ranged(page, r, type); }, path),
                {"a page", "status 206"});
    expect_said(said_of(
                    [&](const Request& r) {
                      return r.path == "/login" ? answer(200, type, page)
                                                : answer(302, "Location: /login\r\n", "");
                    },
                    path),
                {"a page", "redirected to http://127.0.0.1:", "/login"});
    expect_said(said_of([&](const Request&) { return answer(404, type, page); }, path),
                {"status 404", "text/html"});
  }
}

TEST(HttpStore, AServerThatGivesItsFrontPageForEverythingHasTheWholeFile) {
  const std::string front = answer(200, "Content-Type: text/html\r\n", "<html>" + std::string(1000, 'x'));
  EXPECT_EQ(
      said_of([&](const Request& r) { return r.path == "/a.texmesh" ? answer(200, "", package()) : front; },
              "/a.texmesh"),
      "");
}

TEST(HttpStore, APageThatComesLaterIsNoPartOfTheFile) {
  const std::string type = "Content-Type: text/html\r\n", page = "<html>" + std::string(1000, 'x');
  for (const int status : {200, 206})
    expect_said(said_of(
                    [&](const Request& r) {
                      if (r.number == 0) return ranged(package(), r);
                      return status == 200 ? answer(200, type, page)
                                           : answer(206, type + "Content-Range: bytes 0-1005/1006\r\n", page);
                    },
                    "/a.texmesh"),
                {status == 200 ? "status 200" : "it was replaced"});
}

std::string gzipped(const std::string& text) {
  z_stream z{};
  deflateInit2(&z, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&z, text.size()) + 64, 0);
  std::string in = text;
  z.next_in = reinterpret_cast<Bytef*>(in.data());
  z.avail_in = static_cast<uInt>(in.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data());
  z.avail_out = static_cast<uInt>(out.size());
  deflate(&z, Z_FINISH);
  out.resize(z.total_out);
  deflateEnd(&z);
  return out;
}

TEST(HttpStore, AServerThatCompressesIsReadWholeOrSaysSo) {
  const std::string gzip = "Content-Encoding: gzip\r\nContent-Type: application/octet-stream\r\n";
  EXPECT_EQ(said_of(
                [&](const Request& r) {
                  return r.path == "/a.texmesh" ? answer(200, gzip, gzipped(package())) : answer(404, "", "");
                },
                "/a.texmesh"),
            "");
  expect_said(said_of([&](const Request& r) { return ranged(gzipped(package()), r, gzip); }, "/a.texmesh"),
              {"status 206", "gzip", "must not compress"});
}

TEST(HttpStore, ALengthThatTheServerDoesNotTellIsLegal) {
  const auto without_total = [&](const std::string& file, const Request& r) {
    std::string text = ranged(file, r);
    const std::string total = "/" + std::to_string(file.size()) + "\r\n";
    return text.replace(text.find(total), total.size(), "/*\r\n");
  };
  EXPECT_EQ(said_of(
                [&](const Request& r) {
                  if (r.path != "/a.texmesh") return answer(404, "", "");
                  return r.ranged ? without_total(package(), r) : answer(200, "", package());
                },
                "/a.texmesh"),
            "");
  EXPECT_EQ(said_of(
                [&](const Request& r) {
                  return r.number == 0 ? ranged(package(), r) : without_total(package(), r);
                },
                "/a.texmesh"),
            "")
      << "later answers need not tell it again";
}

TEST(HttpStore, AServerMaySendLessThanWasAskedForButNoCrumbs) {
  std::uint64_t most = 20000;
  RawServer server([&](Request r) {
    r.last = std::min(r.last, r.first + most - 1);
    return Reply{ranged(package(), r)};
  });
  PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
  EXPECT_GT(read_all(reader), 0u);
  EXPECT_GT(server.requests().size(), package().size() / 20000);
  most = 10;
  EXPECT_ANY_THROW({
    PackageReader crumbs(open_url(server.url("/a.texmesh"), quick()));
    read_all(crumbs);
  });
}

TEST(HttpStore, LiesAboutRangesAreFound) {
  const auto refused = [](const std::function<std::string(const Request&)>& handler) {
    RawServer server([&](const Request& r) { return Reply{handler(r), true}; });
    EXPECT_ANY_THROW({
      PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
      read_all(reader);
    });
  };
  const std::string head = package().substr(0, kStartBytes), size = std::to_string(package().size());
  refused([&](const Request&) { return answer(206, "", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: bytes 5-9/" + size + "\r\n", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: bytes 0-99999999999/100\r\n", head); });
  refused([&](const Request&) { return answer(206, "Content-Range: items 0-1/2\r\n", head); });
  refused([&](const Request&) {
    return answer(206, "Content-Range: bytes 0-65535/" + size + "\r\n", head + "more");
  });
  refused(
      [&](const Request&) { return answer(206, "Content-Range: bytes 0-65535/" + size + "\r\n", "less"); });
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
    std::string changed = package();
    for (std::size_t i = kStartBytes; i < changed.size(); i += 7) changed[i] ^= 1;
    return ranged(r.number == 0 ? package() : changed, r);
  });
}

/// "HTTP/1.1 .." and headers alone; what follows is the server's.
std::string head(int status, const std::string& headers) {
  return "HTTP/1.1 " + std::to_string(status) + " X\r\n" + headers + "\r\n";
}

TEST(HttpStore, TricklesEnd) {
  HttpOptions o = quick();
  o.retries = 0;
  o.stall_timeout_s = 30;  // never silent for as long
  RawServer error([](const Request&) { return Reply{head(404, "Content-Length: 4000\r\n"), false, true}; });
  EXPECT_THROW(PackageReader(open_url(error.url("/a.texmesh"), o)), InputError);
  RawServer endless([](const Request&) { return Reply{head(404, ""), false, true}; });
  EXPECT_THROW(PackageReader(open_url(endless.url("/a.texmesh"), o)), InputError);
  o.connect_timeout_s = 0.2;
  o.stall_timeout_s = 0.3;
  o.least_bytes_s = 1e6;
  RawServer slow([](const Request& r) {
    const std::string bytes = ranged(std::string(20000, 'x'), r);
    return Reply{bytes.substr(0, bytes.find("\r\n\r\n") + 4), false, true};
  });
  EXPECT_THROW(PackageReader(open_url(slow.url("/a.texmesh"), o)), InputError);
}

TEST(HttpStore, CancelEndsWaitingAtOnce) {
  HttpOptions o = quick();
  o.stall_timeout_s = o.retry_delay_s = 60;
  const auto start = std::chrono::steady_clock::now();
  o.cancelled = [start] { return std::chrono::steady_clock::now() - start > std::chrono::milliseconds(200); };
  RawServer silent([](const Request&) { return Reply{}; });
  EXPECT_THROW(PackageReader(open_url(silent.url("/a.texmesh"), o)), InputError);
  RawServer busy([](const Request&) { return Reply{answer(503, "Retry-After: 60\r\n", "")}; });
  EXPECT_THROW(PackageReader(open_url(busy.url("/a.texmesh"), o)), InputError);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

using Files = std::map<std::string, std::string>;
Files tree_files() {
  Files files;
  const auto source =
      memory_source(std::span(reinterpret_cast<const std::uint8_t*>(package().data()), package().size()));
  for (const ContainerEntry& e : read_container(*source))
    files["/a/" + e.path] = text_of(source->read(e.offset, e.bytes));
  return files;
}

TEST(HttpStore, JsonThatAStoreKeepsCompressedIsRead) {
  const Files files = tree_files();
  for (const char* path : {"/a.texmesh", "/a/"})
    EXPECT_EQ(said_of(
                  [&](const Request& r) {
                    const auto it = files.find(r.path);
                    if (it == files.end()) return answer(r.path == "/a.texmesh" ? 200 : 404, "", package());
                    const bool json = r.path.ends_with(".json");
                    return answer(200, json ? "Content-Encoding: gzip\r\n" : "",
                                  json ? gzipped(it->second) : it->second);
                  },
                  path),
              "")
        << path;
}

TEST(HttpStore, SizesThatNoEntryHasAreNotAskedFor) {
  const auto hostile = [](const std::function<void(Manifest&)>& change, const std::string& path) {
    Files files = tree_files();
    std::string& json = files["/a/manifest.json"];
    Manifest m = read_manifest(std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
    change(m);
    json = write_manifest(m);
    RawServer server([&](const Request& r) {
      if (r.path == path) return Reply{head(200, ""), false, true};
      const auto it = files.find(r.path);
      return Reply{it == files.end() ? answer(404, "", "no") : answer(200, "", it->second)};
    });
    PackageReader reader(open_url(server.url("/a/"), quick()));
    EXPECT_THROW(read_all(reader), FormatError) << path;
    for (const Request& r : server.requests()) EXPECT_NE(r.path, path);
  };
  hostile([](Manifest& m) { m.index.bytes = 1'000'000'000'000; }, "/a/index.bin");
}

TEST(HttpStore, AServerOfManyThatAnswersIsTaken) {
  RawServer well([](const Request& r) { return Reply{ranged(package(), r)}; });
  RawServer gone([](const Request&) { return Reply{answer(404, "", "")}; });
  RawServer busy([](const Request&) { return Reply{answer(503, "", "")}; });
  RawServer silent([](const Request&) { return Reply{}; });
  RawServer lying([](const Request& r) { return Reply{ranged(std::string(20000, 'x'), r)}; });
  const std::string nobody = "http://127.0.0.1:1/a.texmesh";
  for (const std::string& bad : {nobody, gone.url("/a.texmesh"), busy.url("/a.texmesh"),
                                 silent.url("/a.texmesh"), lying.url("/a.texmesh"), gone.url("/a/")}) {
    auto store = open_urls({bad, well.url("/a.texmesh")}, quick());
    const HttpStore& server = *store;
    PackageReader reader(std::move(store));
    EXPECT_EQ(server.place().mirror, 1u) << bad;
    EXPECT_EQ(server.place().url, well.url("/a.texmesh"));
    EXPECT_GT(read_all(reader), 0u);
  }
  EXPECT_THROW(PackageReader(open_urls({nobody, gone.url("/a.texmesh")}, quick())), InputError);
  EXPECT_THROW(open_urls({}), InputError);
}

TEST(HttpStore, AnotherServerTakesTheRestWhenOneDies) {
  RawServer well([](const Request& r) { return Reply{ranged(package(), r, "ETag: \"other\"\r\n")}; });
  RawServer dies([](const Request& r) {
    return r.number == 0 ? Reply{ranged(package(), r, "ETag: \"one\"\r\n")} : Reply{answer(500, "", "")};
  });
  PackageReader reader(open_urls({dies.url("/a.texmesh"), well.url("/a.texmesh")}, quick()));
  EXPECT_GT(read_all(reader), 0u);
  EXPECT_FALSE(well.requests().empty());
}

TEST(HttpStore, TriesThatBringSomethingDoNotCount) {
  RawServer server([](const Request& r) {
    const std::string bytes = ranged(package(), r);
    return Reply{bytes.substr(0, std::min<std::size_t>(bytes.size(), 3000)), true};
  });
  HttpOptions o = quick();
  o.retries = 1;
  PackageReader reader(open_url(server.url("/a.texmesh"), o));
  EXPECT_GT(read_all(reader), 0u);
  EXPECT_GT(server.requests().size(), 10u);
}

TEST(HttpStore, FilesOfATreeAreResumed) {
  Files files = tree_files();
  RawServer server([&](const Request& r) {
    const auto it = files.find(r.path);
    if (it == files.end()) return Reply{answer(404, "", "")};
    const std::string bytes =
        r.ranged ? ranged(it->second, r, "ETag: \"e\"\r\n") : answer(200, "ETag: \"e\"\r\n", it->second);
    return r.path == "/a/manifest.json" ? Reply{bytes} : Reply{bytes.substr(0, 9000), true};
  });
  HttpOptions o = quick();
  o.retries = 1;
  PackageReader reader(open_url(server.url("/a/"), o));
  EXPECT_GT(read_all(reader), 0u);
  bool resumed = false;
  for (const Request& r : server.requests()) {
    resumed |= r.ranged && r.first > 8000;
    EXPECT_EQ(r.if_range, "");
  }
  EXPECT_TRUE(resumed);
}

TEST(HttpStore, WhatIsKnownToBeNeededIsOneRequest) {
  RawServer server([](const Request& r) { return Reply{ranged(package(), r)}; });
  PackageReader reader(open_url(server.url("/a.texmesh"), quick()));
  const Manifest& m = reader.manifest();
  const std::uint64_t end = m.tables.offset + m.tables.bytes;
  reader.store().prefetch({m.scales.back().glb, {"", m.index.offset, end - m.index.offset, {}}});
  const std::size_t requests = server.requests().size();
  EXPECT_LE(requests, 2u);
  reader.tables();
  reader.quality();
  reader.scale_glb(m.scales.back().scale);
  reader.table_stream(1, 0);
  EXPECT_EQ(server.requests().size(), requests);
  Files files = tree_files();
  RawServer tree([&](const Request& r) {
    const auto it = files.find(r.path);
    return Reply{it == files.end() ? answer(404, "", "") : answer(200, "", it->second)};
  });
  PackageReader whole(open_url(tree.url("/a/"), quick()));
  whole.store().prefetch({m.index, m.tables});
  EXPECT_EQ(tree.requests().size(), 3u);
  whole.index();
  EXPECT_EQ(tree.requests().size(), 3u);
}

/// The server of a package answers its first request by a range, and then as `later` says.
struct LaterAnswers {
  std::string error;
  bool tree = false;
  std::size_t read = 0;
};
LaterAnswers read_with(const std::function<std::string(const Request&)>& later, Files files) {
  RawServer server([&](const Request& r) {
    if (const auto it = files.find(r.path); it != files.end()) return Reply{answer(200, "", it->second)};
    if (r.path != "/a.texmesh") return Reply{answer(404, "", "no")};
    return Reply{r.number == 0 ? ranged(package(), r, "ETag: \"one\"\r\n") : later(r)};
  });
  LaterAnswers out;
  auto store = open_urls({server.url("/a.texmesh")}, quick());
  const HttpStore& at = *store;
  PackageReader reader(std::move(store));
  try {
    out.read = read_all(reader);
  } catch (const Error& e) {
    out.error = e.what();
  }
  out.tree = at.place().url.ends_with("/a/");
  return out;
}

TEST(HttpStore, RangesThatEndLeadToTheTreeOfTheSamePackage) {
  const auto whole = [](const char* headers) {
    return [headers](const Request&) { return answer(200, headers, package()); };
  };
  for (const char* same : {"ETag: \"one\"\r\n", "", "ETag: W/\"two\"\r\n"}) {
    const LaterAnswers got = read_with(whole(same), tree_files());
    EXPECT_EQ(got.error, "") << same;
    EXPECT_TRUE(got.tree) << same;
    EXPECT_GT(got.read, 0u);
  }
  EXPECT_NE(read_with(whole(""), {}).error.find("ranges are no longer answered"), std::string::npos);
  Files other = tree_files();
  other["/a/manifest.json"].back() = '\n';
  EXPECT_NE(read_with(whole(""), other).error.find("replaced"), std::string::npos);
}

std::string other_package() {  // as long as package()
  std::string other = package();
  for (char& c : other) c ^= 1;
  return other;
}

TEST(HttpStore, AReplacedPackageIsReadAnew) {
  const auto replaced = [](const std::function<std::string(const Request&)>& later) {
    return read_with(later, tree_files()).error.find("replaced, read it anew") != std::string::npos;
  };
  const std::string longer = package() + "more";
  EXPECT_TRUE(replaced([](const Request&) { return answer(200, "ETag: \"two\"\r\n", package()); }));
  EXPECT_TRUE(replaced([&](const Request&) { return answer(200, "", longer); }));
  const std::string other = other_package();
  EXPECT_TRUE(replaced([&](const Request& r) { return ranged(other, r, "ETag: \"two\"\r\n"); }));
  EXPECT_TRUE(replaced([&](const Request& r) { return ranged(longer, r); }));
  EXPECT_TRUE(replaced([](const Request&) { return answer(416, "", ""); }));
}

TEST(HttpStore, AddressesMayBePastedAsPeopleWriteThem) {
  RawServer server([&](const Request& r) {
    return Reply{r.path == "/a%20%C3%BC%41.texmesh" ? ranged(package(), r) : answer(404, "", "")};
  });
  PackageReader reader(open_url(server.url("/a \xc3\xbc%41.texmesh"), quick()));
  EXPECT_GT(read_all(reader), 0u);
}

TEST(HttpStore, ServersBehindOneNameMayHaveETagsOfTheirOwn) {
  const LaterAnswers got = read_with(
      [](const Request& r) { return ranged(package(), r, "ETag: \"" + std::to_string(r.number) + "\"\r\n"); },
      {});
  EXPECT_EQ(got.error, "");
  EXPECT_GT(got.read, 0u);
  const LaterAnswers ended = read_with(
      [](const Request& r) {
        const std::string etag = "ETag: \"" + std::to_string(r.number) + "\"\r\n";
        return r.number < 5 ? ranged(package(), r, etag) : answer(200, etag, package());
      },
      tree_files());
  EXPECT_EQ(ended.error, "");
  EXPECT_TRUE(ended.tree);
}

TEST(HttpStore, NothingOfAReplacedPackageIsKept) {
  std::atomic<int> fails = 0;  // of requests for the start
  std::atomic<bool> replaced = true;
  RawServer server([&](const Request& r) {
    if (r.number == 0) return Reply{ranged(package(), r, "ETag: \"one\"\r\n")};
    if (r.first == 0 && fails-- > 0) return Reply{answer(404, "", "no")};
    return Reply{ranged(replaced ? other_package() : package(), r, "ETag: \"two\"\r\n")};
  });
  const auto store = open_url(server.url("/a.texmesh"), quick());
  const EntryRef e = read_manifest(store->read_manifest()).scales.front().glb;
  const auto said = [&] {
    try {
      store->read(e, 0, e.bytes);
      return std::string();
    } catch (const Error& error) {
      return std::string(error.what());
    }
  };
  const std::string expected = "replaced, read it anew";
  EXPECT_NE(said().find(expected), std::string::npos);
  EXPECT_NE(said().find(expected), std::string::npos) << "the second read has bytes of the first";
  fails = 1;
  EXPECT_NE(said().find("status 404"), std::string::npos);
  EXPECT_NE(said().find(expected), std::string::npos) << "a look that failed counts as one";
  replaced = false;
  EXPECT_EQ(said(), "");
  EXPECT_TRUE(text_of(store->read(e, 0, e.bytes)) == package().substr(e.offset, e.bytes));
}

TEST(HttpStore, TheNextServerSendsAgainWhatMayBeOfAnotherPackage) {
  std::atomic<std::uint64_t> failing = 0;
  RawServer replaced([&](const Request& r) {
    if (r.first == failing && r.number > 0) return Reply{answer(500, "", "")};
    return Reply{ranged(r.number == 0 ? package() : other_package(), r,
                        r.number == 0 ? "ETag: \"one\"\r\n" : "ETag: \"two\"\r\n")};
  });
  RawServer well([](const Request& r) { return Reply{ranged(package(), r)}; });
  const auto store = open_urls({replaced.url("/a.texmesh"), well.url("/a.texmesh")}, quick());
  const Manifest m = read_manifest(store->read_manifest());
  const EntryRef a = m.scales.front().glb, b = m.scales.at(1).glb;
  failing = a.offset;
  // Not all of them: ranges that meet would be one request.
  store->prefetch({{a.path, a.offset, 10000, {}}, {b.path, b.offset, 10000, {}}});
  for (const EntryRef& e : {a, b})
    EXPECT_TRUE(text_of(store->read(e, 0, 10000)) == package().substr(e.offset, 10000)) << e.path;
}

TEST(HttpStore, TellsHowItsServerCanBeRead) {
  Files files = tree_files();
  files["/a.texmesh"] = package();
  files["/b.texmesh"] = package();
  const auto place_of = [&](bool ranges, const std::string& path) {
    RawServer server([&](const Request& r) {
      const auto it = files.find(r.path);
      if (it == files.end()) return Reply{answer(404, "", "")};
      return Reply{ranges && r.ranged ? ranged(it->second, r, "ETag: \"e\"\r\n")
                                      : answer(200, "", it->second)};
    });
    auto store = open_urls({server.url(path)}, quick());
    const HttpStore& at = *store;
    PackageReader reader(std::move(store));
    HttpPlace place = at.place();
    place.url = place.url.substr(server.url("").size());
    return place;
  };
  EXPECT_TRUE(place_of(true, "/a.texmesh").ranges);
  EXPECT_EQ(place_of(true, "/a.texmesh").etag, "\"e\"");
  EXPECT_EQ(place_of(false, "/a.texmesh").url, "/a/");
  EXPECT_FALSE(place_of(false, "/a.texmesh").ranges);
  const HttpPlace whole = place_of(false, "/b.texmesh");
  EXPECT_TRUE(whole.in_memory);
  EXPECT_GT(whole.bytes_s, 1000) << "of the whole file: the first answer was broken off";
  EXPECT_TRUE(place_of(true, "/a/").ranges);
  EXPECT_FALSE(place_of(false, "/a/").ranges);
}

TEST(HttpStore, UrlsAreKnownAndPasswordsNotShown) {
  EXPECT_TRUE(is_url("https://a/b.texmesh"));
  EXPECT_FALSE(is_url("a/http://b"));
  EXPECT_EQ(shown_url("http://me:secret@host/a@b"), "http://host/a@b");
  EXPECT_EQ(shown_url("http://host/x"), "http://host/x");
  EXPECT_THROW(open_url("ftp://a/b"), InputError);
}

}  // namespace texmesh::http_store_test
