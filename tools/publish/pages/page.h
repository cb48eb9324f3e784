#pragma once

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

// How every page of HTML is made: a template that the build puts into the program, values in its places, and
// the style that all pages share. Tables come from Table::html() (pipeline/io/table.h), curves from
// Plot::svg().

/// A file of a room's page/, as the build puts it into the program (cmake/PageFiles.cmake).
struct BuiltInFile {
  std::string_view name, text;
};
std::span<const BuiltInFile> export_page_files();  // of tools/publish/export/page
std::span<const BuiltInFile> pages_page_files();   // of tools/publish/pages/page
std::span<const BuiltInFile> site_page_files();    // of tools/publish/site/page

/// The text of the file with that name, which is there.
std::string_view built_in_text(std::span<const BuiltInFile> files, std::string_view name);
/// The style that all pages share, with a room's own behind it.
std::string page_style(std::string_view own);

/// Values by their names; what is HTML already, and what was escaped.
using TemplateValues = std::map<std::string, std::string, std::less<>>;
/// `text` with the value of NAME in the place of every {{NAME}}. A value is not looked into, whatever it
/// holds. std::logic_error for a name without a value.
std::string filled(std::string_view text, const TemplateValues& values);

/// A page that stands alone: no script, nothing from elsewhere but files beside it. Light and dark by the
/// reader's choice, and fit to print. `title` is plain text, `body` HTML. The first line is
/// kReportFirstLine.
std::string html_page(const std::string& title, const std::string& body);
/// A section of such a page with a heading; `body` is HTML, `id` a name of letters.
std::string html_section(const std::string& id, const std::string& heading, const std::string& body);
/// By this line a report is known from other pages.
inline constexpr std::string_view kReportFirstLine = "<!DOCTYPE html><!-- texmesh report 1 -->\n";

/// The last part of a path, also where a slash stands behind it.
std::string last_name(const std::string& path);
/// The name of a file or an unpacked package as people would write it: without path, ending, _ and -, with a
/// capital letter. "apple_food-01.texmesh": "Apple food 01".
std::string readable_title(const std::string& path);
/// Lengths of the sides in metres, centimetres or millimetres, by the longest: "12 x 8.5 x 30 cm".
std::string sides_in_words(Vec3d sides_m);
/// Title of a page about the package: what the package calls itself, or its file. Plain text.
std::string package_title(PackageReader& package);
/// A paragraph of HTML: whose the object is, and the licence as a link to where it can be read; "" where
/// nothing is known.
std::string rights_line(const About& about);

/// A line or a row of dots of a Plot.
struct PlotSeries {
  std::string name;    // plain text; "" = not in the legend
  std::string colour;  // class of the page's style: "a" to "e", or "q" for what stands back
  std::vector<std::pair<double, double>> points;
  bool strong = false, dashed = false, dots = false;
  bool steps = false;  // horizontal from each point to the next, not straight
};

/// A picture of lines for the page, as SVG in the page's colours.
struct Plot {
  std::string title, x_name, y_name;  // plain text; the title is what a reader who sees no picture gets
  double x_low = 1, x_high = 10;      // x_low < x_high; 0 < x_low on a logarithmic axis
  double y_high = 1;                  // the vertical axis goes from y_low to at least this
  double y_low = 0;                   // 0, or below: then the axis goes to this at least
  bool linear_x = false;              // the horizontal axis; else it is logarithmic
  std::vector<PlotSeries> series;
  std::string svg() const;
};

}  // namespace texmesh
