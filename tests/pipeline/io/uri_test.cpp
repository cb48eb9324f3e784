#include "pipeline/io/uri.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh::uri_test {

std::string data(std::string_view uri, std::uint64_t max_bytes = 100) {
  const auto bytes = decode_data_uri(uri, max_bytes, "m.gltf", "/buffers/0/uri");
  return {bytes.begin(), bytes.end()};
}

TEST(Uri, DecodesEscapesOnceAndLeavesWhatIsNone) {
  EXPECT_EQ(percent_decoded("a%20b/%C3%a9.png"), "a b/\xC3\xA9.png");
  EXPECT_EQ(percent_decoded("100%25.png"), "100%.png");
  EXPECT_EQ(percent_decoded("%2541"), "%41");
  EXPECT_EQ(percent_decoded("%41"), "A");
  for (const char* as_it_is : {"", "%", "a%2", "%zz", "100%.png"})
    EXPECT_EQ(percent_decoded(as_it_is), as_it_is);
}

TEST(Uri, NamesThatLeaveTheFolderAreRefusedWithFilePlaceAndName) {
  for (const char* name :
       {"../secret", "", "/etc/hostname", "http://h/x", "a\n", "tex/../../x", "a\\b", "a/", "."})
    EXPECT_THROW(check_relative_name(name, "m.gltf", "/images/0/uri"), InputError) << name;
  try {
    check_relative_name("../secret", "m.gltf", "/images/0/uri");
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

TEST(DataUri, ReadsWrappedAndEscapedText) {
  EXPECT_EQ(data("data:a/b;base64,Zm9v\r\nYg=\n=\n"), "foob");
  EXPECT_EQ(data("data:a/b;base64, Zm 9v\tYg%3D%3d"), "foob");
  EXPECT_EQ(data("data:a/b;base64,%2B/%2b%2F"), "\xfb\xff\xbf");
}

TEST(DataUri, RefusesWhatIsNotBase64) {
  for (const char* uri :
       {"data:a/b,foo", "data:a/b;base64", "data:", "data:a/b;base64,Z", "data:a/b;base64,Zg=",
        "data:a/b;base64,Zh==", "data:a/b;base64,Zg===", "data:a/b;base64,Z g=", "data:a/b;base64,Zm-v",
        "data:a/b;base64,=", "data:a/b;base64,Zm=v", "data:a/b;base64,Zm9%", "data:a/b;base64,Zm9%00",
        "dat:a/b;base64,Zm9v"}) {
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

}  // namespace texmesh::uri_test
