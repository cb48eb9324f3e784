#include "pipeline/io/uri.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh {
namespace {

std::string decoded(std::string_view uri) { return decode_uri(uri, "m.gltf", "/images/0/uri"); }
std::string data(std::string_view uri, std::uint64_t max_bytes = 100) {
  const auto bytes = decode_data_uri(uri, max_bytes, "m.gltf", "/buffers/0/uri");
  return {bytes.begin(), bytes.end()};
}

TEST(Uri, DecodesEscapesOnce) {
  EXPECT_EQ(decoded("a%20b/%C3%a9.png"), "a b/\xC3\xA9.png");
  EXPECT_EQ(decoded("100%25.png"), "100%.png");
  EXPECT_EQ(decoded("%2541"), "%41");
  EXPECT_EQ(decoded("%41"), "A");
}

TEST(Uri, RefusesBrokenEscapesAndWhatTheyHide) {
  for (const char* uri : {"%", "a%2", "%zz", "%2e%2e/secret", "%2E", "%2fetc/hostname", "a%00b", "%5c",
                          "http%3A//h/x", "a%0a", "tex%2F..%2f..%2Fx", ""}) {
    EXPECT_THROW(decoded(uri), InputError) << uri;
  }
}

TEST(Uri, MessageNamesFilePlaceAndName) {
  try {
    decoded("../secret");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_STREQ(e.what(),
                 "m.gltf: /images/0/uri: expected a relative name beneath the model's folder, found \"..\" "
                 "in \"../secret\"");
  }
}

TEST(DataUri, DecodesEveryLength) {
  EXPECT_EQ(data("data:application/octet-stream;base64,"), "");
  EXPECT_EQ(data("data:;base64,Zg=="), "f");
  EXPECT_EQ(data("data:a/b;base64,Zm8="), "fo");
  EXPECT_EQ(data("DATA:a/b;base64,Zm9v"), "foo");
  EXPECT_EQ(data("data:a/b;base64,Zm9vYg"), "foob");
  EXPECT_EQ(data("data:a/b;base64,+/+/"), "\xfb\xff\xbf");
}

TEST(DataUri, RefusesWhatIsNotBase64) {
  for (const char* uri :
       {"data:a/b,foo", "data:a/b;base64", "data:", "data:a/b;base64,Z", "data:a/b;base64,Zg=",
        "data:a/b;base64,Zh==", "data:a/b;base64,Zg===", "data:a/b;base64,Z g=", "data:a/b;base64,Zm-v",
        "data:a/b;base64,=", "data:a/b;base64,Zm=v", "dat:a/b;base64,Zm9v"}) {
    EXPECT_THROW(data(uri), InputError) << uri;
  }
}

TEST(DataUri, RefusesMoreThanTheLimit) {
  EXPECT_EQ(data("data:a/b;base64,Zm9v", 3), "foo");
  EXPECT_THROW(data("data:a/b;base64,Zm9v", 2), InputError);
}

TEST(UrlOrigin, IsSchemeHostAndPort) {
  EXPECT_EQ(url_origin("https://a.example:81/b?c://d"), "https://a.example:81");
  EXPECT_EQ(url_origin("http://a.example?b/c"), "http://a.example");
  EXPECT_EQ(url_origin("answers.php"), "");
}

}  // namespace
}  // namespace texmesh
