// Bytes that are no UTF-8 on their way through JSON.
#include "pipeline/io/uri.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace texmesh::wire_text_test {

TEST(WireText, Utf8StaysAsItIs) {
  for (const std::string s : {"", "a.glb", "b\\c d.obj", "Löwe.glb", "\xe2\x82\xac", "\xf0\x9f\x97\xbf"}) {
    EXPECT_TRUE(is_utf8(s)) << s;
    EXPECT_EQ(to_wire(s), s);
    EXPECT_EQ(from_wire(s), s);
    EXPECT_EQ(readable_name(s), s);
  }
}

TEST(WireText, AnyBytesComeBackAndAreJson) {
  std::string all;
  for (int c = 1; c < 256; ++c) all += static_cast<char>(c);
  for (const std::string& s :
       {std::string("\xff"), std::string("L\xf6we\\x41.jpg"), std::string("\x01x"), std::string("\xc0\xaf"),
        std::string("\xed\xa0\x80"), std::string("a\xe2\x82"), std::string("\xf4\x90\x80\x80"), all}) {
    EXPECT_TRUE(is_utf8(to_wire(s)));
    EXPECT_EQ(from_wire(nlohmann::json::parse(nlohmann::json(to_wire(s)).dump()).get<std::string>()), s);
  }
  EXPECT_FALSE(is_utf8("\xc0\xaf"));
  EXPECT_EQ(readable_name("L\xf6we.jpg"), "L\\xf6we.jpg");
}

TEST(WireText, WhatNobodyWroteIsTakenAsItStands) {
  EXPECT_EQ(from_wire("\x01\\x4"), "\\x4");
  EXPECT_EQ(from_wire("\x01\\xzz"), "\\xzz");
  EXPECT_EQ(from_wire("\x01"), "");
}

}  // namespace texmesh::wire_text_test
