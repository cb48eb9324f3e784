#include "pipeline/about/source_fields.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <span>

#include "pipeline/about/code_tables.h"

namespace texmesh::licence_test {

using Kind = Licence::Kind;

TEST(ReadLicence, IdentifiersInAnySpellingAndTheirPage) {
  for (const char* text : {"CC-BY-4.0", "cc-by-4.0", " CC-BY-4.0 ", "Cc-By-4.0"}) {
    const Licence l = read_licence(text);
    EXPECT_EQ(l.kind, Kind::kSpdx) << text;
    EXPECT_EQ(l.text, "CC-BY-4.0");
    EXPECT_EQ(l.url, "https://spdx.org/licenses/CC-BY-4.0.html");
  }
}

TEST(ReadLicence, Expressions) {
  for (const auto& [given, spelled] :
       {std::pair{"mit or apache-2.0", "MIT OR Apache-2.0"},
        {"(MIT AND CC0-1.0) OR ISC", "(MIT AND CC0-1.0) OR ISC"},
        {"GPL-2.0-or-later WITH Classpath-exception-2.0", "GPL-2.0-or-later WITH Classpath-exception-2.0"},
        {"Apache-2.0+", "Apache-2.0+"},
        {"LicenseRef-Museum.1", "LicenseRef-Museum.1"},
        {"DocumentRef-x:LicenseRef-y", "DocumentRef-x:LicenseRef-y"}}) {
    const Licence l = read_licence(given);
    EXPECT_EQ(l.kind, Kind::kSpdx) << given;
    EXPECT_EQ(l.text, spelled);
    EXPECT_EQ(l.url, "") << given;  // one page says one licence only
  }
}

TEST(ReadLicence, WhatIsNoExpressionIsToldByTheWordThatIsWrong) {
  for (const auto& [given, wrong] : {std::pair{"CC-BY-9.0", "CC-BY-9.0"},
                                     {"MIT OR Nothing-1.0", "Nothing-1.0"},
                                     {"MIT MIT", "MIT"},
                                     {"MIT OR", ""},
                                     {"(MIT", ""},
                                     {"MIT)", ")"},
                                     {"MIT WITH MIT", "MIT"},
                                     {"", ""},
                                     {"LicenseRef-", "LicenseRef-"},
                                     {"all rights reserved", "all"},
                                     {"javascript:alert(1)", "javascript:alert"}}) {
    const Licence l = read_licence(given);
    EXPECT_EQ(l.kind, Kind::kOther) << given;
    EXPECT_EQ(l.wrong, wrong) << given;
    EXPECT_EQ(l.url, "");
  }
  EXPECT_EQ(read_licence(std::string(100000, '(')).kind, Kind::kOther);
}

TEST(ReadLicence, UrlsAndTheIdentifierWithItsUrl) {
  const std::string page = "https://rightsstatements.org/vocab/InC/1.0/";
  EXPECT_EQ(read_licence(page).kind, Kind::kUrl);
  EXPECT_EQ(read_licence(page).url, page);
  const Licence both = read_licence("CC-BY-4.0 (http://creativecommons.org/licenses/by/4.0/)");
  EXPECT_EQ(both.kind, Kind::kSpdx);
  EXPECT_EQ(both.text, "CC-BY-4.0");
  EXPECT_EQ(both.url, "http://creativecommons.org/licenses/by/4.0/");
  EXPECT_EQ(read_licence("CC-BY-9.0 (http://a.b/)").kind, Kind::kOther);
}

TEST(EpsgCode, OnlyCodesOfCoordinateReferenceSystems) {
  for (const std::uint64_t code : {2000, 3857, 4326, 4979, 25832, 31256, 5773, 900913})
    EXPECT_TRUE(is_epsg_code(code)) << code;
  for (const std::uint64_t code : {0, 1, 1999, 3792, 99999, 900914}) EXPECT_FALSE(is_epsg_code(code)) << code;
  EXPECT_FALSE(is_epsg_code(~std::uint64_t{0}));
}

TEST(CodeTables, AreSortedAndWithoutGapsInTheirOrder) {
  const std::span licences(kSpdxLicences, kSpdxLicenceCount),
      exceptions(kSpdxExceptions, kSpdxExceptionCount);
  for (const std::string_view name : licences) EXPECT_EQ(read_licence(std::string(name)).text, name);
  EXPECT_GT(licences.size(), 400u);
  for (const std::string_view name : exceptions)
    EXPECT_EQ(read_licence("MIT WITH " + std::string(name)).kind, Kind::kSpdx) << name;
  const std::span runs(kEpsgRuns, kEpsgRunCount);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_LE(runs[i].first, runs[i].last);
    if (i > 0) EXPECT_GT(runs[i].first, runs[i - 1].last + 1);
  }
}

}  // namespace texmesh::licence_test
