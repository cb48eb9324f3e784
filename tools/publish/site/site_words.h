#pragma once
#include <map>

#include "tools/publish/site/site.h"

namespace texmesh {

/// What the pages say beside the texts of packages, in one language.
class SiteWords {
 public:
  /// English, the file words.json of the build.
  SiteWords();
  /// A file of words (--words): the same names, or some of them; English stands for others. InputError for
  /// names that are none of these, and for values that are no texts.
  SiteWords(const std::string& json, const std::string& file);

  /// Plain text, `{name}` in it replaced. A name that is none of the file's is its own word.
  std::string operator()(const std::string& name,
                         const std::map<std::string, std::string>& values = {}) const;
  /// The same as HTML.
  std::string html(const std::string& name, const std::map<std::string, std::string>& values = {}) const;
  /// "12 objects".
  std::string objects(std::size_t count) const;

 private:
  std::map<std::string, std::string> words_;
};

/// The file of English words, for whoever translates it.
std::string_view english_site_words();

/// By what visitors choose among the objects: a name of SiteWords, and what the package says of itself.
struct SiteFacet {
  const char* name;
  std::set<std::string> (*values)(const About& about);
};
/// Licence, author, and of what the publisher has added to about.json (extras) "period", and "keywords": a
/// list of texts, or one text with commas.
inline constexpr std::size_t kSiteFacets = 4;
extern const SiteFacet kSiteFacetList[kSiteFacets];

/// Choices above the list, of each facet that tells objects apart; "" where none does. A facet has its 200
/// most common values.
std::string facets_html(const std::vector<SiteObject>& objects, const SiteWords& words);
/// What the choices look into, as an attribute of an object's card: a list of "facet=value" as JSON.
std::string facets_of(const SiteObject& object);

}  // namespace texmesh
